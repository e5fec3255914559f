#pragma once

#include <filesystem>
#include <string>

#include "common/model/reduced_model.h"

namespace exmat::test {

/// A model of two tets that fits every rule of the format but no physics. Free: with /rigid and without fixed vertices.
ReducedModel small_model(bool constrained = true, bool with_examples = true);

/// A folder for one test, removed with it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }
  /// Entries in it.
  std::size_t size() const;

 private:
  std::filesystem::path path_;
};

std::string read_file(const std::filesystem::path& file);
void write_file(const std::filesystem::path& file, const std::string& content);

}  // namespace exmat::test

#pragma once

#include <concepts>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

namespace exmat {

/// A bundle to be read: a file, HDF5 or a pack, or a pack in memory.
class BundleInput {
 public:
  BundleInput() = default;
  template <typename File>
  requires(std::convertible_to<const File&, std::filesystem::path> && !std::same_as<File, BundleInput>)
      BundleInput(const File& file)
      : file_(file) {}  // NOLINT(google-explicit-constructor): a file is such an input
  /// A pack in memory, where `pack` is not null; else the file. `file` names it in messages.
  BundleInput(std::filesystem::path file, std::shared_ptr<const std::string> pack)
      : file_(std::move(file)), pack_(std::move(pack)) {}

  const std::filesystem::path& file() const { return file_; }
  const std::shared_ptr<const std::string>& pack() const { return pack_; }

 private:
  std::filesystem::path file_;
  std::shared_ptr<const std::string> pack_;
};

}  // namespace exmat

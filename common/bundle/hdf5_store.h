#pragma once

#include "common/bundle/bundle_store.h"
#include "common/hdf5/hdf5_file.h"

namespace exmat {

/// A bundle in an HDF5 file.
class Hdf5Store : public BundleStore {
 public:
  explicit Hdf5Store(const std::filesystem::path& file) : file_(Hdf5File::open(file)) {}

  const std::string& name() const override { return file_.name(); }
  std::size_t capacity() const override { return file_.capacity(); }
  bool describes_itself() const override { return true; }
  bool has_group(const std::string& path) const override { return file_.has_group(path); }
  bool has_dataset(const std::string& path) const override { return file_.has_dataset(path); }
  std::vector<std::string> list(const std::string& group) const override { return file_.list(group); }
  std::unique_ptr<StoredArray> open_dataset(const std::string& path) const override;
  AttributeValue read_attribute(const std::string& object, const std::string& name) const override {
    return file_.read_attribute(object, name);
  }
  std::optional<std::int64_t> checksum(const std::string& dataset) const override;

 private:
  Hdf5File file_;
};

}  // namespace exmat

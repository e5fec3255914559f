#include "common/bundle/hdf5_store.h"

#include <utility>

namespace exmat {
namespace {

class Hdf5Array : public StoredArray {
 public:
  explicit Hdf5Array(Hdf5Dataset dataset) : dataset_(std::move(dataset)) {}

  const std::string& path() const override { return dataset_.path(); }
  const std::vector<std::int64_t>& sizes() const override { return dataset_.sizes(); }
  std::optional<ElementType> type() const override { return dataset_.type(); }
  std::string type_name() const override { return dataset_.type_name(); }
  std::size_t element_count() const override { return dataset_.element_count(); }
  void check_storage() const override { dataset_.check_storage(); }
  void read(void* data, ElementType type) const override { dataset_.read(data, type); }
  void read_rows(std::int64_t first, std::int64_t count, void* data, ElementType type) const override {
    dataset_.read_rows(first, count, data, type);
  }

 private:
  Hdf5Dataset dataset_;
};

}  // namespace

std::unique_ptr<StoredArray> Hdf5Store::open_dataset(const std::string& path) const {
  return std::make_unique<Hdf5Array>(file_.open_dataset(path));
}

std::optional<std::int64_t> Hdf5Store::checksum(const std::string& dataset) const {
  const AttributeValue stored = file_.read_attribute(dataset, "crc32");
  const auto* const crc = std::get_if<std::int64_t>(&stored);
  return crc == nullptr ? std::nullopt : std::optional(*crc);
}

}  // namespace exmat

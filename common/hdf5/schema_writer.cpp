#include <fmt/format.h>
#include <stdexcept>

#include "common/core/version.h"
#include "common/hdf5/hdf5_file.h"

namespace exmat {
namespace {

// That of the project in CMakeLists.txt; tests/format compares them.

void write_labels(Hdf5File& file, const DatasetSchema& schema, const std::string& path) {
  file.write_attribute(path, "description", schema.description);
  file.write_attribute(path, "units", schema.units);
  file.write_attribute(path, "dims", schema.dims_text);
}

}  // namespace

std::string generator_name() { return fmt::format("exmat {}", version()); }

void write_header(Hdf5File& file, const FileSchema& schema, const std::string& generator) {
  file.write_attribute("/", "format", schema.format);
  file.write_attribute("/", "format_version", schema.format_version);
  file.write_attribute("/", "generator", generator);
}

void write_group(Hdf5File& file, const GroupSchema& schema, const std::string& path) {
  file.create_group(path);
  file.write_attribute(path, "description", schema.description);
}

void write_dataset(Hdf5File& file, const DatasetSchema& schema, const std::string& path,
                   std::span<const std::int64_t> sizes, const void* data) {
  Hdf5Dataset dataset = file.create_dataset(path, schema.type, sizes);
  dataset.write(data, schema.type);
  write_labels(file, schema, path);
  const std::size_t bytes = dataset.element_count() * size_of(schema.type);
  file.write_checksum(path, crc32_of({static_cast<const std::byte*>(data), bytes}));
}

RowWriter::RowWriter(Hdf5File& file, const DatasetSchema& schema, const SymbolSizes& sizes)
    : file_(file),
      type_(schema.type),
      dataset_(file.create_dataset(schema.path, schema.type, sizes.evaluate(schema.dims))) {
  row_size_ = 1;
  for (std::size_t axis = 1; axis < dataset_.sizes().size(); ++axis)
    row_size_ *= static_cast<std::size_t>(dataset_.sizes()[axis]);
  write_labels(file, schema, schema.path);
}

void RowWriter::append_raw(std::span<const std::byte> row, ElementType type) {
  if (type != type_ || row.size() != row_size_ * size_of(type_) || next_row_ >= dataset_.sizes().front())
    throw std::logic_error(dataset_.path() + ": wrong type or size of a row, or too many rows");
  if (!row.empty()) dataset_.write_rows(next_row_, 1, row.data(), type_);
  crc32_ = crc32_of(row, crc32_);
  ++next_row_;
}

void RowWriter::finish() {
  if (next_row_ != dataset_.sizes().front()) throw std::logic_error(dataset_.path() + ": rows are missing");
  file_.write_checksum(dataset_.path(), crc32_);
}

}  // namespace exmat

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hdf5.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/saturating_product.h"
#include "common/hdf5/hdf5_access.h"
#include "common/hdf5/hdf5_file.h"

namespace exmat {

using namespace hdf5_access;

namespace {

std::vector<std::int64_t> chunk_sizes(hid_t properties) {
  const int rank = std::max(H5Pget_chunk(properties, 0, nullptr), 0);
  std::vector<hsize_t> sizes(static_cast<std::size_t>(rank));
  H5Pget_chunk(properties, rank, sizes.data());
  return {sizes.begin(), sizes.end()};
}

// The name or number of a filter that is not read, or comes a second time: deflated data may deflate again.
std::optional<std::string> odd_filter(hid_t properties) {
  std::array<bool, 3> seen{};
  constexpr std::array<H5Z_filter_t, 3> kKnown = {H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE, H5Z_FILTER_FLETCHER32};
  for (int i = 0; i < H5Pget_nfilters(properties); ++i) {
    std::size_t parameters = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(properties, static_cast<unsigned>(i), nullptr, &parameters, nullptr, 0, nullptr, nullptr);
    const auto known = static_cast<std::size_t>(std::ranges::find(kKnown, filter) - kKnown.begin());
    if (known == kKnown.size()) return fmt::format("HDF5 filter {}", filter);
    if (std::exchange(seen[known], true)) return fmt::format("HDF5 filter {} twice", filter);
  }
  return std::nullopt;
}

}  // namespace

Hdf5Dataset::Hdf5Dataset(Hdf5Handle handle, std::string file, std::string path)
    : handle_(std::move(handle)), file_(std::move(file)), path_(std::move(path)) {
  const auto space = make_handle(H5Dget_space(handle_.get()), H5Sclose);
  if (space.get() < 0) fail_damaged(file_, path_);
  if (H5Sget_simple_extent_type(space.get()) == H5S_NULL)
    throw InputError({file_, path_, "an array", "a null dataset", ""});
  sizes_ = sizes_of(space.get());
}

std::optional<ElementType> Hdf5Dataset::type() const {
  const auto type = make_handle(H5Dget_type(handle_.get()), H5Tclose);
  return element_type_of(type.get());
}

std::string Hdf5Dataset::type_name() const {
  const auto type = make_handle(H5Dget_type(handle_.get()), H5Tclose);
  return describe_type(type.get());
}

std::size_t Hdf5Dataset::element_count() const { return saturating_product(sizes_, 1); }

void Hdf5Dataset::check_storage() const {
  const auto type = make_handle(H5Dget_type(handle_.get()), H5Tclose);
  const auto properties = make_handle(H5Dget_create_plist(handle_.get()), H5Pclose);
  const auto file = make_handle(H5Iget_file_id(handle_.get()), H5Fclose);
  const std::size_t file_bytes = file_size(file.get());
  const auto refuse = [this](const std::string& expected, const std::string& found) {
    throw InputError({file_, path_, expected, found, ""});
  };

  const H5D_layout_t layout = H5Pget_layout(properties.get());
  const bool is_plain =
      (layout == H5D_CONTIGUOUS && H5Pget_external_count(properties.get()) == 0) || layout == H5D_COMPACT;
  if (!is_plain && layout != H5D_CHUNKED) refuse("data within the file", "a reference to another file or dataset");
  const std::size_t bytes = saturating_product(sizes_, H5Tget_size(type.get()));
  const std::size_t capacity = is_plain ? file_bytes : saturating_product(file_bytes, kMaxExpansion);
  const auto chunk = chunk_sizes(properties.get());
  // Each by itself too: beside a size of 0 any other would pass, and products with it overflow.
  const bool is_large =
      std::ranges::any_of(sizes_, [&](std::int64_t size) { return static_cast<std::size_t>(size) > capacity; });
  if (bytes > capacity || is_large)
    refuse(fmt::format("sizes that fit in a file of {} bytes", file_bytes),
           fmt::format("{}", fmt::join(sizes_, " x ")));
  if (!is_plain && saturating_product(chunk, H5Tget_size(type.get())) > capacity)
    refuse(fmt::format("chunks that fit in a file of {} bytes", file_bytes),
           fmt::format("{}", fmt::join(chunk, " x ")));
  if (const auto filter = odd_filter(properties.get())) refuse("contiguous data or deflate", *filter);
  if (bytes > 0 && H5Dget_storage_size(handle_.get()) == 0) refuse("data", "none: the dataset was never written");
}

void Hdf5Dataset::read(void* data, ElementType type) const {
  if (element_count() == 0) return;
  if (H5Dread(handle_.get(), memory_type(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) fail_damaged(file_, path_);
}

void Hdf5Dataset::write(const void* data, ElementType type) {
  if (element_count() == 0) return;
  require(H5Dwrite(handle_.get(), memory_type(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, data), file_, path_);
}

namespace {

// Memory and file dataspaces of some rows of a dataset.
std::pair<Hdf5Handle, Hdf5Handle> row_spaces(hid_t dataset, std::vector<std::int64_t> sizes, std::int64_t first,
                                             std::int64_t count) {
  auto in_file = make_handle(H5Dget_space(dataset), H5Sclose);
  std::vector<hsize_t> start(sizes.size(), 0);
  start[0] = static_cast<hsize_t>(first);
  sizes[0] = count;
  const auto extent = to_hsize(sizes);
  H5Sselect_hyperslab(in_file.get(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr);
  return {make_space(sizes), std::move(in_file)};
}

}  // namespace

void Hdf5Dataset::read_rows(std::int64_t first, std::int64_t count, void* data, ElementType type) const {
  const auto [memory, in_file] = row_spaces(handle_.get(), sizes_, first, count);
  if (H5Dread(handle_.get(), memory_type(type), memory.get(), in_file.get(), H5P_DEFAULT, data) < 0)
    fail_damaged(file_, path_);
}

void Hdf5Dataset::write_rows(std::int64_t first, std::int64_t count, const void* data, ElementType type) {
  const auto [memory, in_file] = row_spaces(handle_.get(), sizes_, first, count);
  require(H5Dwrite(handle_.get(), memory_type(type), memory.get(), in_file.get(), H5P_DEFAULT, data), file_, path_);
}

}  // namespace exmat

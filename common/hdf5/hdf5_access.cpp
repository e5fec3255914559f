#include "common/hdf5/hdf5_access.h"

#include <algorithm>
#include <bit>
#include <fmt/format.h>
#include <limits>
#include <type_traits>
#include <utility>

#include "common/core/error.h"

namespace exmat::hdf5_access {
namespace {

static_assert(std::is_same_v<hid_t, Hdf5Handle::Id>);
static_assert(std::endian::native == std::endian::little, "checksums are taken of memory as it is");

herr_t keep_innermost(unsigned position, const H5E_error2_t* error, void* text) {
  if (position == 0 && error->desc != nullptr) *static_cast<std::string*>(text) = error->desc;
  return 0;
}

}  // namespace

std::string hdf5_reason() {
  std::string text;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_innermost, &text);
  constexpr std::string_view kSystemMessage = "error message = '";
  const auto begin = text.find(kSystemMessage);
  if (begin == std::string::npos) return text.empty() ? "HDF5 gives no reason" : text;
  const auto message = text.substr(begin + kSystemMessage.size());
  return message.substr(0, message.find('\''));
}

void fail_writing(const std::string& file, const std::string& place) {
  throw WorkError(fmt::format("cannot write {}{}{}: {}", file, place.empty() ? "" : ": ", place, hdf5_reason()));
}

void fail_damaged(const std::string& file, const std::string& place, const std::string& reason) {
  throw InputError({file, place, "", "", fmt::format("the file is damaged ({})", reason)});
}

Hdf5Handle require(Hdf5Handle handle, const std::string& file, const std::string& place) {
  if (handle.get() < 0) fail_writing(file, place);
  return handle;
}

void require(herr_t status, const std::string& file, const std::string& place) {
  if (status < 0) fail_writing(file, place);
}

hid_t file_type(ElementType type) {
  switch (type) {
    case ElementType::kFloat64:
      return H5T_IEEE_F64LE;
    case ElementType::kFloat32:
      return H5T_IEEE_F32LE;
    case ElementType::kInt64:
      return H5T_STD_I64LE;
    case ElementType::kInt32:
      return H5T_STD_I32LE;
    case ElementType::kUint32:
      return H5T_STD_U32LE;
    case ElementType::kUint8:
      return H5T_STD_U8LE;
    case ElementType::kString:
      break;
  }
  throw std::logic_error("strings are attributes only");
}

std::optional<ElementType> element_type_of(hid_t type) {
  const H5T_class_t kind = H5Tget_class(type);
  const std::size_t size = H5Tget_size(type);
  const bool is_signed = kind == H5T_INTEGER && H5Tget_sign(type) == H5T_SGN_2;
  if (kind == H5T_FLOAT && size == 8) return ElementType::kFloat64;
  if (kind == H5T_FLOAT && size == 4) return ElementType::kFloat32;
  if (kind != H5T_INTEGER) return std::nullopt;
  if (size == 8 && is_signed) return ElementType::kInt64;
  if (size == 4) return is_signed ? ElementType::kInt32 : ElementType::kUint32;
  if (size == 1 && !is_signed) return ElementType::kUint8;
  return std::nullopt;
}

std::string describe_type(hid_t type) {
  if (const auto known = element_type_of(type)) return std::string(name_of(*known));
  const std::size_t bits = 8 * H5Tget_size(type);
  switch (H5Tget_class(type)) {
    case H5T_FLOAT:
      return fmt::format("float{}", bits);
    case H5T_INTEGER:
      return fmt::format("{}{}", H5Tget_sign(type) == H5T_SGN_2 ? "int" : "uint", bits);
    case H5T_STRING:
      return "string";
    case H5T_ENUM:
      return "enumeration";
    case H5T_COMPOUND:
      return "compound";
    default:
      return "another type";
  }
}

std::vector<hsize_t> to_hsize(std::span<const std::int64_t> sizes) { return {sizes.begin(), sizes.end()}; }

std::vector<std::int64_t> sizes_of(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> raw(static_cast<std::size_t>(std::max(rank, 0)));
  if (rank > 0) H5Sget_simple_extent_dims(space, raw.data(), nullptr);
  std::vector<std::int64_t> sizes;
  constexpr hsize_t kMax = std::numeric_limits<std::int64_t>::max();
  for (const hsize_t size : raw) sizes.push_back(static_cast<std::int64_t>(std::min(size, kMax)));
  return sizes;
}

Hdf5Handle make_space(std::span<const std::int64_t> sizes) {
  if (sizes.empty()) return make_handle(H5Screate(H5S_SCALAR), H5Sclose);
  const auto raw = to_hsize(sizes);
  return make_handle(H5Screate_simple(static_cast<int>(raw.size()), raw.data(), nullptr), H5Sclose);
}

std::size_t file_size(hid_t file) {
  hsize_t bytes = 0;
  H5Fget_filesize(file, &bytes);
  return bytes;
}

Hdf5Handle open_object_of(hid_t file, const std::string& path) {
  return make_handle(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose);
}

}  // namespace exmat::hdf5_access

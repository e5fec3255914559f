#include <algorithm>
#include <fmt/format.h>
#include <hdf5.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/saturating_product.h"
#include "common/hdf5/hdf5_access.h"
#include "common/hdf5/hdf5_file.h"

namespace exmat {

using namespace hdf5_access;

namespace {

constexpr std::size_t kMaxAttributeBytes = std::size_t{64} << 20;

Hdf5Handle string_type(std::size_t size) {
  auto type = make_handle(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), std::max<std::size_t>(size, 1));
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  return type;
}

// The value as a flat array with its type and, unless it is a scalar, its size.
struct RawAttribute {
  Hdf5Handle text_type;
  hid_t type = -1;
  std::vector<std::int64_t> sizes;
  std::vector<char> text;
  const void* data = nullptr;
};

RawAttribute raw_strings(std::span<const std::string> strings) {
  RawAttribute raw;
  std::size_t length = 1;
  for (const auto& string : strings) length = std::max(length, string.size());
  raw.text.assign(length * std::max<std::size_t>(strings.size(), 1), '\0');
  for (std::size_t i = 0; i < strings.size(); ++i)
    std::copy(strings[i].begin(), strings[i].end(), raw.text.begin() + static_cast<std::ptrdiff_t>(i * length));
  raw.text_type = string_type(length);
  raw.type = raw.text_type.get();
  raw.data = raw.text.data();
  return raw;
}

struct ToRaw {
  RawAttribute operator()(const std::int64_t& value) const { return numbers(H5T_STD_I64LE, &value); }
  RawAttribute operator()(const double& value) const { return numbers(H5T_IEEE_F64LE, &value); }
  RawAttribute operator()(const std::string& value) const { return raw_strings({&value, 1}); }
  template <typename T>
  RawAttribute operator()(const std::vector<T>& values) const {
    RawAttribute raw;
    if constexpr (std::is_same_v<T, std::string>)
      raw = raw_strings(values);
    else
      raw = numbers(std::is_same_v<T, double> ? H5T_IEEE_F64LE : H5T_STD_I64LE, values.data());
    raw.sizes = {static_cast<std::int64_t>(values.size())};
    return raw;
  }
  static RawAttribute numbers(hid_t type, const void* data) {
    RawAttribute raw;
    raw.type = type;
    raw.data = data;
    return raw;
  }
};

void write_raw(const Hdf5Handle& object, const std::string& name, const RawAttribute& raw, hid_t type,
               const std::string& file, const std::string& place) {
  const auto space = require(make_space(raw.sizes), file, place);
  const auto attribute = require(
      make_handle(H5Acreate2(object.get(), name.c_str(), type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose), file,
      place);
  require(H5Awrite(attribute.get(), raw.type, raw.data), file, place);
}

std::string without_padding(std::string text, bool space_padded) {
  text.resize(std::min(text.find('\0'), text.size()));
  if (space_padded) text.resize(text.find_last_not_of(' ') + 1);
  return text;
}

std::vector<std::string> read_fixed_strings(hid_t attribute, hid_t type, std::size_t count) {
  const std::size_t length = H5Tget_size(type);
  std::vector<char> buffer(count * length);
  if (H5Aread(attribute, type, buffer.data()) < 0) return {};
  const bool space_padded = H5Tget_strpad(type) == H5T_STR_SPACEPAD;
  std::vector<std::string> strings;
  for (std::size_t i = 0; i < count; ++i)
    strings.push_back(without_padding(std::string(buffer.data() + i * length, length), space_padded));
  return strings;
}

std::vector<std::string> read_variable_strings(hid_t attribute, hid_t type, hid_t space, std::size_t count) {
  std::vector<char*> buffer(count, nullptr);
  if (H5Aread(attribute, type, buffer.data()) < 0) return {};
  std::vector<std::string> strings;
  for (const char* text : buffer) strings.emplace_back(text == nullptr ? "" : text);
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, buffer.data());
  return strings;
}

template <typename T>
std::vector<T> read_numbers(hid_t attribute, std::size_t count) {
  std::vector<T> values(count);
  if (H5Aread(attribute, memory_type(kElementType<T>), values.data()) < 0) values.clear();
  return values;
}

// A scalar becomes the scalar alternative.
template <typename T>
AttributeValue as_value(std::vector<T> values, bool is_scalar) {
  if (is_scalar) return std::move(values.front());
  return values;
}

}  // namespace

void Hdf5File::write_attribute(const std::string& object, const std::string& name, const AttributeValue& value) {
  const std::string place = object + "@" + name;
  const auto raw = std::visit(ToRaw{}, value);
  write_raw(require(open_object(object), name_, place), name, raw, raw.type, name_, place);
}

void Hdf5File::write_checksum(const std::string& dataset, std::uint32_t crc32) {
  const std::string place = dataset + "@crc32";
  const std::int64_t value = crc32;
  write_raw(require(open_object(dataset), name_, place), "crc32", ToRaw{}(value), H5T_STD_U32LE, name_, place);
}

AttributeValue Hdf5File::read_attribute(const std::string& object, const std::string& name) const {
  const std::string place = object + "@" + name;
  if (!has_attribute(object, name)) throw InputError({name_, place, "an attribute", "none of that name", ""});
  const auto attribute =
      make_handle(H5Aopen_by_name(handle_.get(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (attribute.get() < 0) fail_damaged(name_, place);
  const auto type = make_handle(H5Aget_type(attribute.get()), H5Tclose);
  const auto space = make_handle(H5Aget_space(attribute.get()), H5Sclose);
  const auto kind = H5Tget_class(type.get());
  const bool is_known = kind == H5T_INTEGER || kind == H5T_FLOAT || kind == H5T_STRING;
  const H5S_class_t shape = H5Sget_simple_extent_type(space.get());
  const std::size_t count = saturating_product(sizes_of(space.get()), 1);
  if (!is_known || (shape != H5S_SCALAR && shape != H5S_SIMPLE))
    throw InputError({name_, place, "a number or text", describe_type(type.get()), ""});
  if (saturating_product(count, H5Tget_size(type.get())) > kMaxAttributeBytes)
    throw InputError({name_, place, "an attribute", fmt::format("one of {} elements", count), ""});

  const bool is_scalar = shape == H5S_SCALAR;
  const auto check_count = [&](const auto& values) {
    if (values.size() != count) fail_damaged(name_, place);
    return as_value(values, is_scalar);
  };
  if (kind == H5T_INTEGER) return check_count(read_numbers<std::int64_t>(attribute.get(), count));
  if (kind == H5T_FLOAT) return check_count(read_numbers<double>(attribute.get(), count));
  const bool is_variable = H5Tis_variable_str(type.get()) > 0;
  return check_count(is_variable ? read_variable_strings(attribute.get(), type.get(), space.get(), count)
                                 : read_fixed_strings(attribute.get(), type.get(), count));
}

}  // namespace exmat

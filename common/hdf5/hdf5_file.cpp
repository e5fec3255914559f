#include "common/hdf5/hdf5_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <fmt/format.h>
#include <fstream>
#include <hdf5.h>
#include <limits>
#include <system_error>
#include <utility>

#include "common/core/error.h"

namespace exmat {
namespace {

static_assert(std::is_same_v<hid_t, Hdf5Handle::Id>);
static_assert(std::endian::native == std::endian::little, "checksums are taken of memory as it is");

// Headers stay compact up to these, which keeps every piece of metadata under HDF5's own checksums.
constexpr unsigned kCompactAttributes = 64;
constexpr unsigned kCompactLinks = 4096;

// Deflate expands at most 1032 times.
constexpr std::size_t kMaxExpansion = 1100;
constexpr std::size_t kMaxAttributeBytes = std::size_t{64} << 20;

// Before any other call of HDF5. It keeps one error handler a thread. After a failed H5Fclose (a full disk) it would
// crash in its exit handler on the file that it has freed by then; nothing is left to that handler, so it goes without.
void prepare_hdf5() {
  static const herr_t without_exit_handler = H5dont_atexit();
  static_cast<void>(without_exit_handler);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

herr_t keep_innermost(unsigned position, const H5E_error2_t* error, void* text) {
  if (position == 0 && error->desc != nullptr) *static_cast<std::string*>(text) = error->desc;
  return 0;
}

// The innermost message of HDF5's error stack, reduced to the system's words where the system failed.
std::string hdf5_reason() {
  std::string text;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_innermost, &text);
  constexpr std::string_view kSystemMessage = "error message = '";
  const auto begin = text.find(kSystemMessage);
  if (begin == std::string::npos) return text.empty() ? "HDF5 gives no reason" : text;
  const auto message = text.substr(begin + kSystemMessage.size());
  return message.substr(0, message.find('\''));
}

[[noreturn]] void fail_writing(const std::string& file, const std::string& place) {
  throw WorkError(fmt::format("cannot write {}{}{}: {}", file, place.empty() ? "" : ": ", place, hdf5_reason()));
}

[[noreturn]] void fail_damaged(const std::string& file, const std::string& place,
                               const std::string& reason = hdf5_reason()) {
  throw InputError({file, place, "", "", fmt::format("the file is damaged ({})", reason)});
}

Hdf5Handle make_handle(hid_t id, herr_t (*closer)(hid_t)) { return {id, closer}; }

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

hid_t memory_type(ElementType type) { return file_type(type); }

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

// Sizes beyond int64 are cut to its maximum, which check_storage() refuses.
std::vector<std::int64_t> sizes_of(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> raw(static_cast<std::size_t>(std::max(rank, 0)));
  if (rank > 0) H5Sget_simple_extent_dims(space, raw.data(), nullptr);
  std::vector<std::int64_t> sizes;
  constexpr hsize_t kMax = std::numeric_limits<std::int64_t>::max();
  for (const hsize_t size : raw) sizes.push_back(static_cast<std::int64_t>(std::min(size, kMax)));
  return sizes;
}

std::size_t saturating_product(std::size_t a, std::size_t b) {
  constexpr std::size_t kMax = std::numeric_limits<std::size_t>::max();
  return a != 0 && b > kMax / a ? kMax : a * b;
}

Hdf5Handle make_space(std::span<const std::int64_t> sizes) {
  if (sizes.empty()) return make_handle(H5Screate(H5S_SCALAR), H5Sclose);
  const auto raw = to_hsize(sizes);
  return make_handle(H5Screate_simple(static_cast<int>(raw.size()), raw.data(), nullptr), H5Sclose);
}

// Object headers without time stamps and with compact attributes and links.
Hdf5Handle creation_properties(hid_t property_class) {
  auto properties = make_handle(H5Pcreate(property_class), H5Pclose);
  H5Pset_obj_track_times(properties.get(), 0);
  H5Pset_attr_phase_change(properties.get(), kCompactAttributes, 0);
  if (property_class != H5P_DATASET_CREATE) H5Pset_link_phase_change(properties.get(), kCompactLinks, 0);
  return properties;
}

Hdf5Handle access_properties() {
  auto properties = make_handle(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_fclose_degree(properties.get(), H5F_CLOSE_STRONG);
  // Files are replaced whole by rename, so a reader never sees a writer; and some file systems have no locks.
  H5Pset_file_locking(properties.get(), 0, 1);
  return properties;
}

// The first bytes of an HDF5 file: enough of them to tell where it should end.
struct Superblock {
  static constexpr std::array<unsigned char, 8> kSignature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
  static constexpr std::size_t kSize = 48;

  std::array<unsigned char, kSize> bytes{};
  std::size_t size = 0;

  bool has_signature() const {
    const std::size_t known = std::min(size, kSignature.size());
    return known > 0 &&
           std::equal(kSignature.begin(), kSignature.begin() + static_cast<std::ptrdiff_t>(known), bytes.begin());
  }

  // Where the file should end; nothing for layouts that HDF5 has to judge itself.
  std::optional<std::uint64_t> end_of_file() const {
    const unsigned version = bytes[8];
    if (version <= 1 && bytes[13] == 8) return little_endian(version == 0 ? 40 : 44);
    if ((version == 2 || version == 3) && bytes[9] == 8) return little_endian(28);
    return std::nullopt;
  }

  std::optional<std::uint64_t> little_endian(std::size_t offset) const {
    if (offset + 8 > kSize) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < 8; ++i) value |= std::uint64_t{bytes[offset + i]} << (8 * i);
    return value;
  }
};

Superblock read_superblock(const std::filesystem::path& file) {
  Superblock superblock;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw InputError({file.string(), "", "", "", "the file cannot be read"});
  stream.read(reinterpret_cast<char*>(superblock.bytes.data()), Superblock::kSize);
  superblock.size = static_cast<std::size_t>(stream.gcount());
  return superblock;
}

// HDF5's own messages about these are of no help.
void check_before_opening(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code ignored;
  const auto status = std::filesystem::status(file, ignored);
  if (!std::filesystem::exists(status)) throw InputError({name, "", "", "", "there is no such file"});
  if (!std::filesystem::is_regular_file(status))
    throw InputError({name, "", "an HDF5 file", "what is not a regular file", ""});
  const std::uint64_t size = std::filesystem::file_size(file, ignored);
  const Superblock superblock = read_superblock(file);
  if (superblock.size == 0) throw InputError({name, "", "an HDF5 file", "an empty file", ""});
  if (!superblock.has_signature()) throw InputError({name, "", "an HDF5 file", "another kind of file", ""});
  const auto end = superblock.size < Superblock::kSize ? std::nullopt : superblock.end_of_file();
  const std::uint64_t expected = end.value_or(Superblock::kSize);
  if (size >= expected) return;
  throw InputError({name, "", fmt::format("{}{} bytes", end ? "" : "at least ", expected), fmt::format("{}", size),
                    fmt::format("the file is cut short by {}{} bytes", end ? "" : "at least ", expected - size)});
}

std::string name_by_index(hid_t group, hsize_t index) {
  const ssize_t length = H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, index, nullptr, 0, H5P_DEFAULT);
  if (length <= 0) return {};
  std::string name(static_cast<std::size_t>(length), '\0');
  H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, index, name.data(), name.size() + 1, H5P_DEFAULT);
  return name;
}

Hdf5Handle open_object_of(hid_t file, const std::string& path) {
  return make_handle(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose);
}

// Whether every part of the path is there as a hard link: a bundle refers to no other file. What cannot be read is said
// at once: HDF5 1.10 keeps an object header of which it could read the first part only, and whoever asks again finds
// less in it, without an error.
bool has_link(hid_t file, const std::string& name, const std::string& path) {
  for (std::size_t begin = 0, end = path.find('/', 1); path != "/"; begin = end, end = path.find('/', end + 1)) {
    const std::string prefix = path.substr(0, end);
    H5L_info_t info{};
    const htri_t exists = H5Lexists(file, prefix.c_str(), H5P_DEFAULT);
    if (exists == 0) return false;
    if (exists < 0 || H5Lget_info(file, prefix.c_str(), &info, H5P_DEFAULT) < 0) {
      const std::string reason = hdf5_reason();
      const auto parent = open_object_of(file, path.substr(0, std::max<std::size_t>(begin, 1)));
      if (parent.get() >= 0 && H5Iget_type(parent.get()) != H5I_GROUP) return false;
      fail_damaged(name, prefix, reason);
    }
    if (info.type != H5L_TYPE_HARD) return false;
    if (end == std::string::npos) break;
  }
  return true;
}

std::string without_padding(std::string text, bool space_padded) {
  text.resize(std::min(text.find('\0'), text.size()));
  if (space_padded) text.resize(text.find_last_not_of(' ') + 1);
  return text;
}

}  // namespace

Hdf5Handle::Hdf5Handle(Hdf5Handle&& other) noexcept
    : id_(std::exchange(other.id_, -1)), closer_(std::exchange(other.closer_, nullptr)) {}

Hdf5Handle& Hdf5Handle::operator=(Hdf5Handle&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(closer_, other.closer_);
  return *this;
}

bool Hdf5Handle::close() {
  const Id id = std::exchange(id_, -1);
  return id < 0 || closer_ == nullptr || closer_(id) >= 0;
}

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

namespace {

std::size_t file_size(hid_t file) {
  hsize_t bytes = 0;
  H5Fget_filesize(file, &bytes);
  return bytes;
}

std::size_t saturating_product(std::span<const std::int64_t> sizes, std::size_t bytes) {
  for (const std::int64_t size : sizes) bytes = saturating_product(bytes, static_cast<std::size_t>(size));
  return bytes;
}

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

Hdf5File Hdf5File::open(const std::filesystem::path& file) {
  prepare_hdf5();
  check_before_opening(file);
  const auto access = access_properties();
  auto handle = make_handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose);
  if (handle.get() < 0) fail_damaged(file.string(), "");
  return {std::move(handle), file.string()};
}

Hdf5File Hdf5File::create(const std::filesystem::path& file, std::string shown_as) {
  prepare_hdf5();
  const auto access = access_properties();
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V18);
  const auto creation = creation_properties(H5P_FILE_CREATE);
  auto handle = make_handle(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()), H5Fclose);
  return {require(std::move(handle), shown_as, ""), std::move(shown_as)};
}

std::size_t Hdf5File::capacity() const { return saturating_product(file_size(handle_.get()), kMaxExpansion); }

void Hdf5File::close() {
  if (handle_.get() >= 0) require(H5Fflush(handle_.get(), H5F_SCOPE_GLOBAL), name_, "");
  if (!handle_.close()) fail_writing(name_, "");
}

void Hdf5File::create_group(const std::string& path) {
  const auto creation = creation_properties(H5P_GROUP_CREATE);
  require(make_handle(H5Gcreate2(handle_.get(), path.c_str(), H5P_DEFAULT, creation.get(), H5P_DEFAULT), H5Gclose),
          name_, path);
}

Hdf5Dataset Hdf5File::create_dataset(const std::string& path, ElementType type, std::span<const std::int64_t> sizes) {
  const auto creation = creation_properties(H5P_DATASET_CREATE);
  H5Pset_layout(creation.get(), H5D_CONTIGUOUS);
  H5Pset_fill_time(creation.get(), H5D_FILL_TIME_NEVER);
  const auto space = require(make_space(sizes), name_, path);
  auto handle = make_handle(
      H5Dcreate2(handle_.get(), path.c_str(), file_type(type), space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
      H5Dclose);
  return {require(std::move(handle), name_, path), name_, path};
}

Hdf5Handle Hdf5File::open_object(const std::string& path) const { return open_object_of(handle_.get(), path); }

namespace {

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

namespace {

bool is_object(hid_t file, const std::string& name, const std::string& path, H5I_type_t kind) {
  if (!has_link(file, name, path)) return false;
  const auto object = open_object_of(file, path);
  if (object.get() < 0) fail_damaged(name, path);
  return H5Iget_type(object.get()) == kind;
}

}  // namespace

bool Hdf5File::has_group(const std::string& path) const { return is_object(handle_.get(), name_, path, H5I_GROUP); }

bool Hdf5File::has_dataset(const std::string& path) const { return is_object(handle_.get(), name_, path, H5I_DATASET); }

bool Hdf5File::has_attribute(const std::string& object, const std::string& name) const {
  return H5Aexists_by_name(handle_.get(), object.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::string> Hdf5File::list(const std::string& group) const {
  const auto handle = open_object(group);
  H5G_info_t info;
  if (handle.get() < 0 || H5Gget_info(handle.get(), &info) < 0) fail_damaged(name_, group);
  std::vector<std::string> names;
  for (hsize_t i = 0; i < info.nlinks; ++i) {
    std::string name = name_by_index(handle.get(), i);
    if (name.empty()) fail_damaged(name_, group);
    names.push_back(std::move(name));
  }
  return names;
}

Hdf5Dataset Hdf5File::open_dataset(const std::string& path) const {
  if (!has_link(handle_.get(), name_, path)) throw InputError({name_, path, "a dataset", "nothing of that name", ""});
  auto handle = open_object(path);
  if (handle.get() < 0) fail_damaged(name_, path);
  if (H5Iget_type(handle.get()) != H5I_DATASET)
    throw InputError({name_, path, "a dataset", "another kind of object", ""});
  return {std::move(handle), name_, path};
}

namespace {

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

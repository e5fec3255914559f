#include "common/hdf5/hdf5_file.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fstream>
#include <hdf5.h>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/core/saturating_product.h"
#include "common/hdf5/hdf5_access.h"

namespace exmat {

using namespace hdf5_access;

namespace {

// Headers stay compact up to these, which keeps every piece of metadata under HDF5's own checksums.
constexpr unsigned kCompactAttributes = 64;
constexpr unsigned kCompactLinks = 4096;

// Before any other call of HDF5. It keeps one error handler a thread. After a failed H5Fclose (a full disk) it would
// crash in its exit handler on the file that it has freed by then; nothing is left to that handler, so it goes without.
void prepare_hdf5() {
  static const herr_t without_exit_handler = H5dont_atexit();
  static_cast<void>(without_exit_handler);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
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

  std::string_view text() const { return {reinterpret_cast<const char*>(bytes.data()), size}; }

  // Expected end of the file; nothing for layouts that HDF5 has to judge itself.
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
  check_input(file, "an HDF5 file");
  std::error_code ignored;
  const std::uint64_t size = std::filesystem::file_size(file, ignored);
  const Superblock superblock = read_superblock(file);
  if (superblock.size == 0) throw InputError({name, "", "an HDF5 file", "an empty file", ""});
  if (!superblock.has_signature()) {
    const std::string_view kind = kind_of_file(file, superblock.text());
    throw InputError({name, "", "an HDF5 file", kind.empty() ? "another kind of file" : std::string(kind),
                      "exmat-precompute bundle writes bundles, exmat-runtime run trajectories"});
  }
  const auto end = superblock.size < Superblock::kSize ? std::nullopt : superblock.end_of_file();
  const std::uint64_t expected = end.value_or(Superblock::kSize);
  if (size >= expected) return;
  throw InputError({name, "", fmt::format("{}{} bytes", end ? "" : "at least ", expected), fmt::format("{}", size),
                    fmt::format("the file is cut short by {}{} bytes", end ? "" : "at least ", expected - size)});
}

/// The format that the file says; empty where it says none, nothing where it cannot be read.
std::optional<std::string> format_of(const std::filesystem::path& file) {
  try {
    const OwnOutputRead own;
    const Hdf5File open = Hdf5File::open(file);
    if (!open.has_attribute("/", "format")) return "";
    const AttributeValue value = open.read_attribute("/", "format");
    const auto* const text = std::get_if<std::string>(&value);
    return text == nullptr ? "" : *text;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::string name_by_index(hid_t group, hsize_t index) {
  const ssize_t length = H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, index, nullptr, 0, H5P_DEFAULT);
  if (length <= 0) return {};
  std::string name(static_cast<std::size_t>(length), '\0');
  H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, index, name.data(), name.size() + 1, H5P_DEFAULT);
  return name;
}
// True if every part of the path is there as a hard link: a bundle refers to no other file. What cannot be read is said
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

bool is_object(hid_t file, const std::string& name, const std::string& path, H5I_type_t kind) {
  if (!has_link(file, name, path)) return false;
  const auto object = open_object_of(file, path);
  if (object.get() < 0) fail_damaged(name, path);
  return H5Iget_type(object.get()) == kind;
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

Hdf5File Hdf5File::open(const std::filesystem::path& file) {
  prepare_hdf5();
  check_before_opening(file);
  const auto access = access_properties();
  Hdf5Handle handle;
  std::string reason;
  // Within one process HDF5 opens a file a second time only with the settings of the first, which may be the host's.
  constexpr std::array<std::pair<unsigned, unsigned>, 4> kLocks{{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};
  for (const auto degree : {H5F_CLOSE_STRONG, H5F_CLOSE_WEAK, H5F_CLOSE_SEMI})
    for (const auto& [locks, best_effort] : kLocks) {
      if (handle.get() >= 0 || (!reason.empty() && reason.find("match") == std::string::npos)) continue;
      H5Pset_fclose_degree(access.get(), degree);
      H5Pset_file_locking(access.get(), locks, best_effort);
      handle = make_handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose);
      if (handle.get() < 0) reason = hdf5_reason();
    }
  if (handle.get() < 0 && (reason.find("lock") != std::string::npos || reason.find("match") != std::string::npos))
    throw InputError({file.string(), "", "a file that no other part of this program has open, or locks",
                      "one that is open or locked (" + reason + ")", "close it there first"});
  if (handle.get() < 0) fail_damaged(file.string(), "", reason);
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

void require_format(const std::filesystem::path& file, const std::string& role, const std::string& kind,
                    const FileSchema& schema) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return;
  const Superblock superblock = read_superblock(file);
  if (!superblock.has_signature() && lower_extension(file) == ".h5" && kind_of_file(file, superblock.text()).empty())
    return;
  const auto& signature = Superblock::kSignature;
  require_kind(file, role, kind, {reinterpret_cast<const char*>(signature.data()), signature.size()});
  const std::optional<std::string> found = format_of(file);
  if (found && *found != schema.format)
    refuse_to_replace(file, role, kind, found->empty() ? "an HDF5 file of another format" : "an " + *found);
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

}  // namespace exmat

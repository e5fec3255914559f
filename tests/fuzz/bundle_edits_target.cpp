// A bundle that HDF5 itself has edited is read or refused. HDF5's metadata are under checksums, which mutations of the
// bytes of a file seldom pass; so here an input is a list of edits of a small bundle: values, sizes, types, layouts,
// attributes, links.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <hdf5.h>
#include <limits>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/hdf5/hdf5_file.h"
#include "tests/common/bundle/small_model.h"
#include "tests/fuzz/bundle_checks.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/temporary_folder.h"

namespace exmat::fuzz {
namespace {

constexpr std::size_t kMostEdits = 8;
constexpr hsize_t kMostBytes = 4096;  // of a dataset that is written

// The bytes of an input as numbers; zeros after its end.
class Script {
 public:
  explicit Script(std::string_view bytes) : bytes_(bytes) {}

  bool at_end() const { return bytes_.empty(); }
  std::size_t below(std::size_t count) {
    if (count == 0) return 0;
    const std::size_t low = byte();
    return (count > 256 ? std::size_t{256} * byte() + low : low) % count;
  }
  bool flag() { return byte() % 2 == 1; }
  std::uint64_t word() {
    std::uint64_t value = 0;
    for (int i = 0; i < 8; ++i) value = value << 8 | byte();
    return value;
  }
  template <typename T, std::size_t kCount>
  T one_of(const std::array<T, kCount>& values) {
    return values[below(kCount)];
  }

  double real() {
    using Limits = std::numeric_limits<double>;
    constexpr std::array<double, 12> kReals = {0,    1,     -1,  2,   0.5, 1e-300, 1e300, Limits::quiet_NaN(),
                                               1e-9, 1e300, 1.5, -0.0};
    const std::size_t kind = below(16);
    return kind < kReals.size() ? kReals[kind] : kind == 15 ? std::bit_cast<double>(word()) : Limits::infinity();
  }
  std::int64_t integer() {
    using Limits = std::numeric_limits<std::int64_t>;
    constexpr std::array<std::int64_t, 12> kIntegers = {
        0, 1, 2, 3, 4, 5, 6, -1, 255, std::int64_t{1} << 31, Limits::max(), Limits::min()};
    const std::size_t kind = below(16);
    return kind < kIntegers.size() ? kIntegers[kind] : static_cast<std::int64_t>(word());
  }
  hsize_t size(hsize_t before) {
    constexpr std::array<hsize_t, 10> kSizes = {0, 1, 2, 3, 4, 9, 1000, hsize_t{1} << 32, hsize_t{1} << 61, 5};
    const std::size_t kind = below(16);
    return kind < kSizes.size()       ? kSizes[kind]
           : kind == 14               ? before + 1
           : kind == 15 && before > 0 ? before - 1
                                      : before;
  }
  std::string text() {
    constexpr std::array<const char*, 12> kTexts = {"",        "polynomial",  "cubature", "targets",
                                                    "regions", "rest",        "example",  "stvk",
                                                    "free",    "constrained", "gram",     "eigenvalue"};
    const std::size_t kind = below(16);
    return kind < kTexts.size() ? kTexts[kind] : std::string(1 + below(8), static_cast<char>(byte()));
  }

 private:
  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const auto value = static_cast<std::uint8_t>(bytes_.front());
    bytes_.remove_prefix(1);
    return value;
  }

  std::string_view bytes_;
};

struct Contents {
  std::vector<std::string> objects, datasets, groups;
  std::vector<std::pair<std::string, std::string>> attributes;  // object and name, without the labels of datasets
};

herr_t collect_attribute(hid_t object, const char* name, const H5A_info_t*, void* contents) {
  auto& all = *static_cast<Contents*>(contents);
  const std::string_view label = name;
  if (label != "description" && label != "units" && label != "dims")
    all.attributes.emplace_back(all.objects.back(), name);
  static_cast<void>(object);
  return 0;
}

herr_t collect_object(hid_t root, const char* name, const H5O_info_t* info, void* contents) {
  auto& all = *static_cast<Contents*>(contents);
  all.objects.push_back(name == std::string_view(".") ? "/" : "/" + std::string(name));
  (info->type == H5O_TYPE_DATASET ? all.datasets : all.groups).push_back(all.objects.back());
  hsize_t first = 0;
  const Hdf5Handle object(H5Oopen(root, name, H5P_DEFAULT), H5Oclose);
  H5Aiterate2(object.get(), H5_INDEX_NAME, H5_ITER_INC, &first, collect_attribute, contents);
  return 0;
}

// A bundle to be edited: its bytes, and what is in it.
struct Base {
  std::string bytes;
  Contents contents;
};

// A bundle of one region: all that is in it takes time.
Base make_base(bool constrained) {
  const auto file = input_file("_base.h5", "");
  ReducedModel model = test::small_model(constrained);
  model.regions.pop_back();
  write_bundle(model, file);
  Base base{test::read_file(file), {}};
  const Hdf5Handle handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  H5Ovisit2(handle.get(), H5_INDEX_NAME, H5_ITER_INC, collect_object, &base.contents, H5O_INFO_BASIC);
  return base;
}

// One edit after another. What HDF5 refuses to do is not done.
class Editor {
 public:
  Editor(const std::filesystem::path& file, const Contents& contents, Script& script)
      : file_(H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose), contents_(contents), script_(script) {}

  void edit() {
    using Edit = void (Editor::*)();
    constexpr std::array<Edit, 12> kEdits = {
        &Editor::set_element, &Editor::set_element,   &Editor::replace_dataset,  &Editor::replace_dataset,
        &Editor::remove,      &Editor::add_link,      &Editor::set_attribute,    &Editor::set_attribute,
        &Editor::move,        &Editor::add_attribute, &Editor::remove_attribute, &Editor::set_text};
    (this->*script_.one_of(kEdits))();
  }

 private:
  const std::string& any(const std::vector<std::string>& names) { return names[script_.below(names.size())]; }
  const auto& any_attribute() { return contents_.attributes[script_.below(contents_.attributes.size())]; }

  Hdf5Handle space(const std::vector<hsize_t>& sizes) {
    return {
        sizes.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr),
        H5Sclose};
  }

  void write_attribute(const std::string& object, const std::string& name, hid_t type, const void* value,
                       const std::vector<hsize_t>& sizes = {}) {
    H5Adelete_by_name(file_.get(), object.c_str(), name.c_str(), H5P_DEFAULT);
    const auto shape = space(sizes);
    const Hdf5Handle attribute(H5Acreate_by_name(file_.get(), object.c_str(), name.c_str(), type, shape.get(),
                                                 H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                               H5Aclose);
    H5Awrite(attribute.get(), type, value);
  }

  void mend_checksum(const std::string& path, const std::vector<std::byte>& data) {
    const std::uint32_t crc = crc32_of(data);
    write_attribute(path, "crc32", H5T_STD_U32LE, &crc);
  }

  // Filters that no bundle is read with. HDF5 1.10 itself reads and writes beyond the ends of its buffers with them.
  static bool packs_bits(hid_t properties) {
    const auto has = [&](H5Z_filter_t filter) {
      return H5Pget_filter_by_id2(properties, filter, nullptr, nullptr, nullptr, 0, nullptr, nullptr) >= 0;
    };
    return has(H5Z_FILTER_NBIT) || has(H5Z_FILTER_SCALEOFFSET);
  }

  // Nothing where there are none, or too many.
  static std::vector<std::byte> values_of(hid_t dataset, hid_t type) {
    const Hdf5Handle shape(H5Dget_space(dataset), H5Sclose), properties(H5Dget_create_plist(dataset), H5Pclose);
    if (packs_bits(properties.get())) return {};
    const auto count = static_cast<hsize_t>(std::max<hssize_t>(H5Sget_simple_extent_npoints(shape.get()), 0));
    if (count > kMostBytes || H5Dget_storage_size(dataset) == 0) return {};
    std::vector<std::byte> data(count * H5Tget_size(type));
    H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
    return data;
  }

  void set_element() {
    const std::string& path = any(contents_.datasets);
    const Hdf5Handle dataset(H5Dopen2(file_.get(), path.c_str(), H5P_DEFAULT), H5Dclose);
    const Hdf5Handle type(H5Dget_type(dataset.get()), H5Tclose);
    if (dataset.get() < 0) return;
    auto data = values_of(dataset.get(), type.get());
    if (data.empty()) return;
    const std::size_t bytes = H5Tget_size(type.get()), at = bytes * script_.below(data.size() / bytes);
    const double real = script_.real();
    const std::int64_t integer = script_.integer();
    const bool is_real = H5Tget_class(type.get()) == H5T_FLOAT && bytes == sizeof(real);
    std::memcpy(data.data() + at, is_real ? static_cast<const void*>(&real) : &integer, std::min(bytes, sizeof(real)));
    H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
    if (script_.below(8) > 0) mend_checksum(path, data);
  }

  hid_t type(hid_t before) {
    const std::array<hid_t, 11> types = {H5T_IEEE_F64LE, H5T_IEEE_F64BE,  H5T_IEEE_F32LE, H5T_STD_I32LE,
                                         H5T_STD_U32LE,  H5T_STD_I64BE,   H5T_STD_U8LE,   H5T_STD_I8LE,
                                         H5T_C_S1,       H5T_STD_REF_OBJ, H5T_STD_I16LE};
    const std::size_t kind = script_.below(32);
    return kind < types.size() ? types[kind] : before;
  }

  Hdf5Handle layout(const std::vector<hsize_t>& sizes) {
    Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    const std::size_t kind = script_.below(12);
    if (kind == 1) H5Pset_layout(properties.get(), H5D_COMPACT);
    if (kind == 2) H5Pset_external(properties.get(), "/dev/null", 0, H5F_UNLIMITED);
    if (kind < 3 || sizes.empty()) return properties;
    std::vector<hsize_t> chunk(sizes);
    for (hsize_t& extent : chunk) extent = std::clamp<hsize_t>(extent, 1, 1 + script_.below(4));
    H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), chunk.data());
    if (kind == 4 || kind == 5) H5Pset_shuffle(properties.get());
    if (kind >= 4) H5Pset_deflate(properties.get(), 4);
    if (kind == 6) H5Pset_deflate(properties.get(), 4);
    if (kind == 7) H5Pset_fletcher32(properties.get());
    if (kind == 8) H5Pset_scaleoffset(properties.get(), H5Z_SO_INT, 0);
    if (kind == 9) H5Pset_nbit(properties.get());
    return properties;
  }

  std::vector<hsize_t> changed_sizes(std::vector<hsize_t> sizes) {
    const std::size_t kind = script_.below(8);
    if (kind == 0 && !sizes.empty()) sizes.pop_back();
    if (kind == 1) sizes.push_back(script_.size(1));
    if (kind > 1 && kind < 6 && !sizes.empty()) {
      hsize_t& extent = sizes[script_.below(sizes.size())];
      extent = script_.size(extent);
    }
    return sizes;
  }

  // Another one in its place, with its attributes and, as far as they reach, its values.
  void replace_dataset() {
    const std::string& path = any(contents_.datasets);
    const Hdf5Handle old(H5Dopen2(file_.get(), path.c_str(), H5P_DEFAULT), H5Dclose);
    if (old.get() < 0) return;
    const Hdf5Handle old_type(H5Dget_type(old.get()), H5Tclose), old_space(H5Dget_space(old.get()), H5Sclose);
    const int rank = std::max(H5Sget_simple_extent_ndims(old_space.get()), 0);
    std::vector<hsize_t> sizes(static_cast<std::size_t>(rank));
    H5Sget_simple_extent_dims(old_space.get(), sizes.data(), nullptr);
    auto data = values_of(old.get(), old_type.get());

    sizes = changed_sizes(std::move(sizes));
    const hid_t new_type = type(old_type.get());
    const auto shape = space(sizes);
    const auto properties = layout(sizes);
    H5Ldelete(file_.get(), path.c_str(), H5P_DEFAULT);
    const Hdf5Handle dataset(
        H5Dcreate2(file_.get(), path.c_str(), new_type, shape.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
        H5Dclose);
    copy_attributes(old.get(), dataset.get());
    if (script_.below(8) == 1 || packs_bits(properties.get())) return;
    hsize_t bytes = H5Tget_size(new_type);
    for (const hsize_t extent : sizes)
      bytes = extent > 0 && bytes > kMostBytes / extent ? kMostBytes + 1 : bytes * extent;
    if (dataset.get() < 0 || bytes == 0 || bytes > kMostBytes) return;
    const std::vector<std::byte> before = std::exchange(data, std::vector<std::byte>(bytes));
    for (std::size_t i = 0; i < data.size() && !before.empty(); ++i) data[i] = before[i % before.size()];
    H5Dwrite(dataset.get(), new_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
    mend_checksum(path, data);
  }

  static void copy_attributes(hid_t from, hid_t to) {
    const auto copy = [](hid_t object, const char* name, const H5A_info_t*, void* target) -> herr_t {
      const Hdf5Handle source(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
      const Hdf5Handle type(H5Aget_type(source.get()), H5Tclose), shape(H5Aget_space(source.get()), H5Sclose);
      std::vector<char> value(H5Aget_storage_size(source.get()));
      H5Aread(source.get(), type.get(), value.data());
      const Hdf5Handle attribute(
          H5Acreate2(*static_cast<hid_t*>(target), name, type.get(), shape.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
      H5Awrite(attribute.get(), type.get(), value.data());
      return 0;
    };
    hsize_t first = 0;
    H5Aiterate2(from, H5_INDEX_NAME, H5_ITER_INC, &first, copy, &to);
  }

  void remove() { H5Ldelete(file_.get(), any(contents_.objects).c_str(), H5P_DEFAULT); }

  void move() {
    const std::string& from = any(contents_.objects);
    const std::string to = script_.flag() ? any(contents_.objects) : any(contents_.groups) + "/" + script_.text();
    H5Ldelete(file_.get(), to.c_str(), H5P_DEFAULT);
    H5Lmove(file_.get(), from.c_str(), file_.get(), to.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  }

  void add_link() {
    const std::string& target = any(contents_.objects);
    const std::string path = script_.flag() ? any(contents_.objects) : any(contents_.groups) + "/" + script_.text();
    const std::size_t kind = script_.below(4);
    if (path != target) H5Ldelete(file_.get(), path.c_str(), H5P_DEFAULT);
    if (kind == 0)
      H5Lcreate_hard(file_.get(), target.c_str(), file_.get(), path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
    else if (kind == 1)
      H5Lcreate_soft(target.c_str(), file_.get(), path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
    else if (kind == 2)
      H5Lcreate_external("/dev/null", target.c_str(), file_.get(), path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
    else
      Hdf5Handle(H5Gcreate2(file_.get(), path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  }

  void set_number(const std::string& object, const std::string& name) {
    const std::size_t count = script_.below(12);
    const std::vector<hsize_t> sizes = count == 0 ? std::vector<hsize_t>{} : std::vector<hsize_t>{count};
    if (script_.flag()) {
      const std::vector<double> values(std::max<std::size_t>(count, 1), script_.real());
      write_attribute(object, name, H5T_IEEE_F64LE, values.data(), sizes);
    } else {
      const std::vector<std::int64_t> values(std::max<std::size_t>(count, 1), script_.integer());
      write_attribute(object, name, H5T_STD_I64LE, values.data(), sizes);
    }
  }

  // Sets an attribute, mostly of the type that it has.
  void set_attribute() {
    const auto& [object, name] = any_attribute();
    const Hdf5Handle old(H5Aopen_by_name(file_.get(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
    const Hdf5Handle type(H5Aget_type(old.get()), H5Tclose);
    const H5T_class_t kind = H5Tget_class(type.get());
    const double real = script_.real();
    const std::int64_t integer = script_.integer();
    if (script_.below(4) == 3)
      set_number(object, name);
    else if (kind == H5T_FLOAT)
      write_attribute(object, name, H5T_IEEE_F64LE, &real);
    else if (kind == H5T_INTEGER)
      write_attribute(object, name, H5T_STD_I64LE, &integer);
    else
      set_text_of(object, name);
  }

  void add_attribute() { set_number(any(contents_.objects), script_.text()); }

  void set_text() {
    const auto& [object, name] = any_attribute();
    set_text_of(object, name);
  }

  // Fixed or variable length, one or several, padded with zeros or blanks.
  void set_text_of(const std::string& object, const std::string& name) {
    const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
    const std::size_t count = script_.below(4);
    const std::vector<hsize_t> sizes = count == 0 ? std::vector<hsize_t>{} : std::vector<hsize_t>{count};
    const std::vector<std::string> texts(std::max<std::size_t>(count, 1), script_.text());
    if (script_.flag()) {
      H5Tset_size(type.get(), H5T_VARIABLE);
      std::vector<const char*> pointers;
      for (const std::string& text : texts) pointers.push_back(text.c_str());
      return write_attribute(object, name, type.get(), pointers.data(), sizes);
    }
    const std::size_t length = texts.front().size() + 1;
    H5Tset_size(type.get(), length);
    if (script_.flag()) H5Tset_strpad(type.get(), H5T_STR_SPACEPAD);
    std::string padded;
    for (const std::string& text : texts) padded += text + " ";
    write_attribute(object, name, type.get(), padded.data(), sizes);
  }

  void remove_attribute() {
    const auto& [object, name] = any_attribute();
    H5Adelete_by_name(file_.get(), object.c_str(), name.c_str(), H5P_DEFAULT);
  }

  Hdf5Handle file_;
  const Contents& contents_;
  Script& script_;
};

}  // namespace
}  // namespace exmat::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat::fuzz;
  static const std::array<Base, 2> bases = {make_base(false), make_base(true)};
  Script script({reinterpret_cast<const char*>(data), size});
  const Base& base = bases[script.below(bases.size())];
  const auto file = input_file(".h5", base.bytes);
  {
    Editor editor(file, base.contents, script);
    for (std::size_t i = 0; i < kMostEdits && !script.at_end(); ++i) editor.edit();
  }
  check_bundle(file);
  return 0;
}

#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <hdf5.h>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/hdf5/hdf5_file.h"

namespace exmat::test {

/// A bundle opened to be spoilt, with the plain HDF5 library as an outsider would.
class Spoiler {
 public:
  explicit Spoiler(const std::filesystem::path& file) : file_(H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)) {}
  ~Spoiler() { H5Fclose(file_); }
  Spoiler(const Spoiler&) = delete;
  Spoiler& operator=(const Spoiler&) = delete;

  void remove(const char* path) { H5Ldelete(file_, path, H5P_DEFAULT); }
  void move(const char* from, const char* to) { H5Lmove(file_, from, file_, to, H5P_DEFAULT, H5P_DEFAULT); }
  void add_group(const char* path) { H5Gclose(H5Gcreate2(file_, path, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT)); }
  void link_elsewhere(const char* path) {
    H5Lcreate_external("/dev/null", "/x", file_, path, H5P_DEFAULT, H5P_DEFAULT);
  }

  void remove_attribute(const char* object, const char* name) { H5Adelete_by_name(file_, object, name, H5P_DEFAULT); }

  void set_attribute(const char* object, const char* name, hid_t type, const void* value,
                     std::vector<hsize_t> sizes = {}) {
    remove_attribute(object, name);
    const hid_t space = sizes.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, sizes.data(), nullptr);
    const hid_t attribute = H5Acreate_by_name(file_, object, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, type, value);
    H5Aclose(attribute);
    H5Sclose(space);
  }
  void set_integer(const char* object, const char* name, std::int64_t value) {
    set_attribute(object, name, H5T_NATIVE_INT64, &value);
  }
  void set_number(const char* object, const char* name, double value) {
    set_attribute(object, name, H5T_NATIVE_DOUBLE, &value);
  }
  // Sets a text of variable length, as h5py writes it.
  void set_text(const char* object, const char* name, const char* value) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, H5T_VARIABLE);
    set_attribute(object, name, type, static_cast<const void*>(&value));
    H5Tclose(type);
  }

  // Replaces one element and mends the checksum.
  template <typename T>
  void set(const char* path, std::size_t index, T value, bool mend = true) {
    const hid_t dataset = H5Dopen2(file_, path, H5P_DEFAULT);
    std::vector<T> data(H5Dget_storage_size(dataset) / sizeof(T));
    const hid_t type = H5Dget_type(dataset);
    H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
    data.at(index) = value;
    H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
    H5Tclose(type);
    H5Dclose(dataset);
    const std::uint32_t crc = crc32_of(std::as_bytes(std::span(data)));
    if (mend) set_attribute(path, "crc32", H5T_NATIVE_UINT32, &crc);
  }

  void link(const std::string& target, const std::string& path) {
    H5Lcreate_hard(file_, target.c_str(), file_, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
  }

  void replace_deflated(const char* path, std::vector<hsize_t> sizes, std::vector<hsize_t> chunk, int times,
                        std::size_t most_written = 999) {
    const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(properties, static_cast<int>(chunk.size()), chunk.data());
    for (int i = 0; i < times; ++i) H5Pset_deflate(properties, 6);
    replace(path, H5T_NATIVE_DOUBLE, std::move(sizes), properties, most_written);
    H5Pclose(properties);
  }

  // Another dataset in its place: ones. It may grow where it has chunks.
  void replace(const char* path, hid_t type, std::vector<hsize_t> sizes, hid_t properties = H5P_DEFAULT,
               std::size_t most_written = 999) {
    H5Ldelete(file_, path, H5P_DEFAULT);
    const std::vector<hsize_t> most(sizes.size(), H5S_UNLIMITED);
    const bool has_chunks = properties != H5P_DEFAULT && H5Pget_layout(properties) == H5D_CHUNKED;
    const hid_t space =
        H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), has_chunks ? most.data() : nullptr);
    const hid_t dataset = H5Dcreate2(file_, path, type, space, H5P_DEFAULT, properties, H5P_DEFAULT);
    const std::size_t count = std::accumulate(sizes.begin(), sizes.end(), hsize_t{1}, std::multiplies<>());
    const std::vector<double> ones(count <= most_written ? count : 0, 1.0);
    if (!ones.empty()) H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, ones.data());
    H5Dclose(dataset);
    H5Sclose(space);
    const std::uint32_t crc = crc32_of(std::as_bytes(std::span(ones)));
    set_attribute(path, "crc32", H5T_NATIVE_UINT32, &crc);
  }

 private:
  hid_t file_;
};

}  // namespace exmat::test

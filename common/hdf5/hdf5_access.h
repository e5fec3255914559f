#pragma once

#include <cstddef>
#include <cstdint>
#include <hdf5.h>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/hdf5/hdf5_file.h"

namespace exmat::hdf5_access {

// Shared by the sources of hdf5_file.h; private to this folder.

/// Deflate expands at most 1032 times.
inline constexpr std::size_t kMaxExpansion = 1100;

/// The innermost message of HDF5's error stack, reduced to the system's words where the system failed.
std::string hdf5_reason();

/// WorkError that names the file, the place in it, if any, and HDF5's reason.
[[noreturn]] void fail_writing(const std::string& file, const std::string& place);
/// InputError: the file is damaged.
[[noreturn]] void fail_damaged(const std::string& file, const std::string& place,
                               const std::string& reason = hdf5_reason());

inline Hdf5Handle make_handle(hid_t id, herr_t (*closer)(hid_t)) { return {id, closer}; }

/// The handle itself, or fail_writing() where HDF5 gave none.
Hdf5Handle require(Hdf5Handle handle, const std::string& file, const std::string& place);
void require(herr_t status, const std::string& file, const std::string& place);

/// In the file, and in memory likewise: little-endian; std::logic_error for strings.
hid_t file_type(ElementType type);
inline hid_t memory_type(ElementType type) { return file_type(type); }
/// Nothing where the type is none of ours.
std::optional<ElementType> element_type_of(hid_t type);
/// Such as "float64" or "compound", for messages.
std::string describe_type(hid_t type);

std::vector<hsize_t> to_hsize(std::span<const std::int64_t> sizes);
/// Sizes beyond int64 are cut to its maximum, which Hdf5Dataset::check_storage() refuses.
std::vector<std::int64_t> sizes_of(hid_t space);

/// A dataspace of these sizes; none: a scalar.
Hdf5Handle make_space(std::span<const std::int64_t> sizes);

/// Bytes of an open file.
std::size_t file_size(hid_t file);

/// Its id is below 0 where it cannot be opened.
Hdf5Handle open_object_of(hid_t file, const std::string& path);

}  // namespace exmat::hdf5_access

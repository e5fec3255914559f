#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/core/crc32.h"
#include "common/hdf5/schema.h"

namespace exmat {

// The HDF5 C library behind a few types. HDF5 prints nothing; its failures become InputError (reading) or WorkError
// (writing) that name the file and the object. Not thread-safe. To write a file by a schema:
//
//     AtomicFile output(target);
//     auto file = Hdf5File::create(output.temporary(), target.string());
//     write_header(file, trajectory_schema(), generator_name());
//     file.write_attribute("/", "bundle", bundle_name);
//     SymbolSizes sizes;                                     // every symbol of the datasets to write
//     sizes.set("F", frames, "the scene");
//     RowWriter time(file, trajectory_schema().dataset("/time"), sizes);
//     for (...) time.append(t);                              // F rows in all
//     time.finish();
//     file.close();
//     output.commit();
//
// The same calls give the same bytes: no time stamps, fixed format bounds, contiguous data.

/// Owner of one HDF5 identifier.
class Hdf5Handle {
 public:
  using Id = std::int64_t;
  using Closer = int (*)(Id);

  Hdf5Handle() = default;
  Hdf5Handle(Id id, Closer closer) : id_(id), closer_(closer) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept;
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept;
  ~Hdf5Handle() { close(); }

  Id get() const { return id_; }
  /// False if HDF5 could not close it; closed in any case.
  bool close();

 private:
  Id id_ = -1;
  Closer closer_ = nullptr;
};

/// An open dataset of a file that is being read or written.
class Hdf5Dataset {
 public:
  Hdf5Dataset(Hdf5Handle handle, std::string file, std::string path);

  const std::string& path() const { return path_; }
  /// Sizes, outermost first; empty for a scalar.
  const std::vector<std::int64_t>& sizes() const { return sizes_; }
  /// Nothing where the type is none of ours.
  std::optional<ElementType> type() const;
  /// Such as "float64" or "compound", for messages.
  std::string type_name() const;
  /// Saturates where the product of the sizes overflows; check_storage() refuses that.
  std::size_t element_count() const;

  /// Throws InputError unless the file can hold as much as the sizes (and those of chunks) say and holds it in itself
  /// (contiguous, compact or chunked, with each of deflate, shuffle and fletcher32 once at most). Call it before
  /// allocating.
  void check_storage() const;

  /// Reads or writes all of it; `data` holds element_count() elements of `memory_type`.
  void read(void* data, ElementType memory_type) const;
  void write(const void* data, ElementType memory_type);
  /// Rows [first, first + count) of the outermost size.
  void read_rows(std::int64_t first, std::int64_t count, void* data, ElementType memory_type) const;
  void write_rows(std::int64_t first, std::int64_t count, const void* data, ElementType memory_type);

 private:
  Hdf5Handle handle_;
  std::string file_;
  std::string path_;
  std::vector<std::int64_t> sizes_;
};

/// An HDF5 file, open for reading or newly created.
class Hdf5File {
 public:
  /// For reading. InputError: no such file, not HDF5, cut short (with the number of bytes missing), damaged.
  static Hdf5File open(const std::filesystem::path& file);
  /// For writing; replaces `file`. `shown_as` is the name for messages, e.g. the target of an AtomicFile. Throws
  /// WorkError.
  static Hdf5File create(const std::filesystem::path& file, std::string shown_as);

  /// As messages name it.
  const std::string& name() const { return name_; }
  /// The most bytes that all data of the file together take in memory.
  std::size_t capacity() const;
  /// Flushes and closes. Throws WorkError (disk full, say). Only after it may a written file be committed.
  void close();

  // Writing. Paths are absolute; parent groups must exist.
  void create_group(const std::string& path);
  Hdf5Dataset create_dataset(const std::string& path, ElementType type, std::span<const std::int64_t> sizes);
  /// On a group or dataset; "/" is the root. Text is UTF-8 of fixed length.
  void write_attribute(const std::string& object, const std::string& name, const AttributeValue& value);
  /// As uint32, the type of checksums.
  void write_checksum(const std::string& dataset, std::uint32_t crc32);

  // Reading.
  /// InputError where what would tell is damaged.
  bool has_group(const std::string& path) const;
  bool has_dataset(const std::string& path) const;
  bool has_attribute(const std::string& object, const std::string& name) const;
  /// Names of the links in a group, ascending.
  std::vector<std::string> list(const std::string& group) const;
  /// InputError if it is missing or damaged.
  Hdf5Dataset open_dataset(const std::string& path) const;
  /// Integers of any size, floating-point numbers and strings (fixed or variable length), scalar or array. InputError
  /// if it is missing, damaged or of another type.
  AttributeValue read_attribute(const std::string& object, const std::string& name) const;

 private:
  Hdf5File(Hdf5Handle handle, std::string name) : handle_(std::move(handle)), name_(std::move(name)) {}
  Hdf5Handle open_object(const std::string& path) const;

  Hdf5Handle handle_;
  std::string name_;
};

/// Throws InputError where `file` holds something else than an earlier output of this format, called `kind`, as
/// require_kind() does (common/core/command_files.h). A damaged file passes, and one of no known kind whose extension
/// is .h5.
void require_format(const std::filesystem::path& file, const std::string& role, const std::string& kind,
                    const FileSchema& schema);

/// Program and version: "exmat 1.2.3".
std::string generator_name();

/// Root attributes that every file has: format, format_version, generator.
void write_header(Hdf5File& file, const FileSchema& schema, const std::string& generator);

/// A group with its attribute description.
void write_group(Hdf5File& file, const GroupSchema& schema, const std::string& path);

/// Writes a whole dataset with its attributes: description, units, dims and crc32 (of the little-endian row-major
/// data). `path` is the schema's with placeholders filled in; `data` holds the product of `sizes` elements of the
/// schema's type.
void write_dataset(Hdf5File& file, const DatasetSchema& schema, const std::string& path,
                   std::span<const std::int64_t> sizes, const void* data);

/// Writes a dataset of known sizes a row (of the outermost size) at a time, with the same attributes. The dataset is
/// contiguous and takes its whole space in the file at the first row. `file` must outlive it.
class RowWriter {
 public:
  /// Every symbol of the schema's dims must be bound in `sizes`. The parent group must exist.
  RowWriter(Hdf5File& file, const DatasetSchema& schema, const SymbolSizes& sizes);

  /// Writes the next row. std::logic_error unless T is the dataset's type and the row has row_size() elements.
  template <typename T>
  void append(std::span<const T> row) {
    append_raw(std::as_bytes(row), kElementType<T>);
  }
  /// The same for rows of one element.
  template <typename T>
  void append(T value) {
    append(std::span<const T>(&value, 1));
  }

  /// Elements in a row.
  std::size_t row_size() const { return row_size_; }

  /// Writes the checksum; all rows must have been appended (std::logic_error).
  void finish();

 private:
  void append_raw(std::span<const std::byte> row, ElementType type);

  Hdf5File& file_;
  ElementType type_;
  std::size_t row_size_ = 0;
  std::int64_t next_row_ = 0;
  std::uint32_t crc32_ = 0;
  Hdf5Dataset dataset_;
};

}  // namespace exmat

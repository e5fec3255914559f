#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/bundle/bundle_input.h"
#include "common/hdf5/schema.h"

namespace exmat {

/// An array of a bundle, in whatever kind of file.
class StoredArray {
 public:
  virtual ~StoredArray() = default;

  virtual const std::string& path() const = 0;
  /// Outermost first; empty for a scalar.
  virtual const std::vector<std::int64_t>& sizes() const = 0;
  /// Nothing where the type is none of ours.
  virtual std::optional<ElementType> type() const = 0;
  /// Such as "float64" or "compound", for messages.
  virtual std::string type_name() const = 0;
  /// Saturates where the product of the sizes overflows.
  virtual std::size_t element_count() const = 0;
  /// False where a pack knows the sizes alone.
  virtual bool is_held() const { return true; }
  /// Throws InputError unless the file can hold as much as the sizes say. Call it before allocating.
  virtual void check_storage() const = 0;
  /// Reads all of it; `data` holds element_count() elements of `type`, which must be type().
  virtual void read(void* data, ElementType type) const = 0;
  /// Rows [first, first + count) of the outermost size.
  virtual void read_rows(std::int64_t first, std::int64_t count, void* data, ElementType type) const = 0;
};

/// A bundle's tree of groups, arrays and attributes, in whatever kind of file. Paths are absolute. All throw InputError
/// where the file is damaged.
class BundleStore {
 public:
  virtual ~BundleStore() = default;

  /// As messages name it.
  virtual const std::string& name() const = 0;
  /// The most bytes that all arrays together take in memory.
  virtual std::size_t capacity() const = 0;
  /// True if datasets carry their description, units and dims.
  virtual bool describes_itself() const = 0;
  virtual bool has_group(const std::string& path) const = 0;
  virtual bool has_dataset(const std::string& path) const = 0;
  /// Names of groups and datasets in a group, ascending.
  virtual std::vector<std::string> list(const std::string& group) const = 0;
  /// InputError if it is missing.
  virtual std::unique_ptr<StoredArray> open_dataset(const std::string& path) const = 0;
  virtual AttributeValue read_attribute(const std::string& object, const std::string& name) const = 0;
  /// CRC-32 that was stored with a dataset; nothing where what stands there is no number.
  virtual std::optional<std::int64_t> checksum(const std::string& dataset) const = 0;
};

/// Opens a bundle for reading, whatever kind it is of. InputError: no such file, of another kind, damaged.
std::unique_ptr<BundleStore> open_bundle(const BundleInput& input);

}  // namespace exmat

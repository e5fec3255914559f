#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/bundle/bundle_store.h"

namespace exmat {

// A pack, little-endian: a header of 64 bytes, a table, arrays. docs/packs.md has every field. Arrays follow each other
// in the order of the table, each at the next multiple of 64 bytes, so that no offset has to be believed.

inline constexpr std::string_view kPackMagic = "exmatpk\n";
inline constexpr std::uint32_t kPackVersion = 1;
inline constexpr std::size_t kPackAlignment = 64;  ///< offset of each array is a multiple of it; the header is as long
inline constexpr std::size_t kMostPackSizes = 8;   ///< dimensions of one array at most

/// Places in the header: magic 0, version 8, bytes of the pack 16, bytes of the table 24, CRC-32 of the table 32,
/// CRC-32 of the header before it 60; zeros elsewhere.
struct PackHeader {
  static constexpr std::size_t kVersion = 8, kBytes = 16, kTableBytes = 24, kTableCrc = 32, kCrc = 60, kSize = 64;
};

/// Kinds of entries of the table.
enum class PackEntry : std::uint8_t { kGroup = 1, kAttribute, kDataset };

/// Types of arrays and attributes by their numbers in a pack.
inline constexpr std::array kPackTypes = {ElementType::kFloat64, ElementType::kFloat32, ElementType::kInt64,
                                          ElementType::kInt32,   ElementType::kUint32,  ElementType::kUint8,
                                          ElementType::kString};

/// The next multiple of kPackAlignment.
constexpr std::size_t pack_aligned(std::size_t bytes) {
  return (bytes + kPackAlignment - 1) / kPackAlignment * kPackAlignment;
}

/// A bundle in a pack. Header, table and gaps are checked when it is opened, arrays when they are read.
class PackStore : public BundleStore {
 public:
  /// Every fault is an InputError that names `name` and the place.
  PackStore(std::string name, std::shared_ptr<const std::string> bytes);

  const std::string& name() const override { return name_; }
  std::size_t capacity() const override { return bytes_->size(); }
  bool describes_itself() const override { return false; }
  bool has_group(const std::string& path) const override { return path == "/" || groups_.contains(path); }
  bool has_dataset(const std::string& path) const override { return arrays_.contains(path); }
  std::vector<std::string> list(const std::string& group) const override;
  std::unique_ptr<StoredArray> open_dataset(const std::string& path) const override;
  AttributeValue read_attribute(const std::string& object, const std::string& name) const override;
  std::optional<std::int64_t> checksum(const std::string& dataset) const override;

  struct Array {
    ElementType type = ElementType::kFloat64;
    std::vector<std::int64_t> sizes;
    bool is_held = false;
    std::uint32_t crc32 = 0;
    std::span<const std::byte> data;  ///< within the pack
  };

 private:
  class TableCursor;

  std::span<const std::byte> check_header() const;
  void read_table(std::span<const std::byte> table);
  void place_arrays(std::size_t begin);
  [[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found,
                           const std::string& advice = "") const;

  std::string name_;
  std::shared_ptr<const std::string> bytes_;
  std::set<std::string> groups_;
  std::map<std::string, AttributeValue> attributes_;  // "/object@material"
  std::map<std::string, Array> arrays_;
  std::vector<Array*> order_;  // of the table
};

}  // namespace exmat

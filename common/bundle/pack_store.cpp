#include "common/bundle/pack_store.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <utility>

#include "common/core/crc32.h"
#include "common/core/error.h"
#include "common/core/saturating_product.h"

namespace exmat {
namespace {

static_assert(std::endian::native == std::endian::little, "packs are read as they are");

constexpr const char* kPackAgain = "the pack is damaged; make it again with exmat-runtime pack";

template <typename T>
T value_at(std::span<const std::byte> bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

/// An array of a pack that is open.
class PackArray : public StoredArray {
 public:
  PackArray(const PackStore::Array& array, std::string path) : array_(array), path_(std::move(path)) {}

  const std::string& path() const override { return path_; }
  const std::vector<std::int64_t>& sizes() const override { return array_.sizes; }
  std::optional<ElementType> type() const override { return array_.type; }
  std::string type_name() const override { return std::string(name_of(array_.type)); }
  std::size_t element_count() const override {
    return array_.is_held ? array_.data.size() / size_of(array_.type) : saturating_product(array_.sizes, 1);
  }
  bool is_held() const override { return array_.is_held; }
  void check_storage() const override {}  // when the pack was opened
  void read(void* data, ElementType) const override {
    if (!array_.data.empty()) std::memcpy(data, array_.data.data(), array_.data.size());
  }
  void read_rows(std::int64_t first, std::int64_t count, void* data, ElementType) const override {
    const std::size_t row = array_.data.size() / static_cast<std::size_t>(array_.sizes.front());
    const auto rows = array_.data.subspan(static_cast<std::size_t>(first) * row, static_cast<std::size_t>(count) * row);
    std::memcpy(data, rows.data(), rows.size());
  }

 private:
  const PackStore::Array& array_;
  std::string path_;
};

}  // namespace

/// Reads the table from front to back and refuses what would lead beyond its end.
class PackStore::TableCursor {
 public:
  TableCursor(const PackStore& pack, std::span<const std::byte> table) : pack_(pack), table_(table) {}

  bool is_at_end() const { return at_ == table_.size(); }

  template <typename T>
  T number() {
    require(sizeof(T));
    const T value = value_at<T>(table_, at_);
    at_ += sizeof(T);
    return value;
  }

  std::string text() {
    const auto length = number<std::uint32_t>();
    require(length);
    std::string text(reinterpret_cast<const char*>(table_.data()) + at_, length);
    at_ += length;
    return text;
  }

  ElementType type() {
    const auto number = this->number<std::uint8_t>();
    if (number >= kPackTypes.size()) refuse("a type", fmt::format("{}", number));
    return kPackTypes[number];
  }

  bool flag() {
    const auto value = number<std::uint8_t>();
    if (value > 1) refuse("0 or 1", fmt::format("{}", value));
    return value == 1;
  }

  AttributeValue value() {
    const ElementType type = this->type();
    const bool is_scalar = flag();
    const auto count = number<std::uint32_t>();
    if (is_scalar && count != 1) refuse("one value", fmt::format("{}", count));
    if (type == ElementType::kInt64) return numbers<std::int64_t>(count, is_scalar);
    if (type == ElementType::kFloat64) return numbers<double>(count, is_scalar);
    if (type != ElementType::kString) refuse("an attribute of int64, float64 or text", std::string(name_of(type)));
    if (is_scalar) return text();
    std::vector<std::string> texts;
    for (std::uint32_t i = 0; i < count; ++i) texts.push_back(text());
    return texts;
  }

  Array array() {
    Array array;
    array.type = type();
    if (array.type == ElementType::kString) refuse("an array of numbers", "text");
    const auto rank = number<std::uint8_t>();
    if (rank > kMostPackSizes) refuse(fmt::format("at most {} sizes", kMostPackSizes), fmt::format("{}", rank));
    for (int axis = 0; axis < rank; ++axis) {
      const auto size = number<std::int64_t>();
      if (size < 0 || size > std::numeric_limits<std::int32_t>::max())
        refuse("a size from 0 to 2147483647", fmt::format("{}", size));
      array.sizes.push_back(size);
    }
    array.is_held = flag();
    array.crc32 = number<std::uint32_t>();
    return array;
  }

  [[noreturn]] void refuse(const std::string& expected, const std::string& found) const {
    pack_.refuse(fmt::format("byte {}", PackHeader::kSize + at_), expected, found, kPackAgain);
  }

 private:
  void require(std::size_t bytes) const {
    if (bytes > table_.size() - at_)
      refuse(fmt::format("{} more bytes of the table", bytes), fmt::format("{}", table_.size() - at_));
  }

  template <typename T>
  AttributeValue numbers(std::uint32_t count, bool is_scalar) {
    require(sizeof(T) * std::size_t{count});
    std::vector<T> values(count);
    for (T& value : values) value = number<T>();
    if (is_scalar) return values.front();
    return values;
  }

  const PackStore& pack_;
  std::span<const std::byte> table_;
  std::size_t at_ = 0;
};

PackStore::PackStore(std::string name, std::shared_ptr<const std::string> bytes)
    : name_(std::move(name)), bytes_(std::move(bytes)) {
  const std::span<const std::byte> table = check_header();
  read_table(table);
  place_arrays(PackHeader::kSize + table.size());
}

std::span<const std::byte> PackStore::check_header() const {
  const auto bytes = bytes_of(*bytes_);
  if (!bytes_->starts_with(kPackMagic)) refuse("byte 0", "a pack of a bundle", "another kind of file");
  if (bytes.size() < PackHeader::kSize)
    refuse("", fmt::format("at least {} bytes", PackHeader::kSize), fmt::format("{}", bytes.size()),
           "the pack is cut short");
  const auto version = value_at<std::uint32_t>(bytes, PackHeader::kVersion);
  if (version != kPackVersion)
    refuse(fmt::format("byte {}", PackHeader::kVersion), fmt::format("version {}", kPackVersion),
           fmt::format("{}", version), "another version of exmat wrote this pack; make it again with this one");
  const std::uint32_t crc = crc32_of(bytes.first(PackHeader::kCrc));
  const auto stored = value_at<std::uint32_t>(bytes, PackHeader::kCrc);
  if (stored != crc)
    refuse("the header", fmt::format("checksum {:08x}", stored), fmt::format("{:08x}", crc), kPackAgain);
  const auto size = value_at<std::uint64_t>(bytes, PackHeader::kBytes);
  if (size != bytes.size())
    refuse("", fmt::format("{} bytes", size), fmt::format("{}", bytes.size()),
           size > bytes.size() ? fmt::format("the pack is cut short by {} bytes", size - bytes.size()) : kPackAgain);
  const auto table_bytes = value_at<std::uint64_t>(bytes, PackHeader::kTableBytes);
  if (table_bytes > bytes.size() - PackHeader::kSize)
    refuse(fmt::format("byte {}", PackHeader::kTableBytes),
           fmt::format("a table of at most {} bytes", bytes.size() - PackHeader::kSize), fmt::format("{}", table_bytes),
           kPackAgain);
  const auto table = bytes.subspan(PackHeader::kSize, table_bytes);
  const std::uint32_t table_crc = crc32_of(table);
  const auto stored_table_crc = value_at<std::uint32_t>(bytes, PackHeader::kTableCrc);
  if (stored_table_crc != table_crc)
    refuse("the table", fmt::format("checksum {:08x}", stored_table_crc), fmt::format("{:08x}", table_crc), kPackAgain);
  return table;
}

void PackStore::read_table(std::span<const std::byte> table) {
  TableCursor cursor(*this, table);
  while (!cursor.is_at_end()) {
    const auto kind = cursor.number<std::uint8_t>();
    const std::string path = cursor.text();
    bool is_new = true;
    if (kind == static_cast<std::uint8_t>(PackEntry::kGroup)) {
      is_new = groups_.insert(path).second;
    } else if (kind == static_cast<std::uint8_t>(PackEntry::kAttribute)) {
      const std::string place = path + "@" + cursor.text();
      is_new = attributes_.emplace(place, cursor.value()).second;
    } else if (kind == static_cast<std::uint8_t>(PackEntry::kDataset)) {
      const auto [array, is_added] = arrays_.emplace(path, cursor.array());
      if (is_added) order_.push_back(&array->second);
      is_new = is_added;
    } else {
      cursor.refuse("a group, an attribute or a dataset", fmt::format("entry of kind {}", kind));
    }
    if (!is_new) cursor.refuse("each name once", path + " again");
  }
}

void PackStore::place_arrays(std::size_t begin) {
  const auto bytes = bytes_of(*bytes_);
  const auto require_zeros = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i)
      if (bytes[i] != std::byte{0}) refuse(fmt::format("byte {}", i), "0 between arrays", "another byte", kPackAgain);
  };
  std::size_t end = begin;
  for (Array* const array : order_) {
    if (!array->is_held) continue;
    const std::size_t start = pack_aligned(end);
    if (start > bytes.size()) refuse("the table", "arrays that fit in the pack", "larger ones", kPackAgain);
    require_zeros(end, start);
    std::size_t count = std::ranges::find(array->sizes, 0) == array->sizes.end() ? 1 : 0;
    // The sizes are divided out of what is left, so that no product overflows.
    std::size_t left = (bytes.size() - start) / size_of(array->type);
    for (const std::int64_t size : array->sizes) {
      if (count == 0) break;
      left /= static_cast<std::size_t>(size);
      count *= static_cast<std::size_t>(size);
      if (left == 0) refuse("the table", "arrays that fit in the pack", "larger ones", kPackAgain);
    }
    end = start + count * size_of(array->type);
    if (end > bytes.size()) refuse("the table", "arrays that fit in the pack", "larger ones", kPackAgain);
    array->data = bytes.subspan(start, end - start);
  }
  if (pack_aligned(end) != bytes.size())
    refuse("", fmt::format("{} bytes, as the table has it", pack_aligned(end)), fmt::format("{}", bytes.size()),
           kPackAgain);
  require_zeros(end, bytes.size());
}

std::vector<std::string> PackStore::list(const std::string& group) const {
  const std::string folder = group == "/" ? "/" : group + "/";
  std::set<std::string> names;
  const auto add = [&](const std::string& path) {
    if (path.starts_with(folder) && path.find('/', folder.size()) == std::string::npos)
      names.insert(path.substr(folder.size()));
  };
  for (const std::string& path : groups_) add(path);
  for (const auto& [path, array] : arrays_) add(path);
  return {names.begin(), names.end()};
}

std::unique_ptr<StoredArray> PackStore::open_dataset(const std::string& path) const {
  const auto found = arrays_.find(path);
  if (found == arrays_.end()) refuse(path, "a dataset", "nothing of that name");
  return std::make_unique<PackArray>(found->second, path);
}

AttributeValue PackStore::read_attribute(const std::string& object, const std::string& name) const {
  const auto found = attributes_.find(object + "@" + name);
  if (found == attributes_.end()) refuse(object + "@" + name, "an attribute", "none of that name");
  return found->second;
}

std::optional<std::int64_t> PackStore::checksum(const std::string& dataset) const { return arrays_.at(dataset).crc32; }

void PackStore::refuse(const std::string& place, const std::string& expected, const std::string& found,
                       const std::string& advice) const {
  throw InputError({name_, place, expected, found, advice});
}

}  // namespace exmat

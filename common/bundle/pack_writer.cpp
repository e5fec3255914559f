#include <algorithm>
#include <cstring>
#include <type_traits>

#include "common/bundle/bundle.h"
#include "common/bundle/bundle_sink.h"
#include "common/bundle/pack_store.h"
#include "common/core/atomic_file.h"
#include "common/core/crc32.h"

namespace exmat {
namespace {

class PackSink : public BundleSink {
 public:
  explicit PackSink(std::string name) : name_(std::move(name)) {}

  const std::string& name() const override { return name_; }

  void group(const GroupSchema&, const std::string& path) override { begin(PackEntry::kGroup, path); }

  void attribute(const std::string& object, const std::string& name, const AttributeValue& value) override {
    begin(PackEntry::kAttribute, object);
    add_text(name);
    std::visit([this](const auto& held) { add_value(held); }, value);
  }

  void dataset(const DatasetSchema& schema, const std::string& path, std::span<const std::int64_t> sizes,
               const void* data) override {
    const bool is_held = schema.use != Use::kInspect;
    std::size_t bytes = is_held ? size_of(schema.type) : 0;
    for (const std::int64_t size : sizes) bytes *= static_cast<std::size_t>(size);
    const std::span content(static_cast<const std::byte*>(data), bytes);
    begin(PackEntry::kDataset, path);
    add_type(schema.type);
    add(static_cast<std::uint8_t>(sizes.size()));
    for (const std::int64_t size : sizes) add(size);
    add(static_cast<std::uint8_t>(is_held ? 1 : 0));
    add(crc32_of(content));
    if (is_held) arrays_.emplace_back(reinterpret_cast<const char*>(content.data()), content.size());
  }

  std::string finished() const {
    std::string pack(PackHeader::kSize, '\0');
    pack += table_;
    for (const std::string_view array : arrays_) {
      pack.resize(pack_aligned(pack.size()));
      pack += array;
    }
    pack.resize(pack_aligned(pack.size()));
    std::memcpy(pack.data(), kPackMagic.data(), kPackMagic.size());
    put(pack, PackHeader::kVersion, kPackVersion);
    put(pack, PackHeader::kBytes, std::uint64_t{pack.size()});
    put(pack, PackHeader::kTableBytes, std::uint64_t{table_.size()});
    put(pack, PackHeader::kTableCrc, crc32_of(std::as_bytes(std::span(table_))));
    put(pack, PackHeader::kCrc, crc32_of(std::as_bytes(std::span(pack)).first(PackHeader::kCrc)));
    return pack;
  }

 private:
  template <typename T>
  static void put(std::string& pack, std::size_t place, T value) {
    std::memcpy(pack.data() + place, &value, sizeof value);
  }

  template <typename T>
  void add(T value) {
    static_assert(std::is_arithmetic_v<T>);
    table_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }

  void add_text(const std::string& text) {
    add(static_cast<std::uint32_t>(text.size()));
    table_ += text;
  }

  void add_type(ElementType type) {
    add(static_cast<std::uint8_t>(std::ranges::find(kPackTypes, type) - kPackTypes.begin()));
  }

  void begin(PackEntry kind, const std::string& path) {
    add(static_cast<std::uint8_t>(kind));
    add_text(path);
  }

  template <typename T>
  void add_one(const T& value) {
    if constexpr (std::is_same_v<T, std::string>)
      add_text(value);
    else
      add(value);
  }

  template <typename T>
  void add_value(const T& value) {
    add_type(kElementType<T>);
    add(std::uint8_t{1});
    add(std::uint32_t{1});
    add_one(value);
  }

  template <typename T>
  void add_value(const std::vector<T>& values) {
    add_type(kElementType<T>);
    add(std::uint8_t{0});
    add(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) add_one(value);
  }

  std::string name_;
  std::string table_;
  std::vector<std::string_view> arrays_;  // of the model, which outlives the sink
};

}  // namespace

void write_pack(const ReducedModel& model, const std::filesystem::path& path) {
  PackSink sink(path.string());
  write_fields(model, sink);
  write_file_atomically(path, sink.finished());
}

}  // namespace exmat

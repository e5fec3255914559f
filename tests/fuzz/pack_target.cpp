// Any bytes are a pack or refused, also where the checksums of header and table fit.
#include <algorithm>
#include <cstring>
#include <memory>
#include <span>
#include <string>

#include "common/bundle/pack_store.h"
#include "common/core/crc32.h"
#include "tests/fuzz/bundle_checks.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using namespace exmat;

template <typename T>
void put(std::string& pack, std::size_t place, T value) {
  std::memcpy(pack.data() + place, &value, sizeof value);
}

// The table keeps its length where the pack has room for it.
std::string mended(std::string pack) {
  pack.resize(std::max(pack_aligned(pack.size()), PackHeader::kSize));
  std::memcpy(pack.data(), kPackMagic.data(), kPackMagic.size());
  put(pack, PackHeader::kVersion, kPackVersion);
  put(pack, PackHeader::kBytes, std::uint64_t{pack.size()});
  std::uint64_t table = 0;
  std::memcpy(&table, pack.data() + PackHeader::kTableBytes, sizeof table);
  table = std::min<std::uint64_t>(table, pack.size() - PackHeader::kSize);
  put(pack, PackHeader::kTableBytes, table);
  const auto bytes = std::as_bytes(std::span(pack));
  put(pack, PackHeader::kTableCrc, crc32_of(bytes.subspan(PackHeader::kSize, table)));
  put(pack, PackHeader::kCrc, crc32_of(bytes.first(PackHeader::kCrc)));
  return pack;
}

void check(std::string pack) { fuzz::check_bundle({"a pack", std::make_shared<const std::string>(std::move(pack))}); }

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string pack(reinterpret_cast<const char*>(data), size);
  check(pack);
  check(mended(std::move(pack)));
  return 0;
}

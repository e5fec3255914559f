#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

namespace exmat {

/// Hash of 64 bits, FNV-1a (Fowler, Noll and Vo), byte by byte: tells contents apart, keeps out nobody who wants to
/// forge one.
class FnvHash {
 public:
  void add(std::string_view bytes) {
    for (const char byte : bytes) add_byte(static_cast<unsigned char>(byte));
  }
  /// Its bytes, the lowest first on every machine.
  void add(double value) {
    for (int shift = 0; shift < 64; shift += 8) add_byte(std::bit_cast<std::uint64_t>(value) >> shift & 0xff);
  }
  /// Each of the numbers of a vector.
  void add_all(const auto& values) {
    for (const double value : values) add(value);
  }
  std::uint64_t value() const { return value_; }

 private:
  void add_byte(std::uint64_t byte) { value_ = (value_ ^ byte) * 0x100000001b3; }

  std::uint64_t value_ = 0xcbf29ce484222325;
};

/// FnvHash of some bytes alone.
inline std::uint64_t fnv_hash(std::string_view bytes) {
  FnvHash hash;
  hash.add(bytes);
  return hash.value();
}

}  // namespace exmat

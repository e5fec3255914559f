#include "common/core/crc32.h"

#include <gtest/gtest.h>
#include <random>
#include <string_view>
#include <vector>

namespace exmat {
namespace {

// The definition: division of polynomials over GF(2), bit by bit.
std::uint32_t by_bits(std::span<const std::byte> bytes) {
  std::uint32_t crc = ~0U;
  for (const std::byte byte : bytes) {
    crc ^= static_cast<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xedb88320U : crc >> 1;
  }
  return ~crc;
}

TEST(Crc32, HasTheCheckValueOfTheCatalogue) {
  constexpr std::string_view kDigits = "123456789";
  EXPECT_EQ(crc32_of(std::as_bytes(std::span(kDigits))), 0xcbf43926U);
}

TEST(Crc32, IsTheDivisionOfPolynomialsAtEveryLengthAndInAnyParts) {
  std::mt19937 random(1);
  std::vector<std::byte> bytes(100);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  for (std::size_t length = 0; length <= bytes.size(); ++length) {
    const auto part = std::span<const std::byte>(bytes).first(length);
    const std::uint32_t crc = by_bits(part);
    EXPECT_EQ(crc32_of(part), crc) << length;
    EXPECT_EQ(crc32_of(part.subspan(length / 3), crc32_of(part.first(length / 3))), crc) << length;
  }
}

}  // namespace
}  // namespace exmat

#include "common/core/fnv_hash.h"

#include <array>
#include <cstring>
#include <gtest/gtest.h>
#include <string>

namespace exmat {
namespace {

// From the authors' page.
TEST(FnvHash, IsThePublishedOne) {
  EXPECT_EQ(fnv_hash(""), 0xcbf29ce484222325);
  EXPECT_EQ(fnv_hash("a"), 0xaf63dc4c8601ec8c);
  EXPECT_EQ(fnv_hash("foobar"), 0x85944171f73967e8);
}

TEST(FnvHash, OfNumbersIsThatOfTheirBytes) {
  static_assert(std::endian::native == std::endian::little, "the bytes are compared as they lie");
  const std::array<double, 3> numbers{1.5, -0.0, 1e-300};
  std::string bytes(sizeof numbers, '\0');
  std::memcpy(bytes.data(), numbers.data(), sizeof numbers);
  FnvHash hash;
  hash.add_all(numbers);
  EXPECT_EQ(hash.value(), fnv_hash(bytes));
}

}  // namespace
}  // namespace exmat

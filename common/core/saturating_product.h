#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

namespace exmat {

/// The largest number where the product overflows.
inline std::size_t saturating_product(std::size_t a, std::size_t b) {
  constexpr std::size_t kMax = std::numeric_limits<std::size_t>::max();
  return a != 0 && b > kMax / a ? kMax : a * b;
}

inline std::size_t saturating_product(std::span<const std::int64_t> sizes, std::size_t bytes) {
  for (const std::int64_t size : sizes) bytes = saturating_product(bytes, static_cast<std::size_t>(size));
  return bytes;
}

}  // namespace exmat

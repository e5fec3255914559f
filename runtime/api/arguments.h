#pragma once

#include <algorithm>
#include <cinttypes>
#include <cstdint>
#include <cstring>
#include <vector>

#include "common/core/number_limits.h"
#include "runtime/api/failures.h"
#include "runtime/api/settings.h"

namespace exmat::runtime {

// Arguments of the functions of the C API.

inline exmat_status null_argument(const char* function, const char* argument) {
  return fail(EXMAT_INVALID_ARGUMENT, "%s: %s is NULL", function, argument);
}

inline exmat_status wrong_length(const char* function, const char* argument, std::int64_t found,
                                 std::int64_t expected) {
  return fail(EXMAT_INVALID_ARGUMENT, "%s: %s = %" PRId64 ": expected %" PRId64, function, argument, found, expected);
}

// Returns from the function that it stands in.
#define EXMAT_REQUIRE(argument) \
  if ((argument) == nullptr) return null_argument(__func__, #argument)
#define EXMAT_REQUIRE_LENGTH(length, expected) \
  if ((length) != static_cast<std::int64_t>(expected)) return wrong_length(__func__, #length, length, expected)

/// The first of `count` numbers that is not finite or farther than kFarthest; null: none.
inline const double* find_far(const double* numbers, std::int64_t count) {
  const double* const far = std::find_if_not(numbers, numbers + count, is_near);
  return far != numbers + count ? far : nullptr;
}

/// Checks that a struct which a caller hands over begins with a size that some version of it has.
inline exmat_status check_size(const char* function, std::size_t size, const StructSizes& sizes) noexcept {
  if (sizes.first <= size && size <= kMostStructBytes) return EXMAT_OK;
  return fail(EXMAT_INVALID_ARGUMENT, "%s: size = %zu: expected %zu, the sizeof of the struct", function, size,
              sizes.now);
}

/// As much as a caller of another version knows.
template <typename Struct>
void give(Struct from, std::size_t size, Struct* to) noexcept {
  from.size = size;
  if (size > sizeof from) std::memset(static_cast<void*>(to), 0, size);
  std::memcpy(static_cast<void*>(to), &from, std::min(size, sizeof from));
}

/// The same of one of an array's, `size` bytes each, which does not begin with its size.
template <typename Struct>
void give_entry(const Struct& from, std::size_t size, void* to) noexcept {
  if (size > sizeof from) std::memset(to, 0, size);
  std::memcpy(to, &from, std::min(size, sizeof from));
}

/// All of a list to a caller's array of `count` structs of `size` bytes.
template <typename Struct>
exmat_status give_list(const char* function, const std::vector<Struct>& list, const StructSizes& sizes, Struct* to,
                       std::int64_t count, std::size_t size) noexcept {
  if (const exmat_status status = check_size(function, size, sizes)) return status;
  if (count != std::ssize(list)) return wrong_length(function, "count", count, std::ssize(list));
  auto* entry = reinterpret_cast<unsigned char*>(to);
  for (const Struct& from : list) {
    give_entry(from, size, entry);
    entry += size;
  }
  return EXMAT_OK;
}

/// Members that the caller's version has come from `given`, the others from `known`.
template <typename Struct>
Struct completed(const Struct& given, Struct known) noexcept {
  std::memcpy(static_cast<void*>(&known), &given, std::min(given.size, sizeof known));
  known.size = sizeof known;
  return known;
}

}  // namespace exmat::runtime

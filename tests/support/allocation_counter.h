#pragma once

#include <cstddef>

namespace exmat::test {

/// Counts the heap allocations of this thread while it lives (operator new and malloc alike).
class AllocationCounter {
 public:
  AllocationCounter();
  ~AllocationCounter();
  AllocationCounter(const AllocationCounter&) = delete;
  AllocationCounter& operator=(const AllocationCounter&) = delete;

  std::size_t count() const;

  /// False where a sanitizer owns malloc.
  static bool works();
};

}  // namespace exmat::test

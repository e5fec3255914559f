#pragma once

#include <compare>
#include <cstdint>
#include <vector>

#include "exmat/exmat.h"

namespace exmat::runtime {

/// Pairs of bodies, and of bodies and obstacles, that touch, and how that changed in one call of steps.
class Touches {
 public:
  /// Before and after the steps of a call, from what the contacts of the world's states remember.
  void begin(const exmat_world& world);
  void end(const exmat_world& world);

  const std::vector<exmat_touch>& changes() const noexcept { return changes_; }
  /// Without those of a body of this id.
  void forget(std::int64_t body) noexcept;
  void clear() noexcept { changes_.clear(); }
  /// So many need no memory later.
  void reserve(std::size_t pairs);

 private:
  struct Pair {
    bool with_obstacle = false;
    std::int64_t body = 0, other = 0;  ///< ids; the latter of the obstacle, if with one
    auto operator<=>(const Pair&) const = default;
  };
  static void gather(const exmat_world& world, std::vector<Pair>& pairs);

  std::vector<Pair> before_, after_;  // ascending
  std::vector<exmat_touch> changes_;
};

}  // namespace exmat::runtime

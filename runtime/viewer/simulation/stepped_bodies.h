#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "exmat/exmat.hpp"

namespace exmat::viewer {

/// The bodies of a simulation: each for itself, or in a world where they touch each other.
class SteppedBodies {
 public:
  SteppedBodies() = default;
  explicit SteppedBodies(Bodies bodies);
  /// Of bodies with ids 0, 1, ...
  explicit SteppedBodies(World world);

  bool is_world() const { return world_.has_value(); }
  std::size_t size() const { return bodies_.size(); }
  BodyRef& operator[](std::size_t body) { return bodies_[body]; }
  const BodyRef& operator[](std::size_t body) const { return bodies_[body]; }

  /// Of all. Throws exmat::Error where a number is not finite.
  void step(std::int64_t steps);
  std::uint64_t hash() const;

  /// Of each body at the end of the last step: with obstacles, and with other bodies as with obstacle -1.
  std::vector<std::vector<exmat_contact>> contacts() const;

 private:
  Bodies apart_;
  std::optional<World> world_;
  std::vector<BodyRef> bodies_;  // of either
};

}  // namespace exmat::viewer

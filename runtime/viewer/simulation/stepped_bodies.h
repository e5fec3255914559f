#pragma once

#include <cstdint>
#include <vector>

#include "exmat/exmat.hpp"

namespace exmat::viewer {

/// The bodies of a simulation and their world.
class SteppedBodies {
 public:
  SteppedBodies() = default;
  explicit SteppedBodies(World world);

  World& world() { return world_; }
  const World& world() const { return world_; }
  std::size_t size() const { return bodies_.size(); }
  BodyRef& operator[](std::size_t body) { return bodies_[body]; }
  const BodyRef& operator[](std::size_t body) const { return bodies_[body]; }

  /// All of them. Throws exmat::Error where a number is not finite.
  void step(std::int64_t steps);

  /// Contacts of each body at the end of the last step: with obstacles, and with other bodies as with obstacle -1.
  std::vector<std::vector<exmat_contact>> contacts() const;

 private:
  World world_;
  std::vector<BodyRef> bodies_;  // in the order of their ids
};

}  // namespace exmat::viewer

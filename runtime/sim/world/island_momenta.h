#pragma once

#include <span>
#include <vector>

#include "runtime/sim/frame/placement.h"
#include "runtime/sim/world/world_body.h"

namespace exmat::runtime {

/// Momentum of several bodies together, about a point of the world. Bodies that nothing else touches keep it, whatever
/// they do to each other.
struct IslandMomenta {
  Eigen::Vector3d about = Eigen::Vector3d::Zero();  ///< [m]
  FrameMomenta total;
};

/// A body where a step begins.
struct BodyBegin {
  FrameMotion motion;
  Eigen::VectorXd q;          ///< whole displacement, for a body in full space
  double elastic_energy = 0;  ///< [J]
};

/// Bodies where a step begins.
struct IslandBegin {
  std::vector<BodyBegin> bodies;
  bool is_alone = false;  ///< nothing else touches them
  IslandMomenta momenta;  ///< of bodies that are alone, as external forces change them in the step
};

/// After the solution, before the end of the step. They are not alone where something else takes part: an obstacle that
/// pushes where it begins or ends, or a body that momenta do not move.
void begin_of(std::span<WorldBody* const> bodies, IslandBegin& begin);

/// After a step of theirs that did not converge, whose motion does not add up to what they have to have: gives them
/// their momenta by a rigid motion of all together, then takes out motion against each other until they have no more
/// than `allowed` kinetic energy [J]. Where the rigid motion alone has more, since they were left deformed or in each
/// other, they do not do what the step has found, but go on together, as they were, by that motion; then true.
bool take_momenta(std::span<WorldBody* const> bodies, const IslandBegin& begin, double allowed);

/// After a step that ends with more energy than there is without any motion: bodies that are not driven are where it
/// began, at rest.
void go_back(std::span<WorldBody* const> bodies, const IslandBegin& begin);

}  // namespace exmat::runtime

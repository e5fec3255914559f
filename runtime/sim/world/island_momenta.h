#pragma once

#include <optional>
#include <span>

#include "runtime/sim/frame/placement.h"
#include "runtime/sim/world/world_body.h"

namespace exmat::runtime {

/// What bodies have together, about a point of the world. Bodies that nothing else touches keep it, whatever they do to
/// each other.
struct IslandMomenta {
  Eigen::Vector3d about = Eigen::Vector3d::Zero();  ///< [m]
  FrameMomenta total;
};

/// After start_contact() of each, before the end of the step: what external forces alone have made of their momenta.
/// Nothing where something else takes part: an obstacle that is near, or a body that momenta do not move.
std::optional<IslandMomenta> expected_momenta(std::span<WorldBody* const> bodies) noexcept;

/// After a step of theirs that did not converge, whose motion does not add up to `momenta`: gives it to them by a rigid
/// motion of all together, then takes out motion against each other until they have no more than `allowed` kinetic
/// energy [J]. That leaves the momenta, as long as the rigid motion of all has no more energy; else it is slowed, too.
void take_momenta(std::span<WorldBody* const> bodies, const IslandMomenta& momenta, double allowed) noexcept;

}  // namespace exmat::runtime

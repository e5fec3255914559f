#pragma once

#include "common/core/arrays.h"
#include "runtime/sim/frame/placement.h"

namespace exmat::runtime {

/// Takes [n x 3] positions X + u of a deformed body, and with `velocities` its [n x 3] velocities of deformation, from
/// the body's frame to the world.
void to_world(const Placement& placement, VertexArray& positions);
void to_world(const Placement& placement, const FrameVelocity& velocity, VertexArray& positions,
              VertexArray& velocities);

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>

#include "common/mesh/tet_mesh.h"
#include "runtime/sim/frame/placement.h"

namespace exmat::runtime {

/// Exact for linear tets (consistent mass): `positions` and `velocities` [n x 3] of the deformed body, `rest_masses`
/// [n_t] of its tets, in one world frame.
FrameMomenta momenta(const TetArray& tets, const Eigen::VectorXd& rest_masses, const VertexArray& positions,
                     const VertexArray& velocities);

}  // namespace exmat::runtime

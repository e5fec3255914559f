#pragma once

#include <Eigen/Core>

#include "common/mesh/tet_mesh.h"

namespace exmat::runtime {

struct Momenta {
  Eigen::Vector3d linear;   ///< [kg m/s]
  Eigen::Vector3d angular;  ///< about the centre of mass [kg m^2/s]
};

/// Exact for linear tets (consistent mass): `positions` and `velocities` [n x 3] of the deformed body, `rest_masses`
/// [n_t] of its tets, in one world frame.
Momenta momenta(const TetArray& tets, const Eigen::VectorXd& rest_masses, const VertexArray& positions,
                const VertexArray& velocities);

}  // namespace exmat::runtime

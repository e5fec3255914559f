#pragma once

#include <Eigen/LU>

#include "common/elastic/stable_neo_hookean.h"
#include "common/mesh/tet_mesh.h"
#include "precompute/posing/surface_pose.h"

namespace exmat::test {

/// Elastic energy [m^3] of a pose of a cage's vertices, of the material that fills poses: a sum over the tets.
inline double pose_energy(const TetMesh& cage, const VertexArray& posed) {
  const LameParameters lame = lame_parameters(1, precompute::kPosePoisson);
  double sum = 0;
  for (Eigen::Index t = 0; t < cage.tet_count(); ++t) {
    Eigen::Matrix3d rest, here;
    for (int k = 0; k < 3; ++k) {
      rest.col(k) = (cage.vertices.row(cage.tets(t, k + 1)) - cage.vertices.row(cage.tets(t, 0))).transpose();
      here.col(k) = (posed.row(cage.tets(t, k + 1)) - posed.row(cage.tets(t, 0))).transpose();
    }
    const Eigen::Matrix3d H = here * rest.inverse() - Eigen::Matrix3d::Identity();
    sum += rest.determinant() / 6 * StableNeoHookean::energy(H, lame);
  }
  return sum;
}

}  // namespace exmat::test

#include "runtime/output/momentum.h"

#include <Eigen/Geometry>

namespace exmat::runtime {

FrameMomenta momenta(const TetArray& tets, const Eigen::VectorXd& rest_masses, const VertexArray& positions,
                     const VertexArray& velocities) {
  double mass = 0;
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero(), linear = Eigen::Vector3d::Zero();
  Eigen::Vector3d about_origin = Eigen::Vector3d::Zero();
  for (Eigen::Index t = 0; t < tets.rows(); ++t) {
    Eigen::Vector3d position_sum = Eigen::Vector3d::Zero(), velocity_sum = Eigen::Vector3d::Zero();
    Eigen::Vector3d cross_sum = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector3d x = positions.row(tets(t, corner)), v = velocities.row(tets(t, corner));
      position_sum += x;
      velocity_sum += v;
      cross_sum += x.cross(v);
    }
    mass += rest_masses[t];
    first_moment += rest_masses[t] / 4 * position_sum;
    linear += rest_masses[t] / 4 * velocity_sum;
    // The consistent mass matrix of a tet is m/20 (1 + delta_ij).
    about_origin += rest_masses[t] / 20 * (position_sum.cross(velocity_sum) + cross_sum);
  }
  return {linear, about_origin - (first_moment / mass).cross(linear)};
}

}  // namespace exmat::runtime

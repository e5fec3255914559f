#include "runtime/sim/frame/world_vertices.h"

namespace exmat::runtime {

void to_world(const Placement& placement, VertexArray& positions) {
  positions = (positions.rowwise() - placement.origin.transpose()) * placement.rotation.transpose();
  positions.rowwise() += placement.position.transpose();
}

void to_world(const Placement& placement, const FrameVelocity& velocity, VertexArray& positions,
              VertexArray& velocities) {
  to_world(placement, positions);
  velocities = velocities * placement.rotation.transpose();
  for (Eigen::Index i = 0; i < positions.rows(); ++i)
    velocities.row(i) += velocity.at(positions.row(i).transpose() - placement.position).transpose();
}

}  // namespace exmat::runtime

#include "runtime/sim/step/scene.h"

namespace exmat::runtime {

Eigen::VectorXd gravity_force(const Model& model, const Eigen::Vector3d& gravity) {
  return model.gravity_load.transpose() * gravity;
}

Eigen::VectorXd vertex_force(const RowMatrix& basis_rows, const Eigen::Vector3d& force) {
  Eigen::VectorXd generalised = Eigen::VectorXd::Zero(basis_rows.cols());
  for (Eigen::Index vertex = 0; vertex < basis_rows.rows() / 3; ++vertex)
    generalised += basis_rows.middleRows<3>(3 * vertex).transpose() * force;
  return generalised;
}

}  // namespace exmat::runtime

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

ScriptedForce scripted_force(const Model& model, const RowMatrix& basis_rows, const VertexArray& positions,
                             const Eigen::Vector3d& force) {
  ScriptedForce scripted;
  scripted.force = vertex_force(basis_rows, force);
  if (!model.frame->moves()) return scripted;
  const Eigen::Index count = positions.rows();
  scripted.total = static_cast<double>(count) * force;
  scripted.lever = positions.colwise().mean().transpose() - model.frame->centre_of_mass();
  scripted.mean_basis.setZero(3, basis_rows.cols());
  for (Eigen::Index i = 0; i < count; ++i) scripted.mean_basis += basis_rows.middleRows<3>(3 * i);
  scripted.mean_basis /= static_cast<double>(count);
  return scripted;
}

}  // namespace exmat::runtime

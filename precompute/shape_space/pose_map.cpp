#include "precompute/shape_space/pose_map.h"

#include <cmath>

namespace exmat::precompute {

void hold_fixed_mean(const FlagVector& fixed, Eigen::Ref<Eigen::MatrixXd> displacements) {
  const double count = fixed.cast<double>().sum();
  if (count == 0) return;
  for (auto field : displacements.colwise())
    for (int axis = 0; axis < 3; ++axis) {
      auto component = field(Eigen::seqN(axis, fixed.size(), 3));
      const double mean = fixed.cast<double>().dot(component) / count;
      component.array() -= mean;
    }
}

Eigen::MatrixXd pose_fields(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                            const ElasticSystem& system, const FieldClamp& clamp) {
  const Eigen::Index n = object.vertices.rows();
  Eigen::MatrixXd result(system.mass.rows(), 3 * weights.size());
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    const Eigen::VectorXd function = std::cbrt(object.volume) / weights[i] * object.eigenfunctions.col(i);
    Eigen::MatrixXd fields = Eigen::MatrixXd::Zero(3 * n, 3);
    for (int axis = 0; axis < 3; ++axis) fields(Eigen::seqN(axis, n, 3), axis) = function;
    hold_fixed_mean(fixed, fields);
    result.middleCols(3 * i, 3) = clamp.apply(fields);
  }
  return result;
}

RowMatrix pose_map(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                   const ElasticSystem& system, const FieldClamp& clamp, const RowMatrix& basis,
                   const RowMatrix& reduced_from_shape) {
  if (!system.constrained()) return reduced_from_shape;
  const Eigen::MatrixXd projector = system.mass * system.restrict(basis);
  return projector.transpose() * pose_fields(object, weights, fixed, system, clamp);
}

}  // namespace exmat::precompute

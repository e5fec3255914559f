#include "precompute/shape_space/pose_map.h"

#include "precompute/shape_space/projection.h"

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

Eigen::MatrixXd carried_fields(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                               const Eigen::MatrixXd& changes) {
  Eigen::MatrixXd fields(3 * fixed.size(), changes.cols());
  for (Eigen::Index k = 0; k < changes.cols(); ++k)
    fields.col(k) =
        reconstruct_displacement(object, weights, changes.col(k).reshaped<Eigen::RowMajor>(weights.size(), 3));
  hold_fixed_mean(fixed, fields);
  return fields;
}

PoseFields whole_body_poses(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                            const FieldClamp& clamp) {
  return [&](const Eigen::MatrixXd& changes) { return clamp.apply(carried_fields(object, weights, fixed, changes)); };
}

RowMatrix pose_map(const PoseFields& poses, Eigen::Index functions, const ElasticSystem& system,
                   const RowMatrix& basis) {
  const Eigen::MatrixXd projector = system.mass * system.restrict(basis);
  return projector.transpose() * poses(Eigen::MatrixXd::Identity(3 * functions, 3 * functions));
}

}  // namespace exmat::precompute

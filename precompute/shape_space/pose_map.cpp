#include "precompute/shape_space/pose_map.h"

#include <algorithm>

#include "precompute/shape_space/projection.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kClampedTogether = 32;  // what is in the making of a field is some times as large as the field

}  // namespace

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

Eigen::MatrixXd whole_body_poses(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                                 const FieldClamp& clamp) {
  const Eigen::Index changes = 3 * weights.size();
  const auto unit = [changes](Eigen::Index begin, Eigen::Index count) -> Eigen::MatrixXd {
    return Eigen::MatrixXd::Identity(changes, changes).middleCols(begin, count);
  };
  Eigen::MatrixXd poses(clamp.free_rows(), changes);
  for (Eigen::Index begin = 0; begin < changes; begin += kClampedTogether) {
    const Eigen::Index count = std::min(kClampedTogether, changes - begin);
    poses.middleCols(begin, count) = clamp.apply(carried_fields(object, weights, fixed, unit(begin, count)));
  }
  return poses;
}

RowMatrix pose_map(const Eigen::MatrixXd& poses, const ElasticSystem& system, const RowMatrix& basis) {
  const Eigen::MatrixXd projector = system.mass * system.restrict(basis);
  return projector.transpose() * poses;
}

}  // namespace exmat::precompute

#include "precompute/examples/full_space_data.h"

#include "precompute/shape_space/filter_functions.h"

namespace exmat::precompute {

Eigen::MatrixXd filter_coefficients(const FullSpaceData& data, const Eigen::VectorXd& displacements) {
  return data.filter.transpose() * displacements.reshaped<Eigen::RowMajor>(data.filter.rows(), 3);
}

std::optional<FullSpaceData> full_space_data(const ReducedModel& model, const ElasticSystem& system,
                                             const TargetSpace& targets, bool elastic) {
  const ObjectData& body = *model.object;
  const LaplaceBasis object = laplace_basis_of(model);
  const FilterFunctions filter(object, body.mesh, body.materials.density);
  if (!filter.symmetric) return std::nullopt;
  FullSpaceData data;
  const double root = filter.root_over_analysis();
  data.filter = root * filter.analysis;
  // Fixed vertices do not move.
  for (Eigen::Index v = 0; v < body.fixed.size(); ++v)
    if (body.fixed[v] != 0) data.filter.row(v).setZero();
  data.slopes = weight_slopes(object, model.shape_space->weighting, *model.examples) / root;
  const Eigen::MatrixXd& fields = targets.coordinates.basis;
  data.from_target.resize(fields.cols(), 3 * data.filter.cols());
  for (Eigen::Index i = 0; i < fields.cols(); ++i)
    data.from_target.row(i) =
        filter_coefficients(data, system.extend(fields.col(i))).reshaped<Eigen::RowMajor>().transpose();
  if (elastic) data.shapes = system.extend(fields);
  data.control_points =
      (targets.table ? targets.table->control_points : RowMatrix(targets.coordinates.poses.transpose())) *
      data.from_target;
  return data;
}

}  // namespace exmat::precompute

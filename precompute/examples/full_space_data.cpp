#include "precompute/examples/full_space_data.h"

#include "precompute/shape_space/filter_functions.h"

namespace exmat::precompute {

Eigen::MatrixXd filter_coefficients(const RowMatrix& filter, const Eigen::VectorXd& displacements) {
  return filter.transpose() * displacements.reshaped<Eigen::RowMajor>(filter.rows(), 3);
}

FullSpaceData full_space_data(const ReducedModel& model, const ElasticSystem& system, const RegionView* view,
                              const ExampleSet& examples, const TargetSpace& targets, bool elastic) {
  const ObjectData& body = *model.object;
  const LaplaceBasis object = laplace_basis_of(model);
  const FilterFunctions functions(object, body.mesh, body.materials.density);
  const double root = functions.root_over_analysis;
  RowMatrix filter = root * functions.analysis;
  FullSpaceData data;
  if (view == nullptr && model.skeleton && model.skeleton->shifts.rows() > 0) {
    const RowMatrix& shifts = model.skeleton->shifts;
    data.shifts.resize(std::ssize(examples.examples), 3 * filter.cols());
    for (Eigen::Index k = 0; k < data.shifts.rows(); ++k) {
      const RowMatrix shift = shifts.middleRows(k * filter.rows(), filter.rows());
      data.shifts.row(k) =
          filter_coefficients(filter, shift.reshaped<Eigen::RowMajor>()).reshaped<Eigen::RowMajor>().transpose();
    }
  }
  // Fixed vertices do not move beside what moves them.
  for (Eigen::Index v = 0; v < body.fixed.size(); ++v)
    if (body.fixed[v] != 0) filter.row(v).setZero();
  data.slopes = weight_slopes(object, model.shape_space->weighting, examples) / root;
  const Eigen::MatrixXd& fields = targets.coordinates.basis;
  data.from_target.resize(fields.cols(), 3 * filter.cols());
  for (Eigen::Index i = 0; i < fields.cols(); ++i) {
    Eigen::VectorXd field = system.extend(fields.col(i));
    if (view != nullptr) field = view->see(field);
    data.from_target.row(i) = filter_coefficients(filter, field).reshaped<Eigen::RowMajor>().transpose();
  }
  if (elastic) data.shapes = system.extend(fields);
  data.control_points =
      (targets.table ? targets.table->control_points : RowMatrix(targets.coordinates.poses.transpose())) *
      data.from_target;
  data.filter = view != nullptr ? RowMatrix(view->window().asDiagonal() * filter) : std::move(filter);
  return data;
}

}  // namespace exmat::precompute

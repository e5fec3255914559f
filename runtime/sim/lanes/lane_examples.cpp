#include "runtime/sim/lanes/lane_examples.h"

namespace exmat::runtime {

LaneExamples::LaneExamples(const ExampleModel& model)
    : load_(model.weights.examples() * kLanes), weights_(model.weights.examples() * kLanes) {
  const Eigen::MatrixXd& filter = model.filter;
  const Eigen::Index modes = filter.rows();
  pull_ = product_ = AlignedArray(modes * kLanes);
  filter_ = AlignedArray(lane_triangle(modes) / kLanes);
  for (Eigen::Index i = 0; i < modes; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) filter_[lane_entry(i, j) / kLanes] = filter(j, i);
  if (model.weights.has_candidates() && model.table && model.table->pieces() == 1 && !model.table->is_of_pairs())
    scratch_ = AlignedArray(model.table->lanes_scratch());
}

void LaneExamples::find_weights(const ExampleModel& model, const double* q) noexcept {
  const Eigen::MatrixXd& slope = model.weights.load_slope();
  const Eigen::Index count = model.weights.examples();
  kernels().lanes_matrix_product(slope.data(), count, slope.cols(), slope.outerStride(), q, load_.data());
  LaneVectors(load_.data(), kLanes, count).rowwise() += model.weights.load_at_rest().transpose().array();
  kernels().lanes_weights(model.weights.candidates(), load_.data(), weights_.data());
}

void LaneExamples::apply_bias(Eigen::Index lane, double bias) noexcept {
  LaneVectors all = weights();
  const Eigen::Index others = all.cols() - 1;
  if (others == 0) return;
  const double shared = (1 - bias) * all(lane, 0) / static_cast<double>(others);
  all(lane, 0) *= bias;
  for (Eigen::Index k = 1; k <= others; ++k) all(lane, k) = std::min(all(lane, k) + shared, 1.0);
}

void LaneExamples::give_weights(Eigen::Index lane, const Eigen::VectorXd& given) noexcept {
  weights().row(lane) = given;
}

void LaneExamples::find_targets(const ExampleModel& model) noexcept {
  model.table->evaluate_lanes(weights_.data(), scratch_.data(), pull_.data());
}

void LaneExamples::add_force(const ExampleModel& model, const LaneNumbers& factor, const LaneNumbers& stiffness,
                             AlignedArray& offset, AlignedArray& linear, AlignedArray& quadratic) noexcept {
  const Eigen::MatrixXd& filter = model.filter;
  const Eigen::Index modes = filter.rows();
  kernels().lanes_matrix_product(filter.data(), modes, modes, filter.outerStride(), offset.data(), product_.data());
  LaneVectors sum(linear.data(), kLanes, modes);
  sum += LaneVectors(product_.data(), kLanes, modes);
  sum -= pull().colwise() * factor;
  kernels().lanes_add_constants(lane_triangle(modes) / kLanes, filter_.data(), stiffness.data(), quadratic.data());
}

}  // namespace exmat::runtime

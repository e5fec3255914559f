#pragma once

#include <Eigen/Core>
#include <span>

#include "runtime/sim/lanes/lane_numbers.h"
#include "runtime/sim/step/model.h"

namespace exmat::runtime {

/// One example force of kLanes bodies side by side: their weights, targets, and its terms of the incremental potential.
/// Scratch, sized once for a model; the others are given with each call. K examples, r modes. No call allocates or
/// throws.
class LaneExamples {
 public:
  explicit LaneExamples(const ExampleModel& model);

  /// True if weights and targets of this model are found side by side: few examples that are well apart, and a table of
  /// one piece. Otherwise they are the caller's to set.
  bool finds_targets() const noexcept { return scratch_.size() > 0; }

  /// Weights of the poses q, before the bias.
  void find_weights(const ExampleModel& model, const double* q) noexcept;
  /// As apply_example_bias(), or those given [K].
  void apply_bias(Eigen::Index lane, double bias) noexcept;
  void give_weights(Eigen::Index lane, const Eigen::VectorXd& weights) noexcept;
  LaneVectors weights() noexcept { return {weights_.data(), kLanes, weights_.size() / kLanes}; }

  /// The pull [r] of the targets of these weights.
  void find_targets(const ExampleModel& model) noexcept;
  LaneVectors pull() noexcept { return {pull_.data(), kLanes, pull_.size() / kLanes}; }

  /// The force k P_s (q - q_c) - kappa pull of each lane, P_s symmetric: `offset` [r] = k (q - q_c) at the start, which
  /// is used up. Adds to the gradient there and to the quadratic form.
  void add_force(const ExampleModel& model, const LaneNumbers& factor, const LaneNumbers& stiffness,
                 AlignedArray& offset, AlignedArray& linear, AlignedArray& quadratic) noexcept;

 private:
  AlignedArray load_, weights_, pull_, product_, scratch_;
  AlignedArray filter_;  ///< P_s as matrices of lanes, once for all
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>

#include "runtime/sim/step/impulse_response.h"

namespace exmat::runtime {

/// Response of a body in its modes to the weights of one of its example forces, as a step of backward Euler of some
/// duration h would give it: S = h^2 A^-1 df/dw, see ImpulseResponse. K examples, n unknowns.
class WeightResponse {
 public:
  /// `force`: which of the scene's examples. Refers to all that it is made of.
  WeightResponse(const Model& model, const StepScene& scene, const State& state, std::size_t force);

  /// Where the state is now, for its weights. Tangent and allocation as of ImpulseResponse::update().
  void update(double duration, Tangent tangent = Tangent::kPositiveSemidefinite);

  Eigen::Index examples() const noexcept { return slopes_.cols() - 1; }
  ImpulseResponse& response() noexcept { return response_; }
  /// [n x (K + 1)]: the change of the unknowns at the end, as weight goes from all examples to example k; last, what
  /// elasticity and the forces of the last step make of the velocity at the end, times h.
  const Eigen::MatrixXd& ways() const noexcept { return slopes_; }

 private:
  const State& state_;
  std::size_t force_;
  ImpulseResponse response_;
  Eigen::MatrixXd slopes_;
  Eigen::VectorXd weights_, at_, near_, far_;  // K; r each
};

/// Targets for points of a body, which the weights of an example force are to bring them to. k points, K examples.
struct ReachTargets {
  std::size_t force = 0;            ///< which of the scene's examples
  VertexArray rest;                 ///< [k x 3] the points at rest, world [m]
  RowMatrix basis_rows;             ///< [3k x r]
  Eigen::VectorXd places;           ///< [3k] where they are to be, world [m]
  Eigen::VectorXd lowest, highest;  ///< [K] limits of the weights, sum of lowest <= 1 <= sum of highest
  double change = 0.05;             ///< most that a weight changes in a step
  double horizon = 0.5;             ///< how far ahead the body is looked at [s]
};

/// Distance of the point that is farthest from its place, of a body in its modes [m].
double farthest(const Model& model, const State& state, const ReachTargets& targets) noexcept;

/// True if weights of sum 1 are within these limits, in [0, 1].
bool can_hold(const Eigen::VectorXd& lowest, const Eigen::VectorXd& highest) noexcept;

/// Chooses the weights of a body that reaches for something, before each of its steps. docs/method.md, "Reach".
class Reach {
 public:
  Reach(const Model& model, const StepScene& scene, const State& state, ReachTargets targets);

  const ReachTargets& targets() const noexcept { return targets_; }
  ReachTargets& targets() noexcept { return targets_; }  ///< whose sizes stay

  /// Sets the weights of the scene's example force as given ones: those in their limits with which the points end
  /// nearest to their targets, squares summed, where the body would be after the horizon. Those that it has of a body
  /// that sleeps or is in full space. Allocates as WeightResponse::update().
  void choose_weights(StepScene& scene);

 private:
  void project() noexcept;
  void descend() noexcept;

  const State& state_;
  ReachTargets targets_;
  WeightResponse response_;
  Eigen::MatrixXd jacobian_, slopes_, hessian_;  // 3k x n, 3k x (K + 1), K x K
  Eigen::VectorXd velocity_, missing_, gradient_, weights_, lowest_, highest_;
};

}  // namespace exmat::runtime

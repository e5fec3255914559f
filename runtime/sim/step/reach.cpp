#include "runtime/sim/step/reach.h"

#include <algorithm>
#include <cmath>

namespace exmat::runtime {
namespace {

constexpr double kDifference = 1e-3;  // of weight, between forces whose difference is a slope
constexpr double kEffort = 1e-9;      // of the largest slope: of several solutions the nearest
constexpr int kMostSweeps = 200, kBisections = 60;
constexpr double kSameWeights = 1e-10;
constexpr double kSumTolerance = 1e-9;

}  // namespace

WeightResponse::WeightResponse(const Model& model, const StepScene& scene, const State& state, std::size_t force)
    : state_(state),
      force_(force),
      response_(model, scene, state),
      slopes_(Eigen::MatrixXd::Zero(response_.unknowns(), model.examples[force].weights.examples() + 1)),
      weights_(Eigen::VectorXd::Zero(slopes_.cols() - 1)),
      at_(Eigen::VectorXd::Zero(model.modes())),
      near_(at_),
      far_(at_) {}

void WeightResponse::update(double duration, Tangent tangent) {
  const double h = duration;
  response_.update(h, tangent);
  const Eigen::VectorXd& weights = state_.examples[force_].weights;
  const Eigen::Index modes = at_.size();
  slopes_.setZero();
  response_.example_force(force_, weights, at_);
  // One-sided differences of second order, along ways that stay among weights of sum 1.
  for (Eigen::Index k = 0; k < examples(); ++k) {
    weights_ = (1 - 0.5 * kDifference) * weights;
    weights_[k] += 0.5 * kDifference;
    response_.example_force(force_, weights_, near_);
    weights_ = (1 - kDifference) * weights;
    weights_[k] += kDifference;
    response_.example_force(force_, weights_, far_);
    slopes_.col(k).tail(modes) = h * h / kDifference * (4 * near_ - far_ - 3 * at_);
  }
  const auto K = response_.stiffness().selfadjointView<Eigen::Lower>();
  near_.noalias() = K * state_.v;
  slopes_.col(examples()).tail(modes) = h * h * (state_.a - h * near_);
  response_.solve_in_place(slopes_);
}

double farthest(const Model& model, const State& state, const ReachTargets& targets) noexcept {
  const Placement at = model.frame->placement(state.frame);
  const MaterialPoints points{targets.rest, targets.basis_rows};
  double most = 0;
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i)
    most = std::max(most, (place_of(points, i, at, state.q) - targets.places.segment<3>(3 * i)).norm());
  return most;
}

bool can_hold(const Eigen::VectorXd& lowest, const Eigen::VectorXd& highest) noexcept {
  return (lowest.array() <= highest.array()).all() && lowest.sum() <= 1 + kSumTolerance &&
         highest.sum() >= 1 - kSumTolerance;
}

Reach::Reach(const Model& model, const StepScene& scene, const State& state, ReachTargets targets)
    : state_(state),
      targets_(std::move(targets)),
      response_(model, scene, state, targets_.force),
      jacobian_(Eigen::MatrixXd::Zero(targets_.places.size(), response_.ways().rows())),
      slopes_(Eigen::MatrixXd::Zero(targets_.places.size(), response_.ways().cols())),
      hessian_(Eigen::MatrixXd::Zero(response_.examples(), response_.examples())),
      velocity_(Eigen::VectorXd::Zero(response_.ways().rows())),
      missing_(targets_.places),
      gradient_(Eigen::VectorXd::Zero(response_.examples())),
      weights_(gradient_),
      lowest_(gradient_),
      highest_(gradient_) {}

void Reach::choose_weights(StepScene& scene) {
  if (state_.sleep.asleep || state_.full) {
    scene.examples[targets_.force].given_weights = state_.examples[targets_.force].weights;
    return;
  }
  const MaterialPoints points{targets_.rest, targets_.basis_rows};
  ImpulseResponse& body = response_.response();
  const Eigen::Index K = response_.examples();
  response_.update(targets_.horizon, Tangent::kExact);
  body.set_jacobian(points, jacobian_);
  body.set_velocity(velocity_);
  slopes_.noalias() = jacobian_ * response_.ways();
  missing_ = slopes_.col(K) - targets_.places;
  missing_.noalias() += targets_.horizon * (jacobian_ * velocity_);
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i) missing_.segment<3>(3 * i) += body.place(points, i);
  hessian_.noalias() = slopes_.leftCols(K).transpose() * slopes_.leftCols(K);
  hessian_.diagonal().array() += kEffort * hessian_.diagonal().maxCoeff();
  gradient_.noalias() = slopes_.leftCols(K).transpose() * missing_;
  weights_ = state_.examples[targets_.force].weights;
  project();
  lowest_ = (weights_.array() - targets_.change).max(targets_.lowest.array());
  highest_ = (weights_.array() + targets_.change).min(targets_.highest.array());
  weights_ -= state_.examples[targets_.force].weights;
  gradient_.noalias() += hessian_ * weights_;
  weights_ += state_.examples[targets_.force].weights;
  descend();
  scene.examples[targets_.force].given_weights = weights_;
}

/// The weights of sum 1 within the limits that are nearest.
void Reach::project() noexcept {
  double low = -2, high = 2;
  const auto clamped = [&](Eigen::Index k, double shift) {
    return std::clamp(weights_[k] + shift, targets_.lowest[k], targets_.highest[k]);
  };
  const auto sum_at = [&](double shift) {
    double sum = 0;
    for (Eigen::Index k = 0; k < weights_.size(); ++k) sum += clamped(k, shift);
    return sum;
  };
  if (sum_at(0) == 1) low = high = 0;
  for (int i = 0; i < kBisections && low < high; ++i) {
    const double middle = 0.5 * (low + high);
    (sum_at(middle) < 1 ? low : high) = middle;
  }
  for (Eigen::Index k = 0; k < weights_.size(); ++k) weights_[k] = clamped(k, high);
}

/// Minimises the quadratic form within lowest_ and highest_: weight goes from one example to another, pair by pair, so
/// that the sum stays.
void Reach::descend() noexcept {
  const Eigen::Index K = weights_.size();
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double moved = 0;
    for (Eigen::Index i = 0; i < K; ++i)
      for (Eigen::Index j = 0; j < i; ++j) {
        const double curvature = hessian_(i, i) - 2 * hessian_(i, j) + hessian_(j, j);
        if (!(curvature > 0)) continue;
        const double most = std::min(highest_[i] - weights_[i], weights_[j] - lowest_[j]);
        const double least = std::max(lowest_[i] - weights_[i], weights_[j] - highest_[j]);
        if (!(least < most)) continue;
        const double step = std::clamp((gradient_[j] - gradient_[i]) / curvature, least, most);
        weights_[i] += step;
        weights_[j] -= step;
        gradient_ += step * (hessian_.col(i) - hessian_.col(j));
        moved = std::max(moved, std::abs(step));
      }
    if (moved < kSameWeights) return;
  }
}

}  // namespace exmat::runtime

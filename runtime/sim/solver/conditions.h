#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "common/core/decompositions.h"

namespace exmat::runtime {

/// Potential where nothing leads back to the conditions.
inline constexpr double kNowhere = std::numeric_limits<double>::infinity();

/// The diagonal of J A^-1 J^T is larger by this share, so that conditions which say the same twice share their
/// multiplier.
inline constexpr double kRedundant = 1e-13;

/// Unknowns that enter some of the conditions: m of the conditions, k of the unknowns.
struct ConditionBlock {
  Eigen::Index offset = 0, first = 0;  ///< of the unknowns, of the conditions
  Eigen::MatrixXd gradients;           ///< k x m: J^T
  Eigen::MatrixXd directions;          ///< k x m: A^-1 J^T, A near the Hessian
};

/// Conditions C(x) = 0 that a minimisation keeps in every iterate. x goes back to them along A^-1 J^T, J = dC/dx.
/// Gradients become those of the Lagrangian, g - J^T lambda, with the multipliers lambda that make Newton's direction
/// tangent. A need not be the Hessian: where it is not, Newton's direction has to be made tangent as it is found.
class Conditions {
 public:
  Eigen::Index conditions() const noexcept { return violation.size(); }
  void resize(Eigen::Index conditions);

  /// Factorises the product of gradients and directions; conditions without a gradient stay 0 = 0.
  void factorise() noexcept;

  /// Takes x to C(x) = 0. set(x) sets violation and gradients there, and returns how far things are from the origin,
  /// to whose rounding C is known. False if it led away from there: x is then of no use.
  template <class Set>
  [[nodiscard]] bool hold(Eigen::VectorXd& x, const Set& set) noexcept {
    double last = std::numeric_limits<double>::infinity();
    bool is_current = false;  // of the product; it is so at first: where x ends depends on where it begins alone
    const double rounding = kRounding * (1 + set(x));
    const double first = violation.lpNorm<Eigen::Infinity>();
    for (int i = 0; i < kReturns; ++i) {
      const double lacking = violation.lpNorm<Eigen::Infinity>();
      if (!(lacking > rounding) || (is_current && !(lacking < 0.5 * last))) break;
      is_current = i == 0 || lacking > kSlow * last;
      if (is_current) factorise();
      last = lacking;
      change.noalias() = factor.solve(violation);
      subtract_directions(x);
      set(x);
    }
    factorise();
    return violation.lpNorm<Eigen::Infinity>() <= first + kLed * rounding;
  }
  /// Takes the forces of the conditions, with the multipliers that they have there, off a gradient.
  void subtract_forces(Eigen::VectorXd& gradient) noexcept;
  /// Takes what leaves the conditions off a direction.
  void make_tangent(Eigen::Ref<Eigen::VectorXd> x) noexcept;

  std::vector<ConditionBlock> blocks;
  Eigen::VectorXd violation, multipliers, change;  ///< c: C, lambda, scratch
  Eigen::MatrixXd product;                         ///< c x c: J (A^-1 J^T)
  Eigen::PartialPivLU<Eigen::MatrixXd> factor;     ///< LU factors of product

 private:
  static constexpr int kReturns = 16;  // at most
  static constexpr double kSlow =
      0.1;  // of what a return begins with: if more is left, the product is factorised again
  static constexpr double kRounding = 16 * std::numeric_limits<double>::epsilon();
  static constexpr double kLed = 1e4;  // times the rounding: what conditions that contradict each other may lose

  void subtract_directions(Eigen::Ref<Eigen::VectorXd> x) noexcept;
};

}  // namespace exmat::runtime

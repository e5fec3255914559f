#include "runtime/sim/solver/conditions.h"

namespace exmat::runtime {

void Conditions::resize(Eigen::Index conditions) {
  violation = multipliers = change = Eigen::VectorXd::Zero(conditions);
  product.setIdentity(conditions, conditions);
  if (conditions > 0) factor.compute(product);
}

void Conditions::factorise() noexcept {
  product.setZero();
  for (const ConditionBlock& own : blocks)
    for (const ConditionBlock& other : blocks)
      if (own.offset == other.offset)
        product.block(own.first, other.first, own.gradients.cols(), other.gradients.cols()) +=
            own.gradients.transpose().lazyProduct(other.directions);
  for (Eigen::Index k = 0; k < conditions(); ++k) {
    if (product(k, k) == 0) product(k, k) = 1;
    product(k, k) *= 1 + kRedundant;
  }
  factor.compute(product);
}

void Conditions::subtract_directions(Eigen::Ref<Eigen::VectorXd> x) noexcept {
  for (const ConditionBlock& own : blocks)
    x.segment(own.offset, own.directions.rows()) -=
        own.directions.lazyProduct(change.segment(own.first, own.directions.cols()));
}

void Conditions::subtract_forces(Eigen::VectorXd& gradient) noexcept {
  change.setZero();
  for (const ConditionBlock& own : blocks)
    change.segment(own.first, own.directions.cols()) +=
        own.directions.transpose().lazyProduct(gradient.segment(own.offset, own.directions.rows()));
  factor.matrixLU().triangularView<Eigen::Upper>().transpose().solveInPlace(change);
  factor.matrixLU().triangularView<Eigen::UnitLower>().transpose().solveInPlace(change);
  multipliers.noalias() = factor.permutationP().transpose() * change;
  for (const ConditionBlock& own : blocks)
    gradient.segment(own.offset, own.gradients.rows()) -=
        own.gradients.lazyProduct(multipliers.segment(own.first, own.gradients.cols()));
}

void Conditions::make_tangent(Eigen::Ref<Eigen::VectorXd> x) noexcept {
  violation.setZero();
  for (const ConditionBlock& own : blocks)
    violation.segment(own.first, own.gradients.cols()) +=
        own.gradients.transpose().lazyProduct(x.segment(own.offset, own.gradients.rows()));
  change.noalias() = factor.solve(violation);
  subtract_directions(x);
}

}  // namespace exmat::runtime

#include "runtime/sim/elasticity/reduced_polynomial.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

using ConstArray = Eigen::Map<const Eigen::ArrayXd>;

ConstArray view(const AlignedArray& array) { return {array.data(), array.size()}; }

/// D by block columns of the lower triangle, each block column-major; blocks on the diagonal are whole.
AlignedArray in_blocks(const Eigen::VectorXd& triangle, Eigen::Index pairs, Eigen::Index blocks) {
  AlignedArray array(blocks * (blocks + 1) / 2 * kLanes * kLanes);
  double* out = array.data();
  for (Eigen::Index column = 0; column < blocks; ++column)
    for (Eigen::Index row = column; row < blocks; ++row)
      for (Eigen::Index j = column * kLanes; j < (column + 1) * kLanes; ++j)
        for (Eigen::Index i = row * kLanes; i < (row + 1) * kLanes; ++i, ++out) {
          const Eigen::Index high = std::max(i, j), low = std::min(i, j);
          if (high < pairs) *out = triangle[high * (high + 1) / 2 + low];
        }
  return array;
}

}  // namespace

ReducedPolynomial::ReducedPolynomial(const PolynomialData& data)
    : modes_(data.stiffness.rows()),
      stiffness_(pairs()),
      cubic_(padded(pairs()) * modes_),
      quartic_(in_blocks(data.quartic, pairs(), blocks())) {
  for (Eigen::Index i = 0, pair = 0; i < modes_; ++i)
    for (Eigen::Index j = 0; j <= i; ++j, ++pair) {
      stiffness_[pair] = data.stiffness(i, j);
      for (Eigen::Index k = 0; k < modes_; ++k) cubic_[k * padded(pairs()) + pair] = data.cubic(pair, k);
    }
}

ReducedPolynomial::Workspace ReducedPolynomial::make_workspace() const {
  return {AlignedArray(pairs()), AlignedArray(pairs()), AlignedArray(pairs())};
}

/// K3 and K4 into the workspace; returns the energy.
double ReducedPolynomial::contract(const Eigen::VectorXd& q, Workspace& workspace) const noexcept {
  double* pair = workspace.pairs.data();
  for (Eigen::Index i = 0; i < modes_; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) *pair++ = q[i] * q[j];
    *pair++ = 0.5 * q[i] * q[i];
  }
  kernels().symmetric_product(quartic_.data(), blocks(), workspace.pairs.data(), workspace.quartic.data());
  kernels().matrix_vector(cubic_.data(), padded(pairs()), modes_, padded(pairs()), q.data(), workspace.cubic.data());
  return (view(workspace.pairs) * (view(stiffness_) + view(workspace.cubic) / 3 + view(workspace.quartic) / 6)).sum();
}

double ReducedPolynomial::energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept {
  return contract(q, workspace);
}

double ReducedPolynomial::force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept {
  const double energy = contract(q, workspace);
  force.setZero();
  for (Eigen::Index i = 0, pair = 0; i < modes_; ++i, ++pair) {
    double row = 0;
    for (Eigen::Index j = 0; j < i; ++j, ++pair) {
      const double secant = stiffness_[pair] + workspace.cubic[pair] / 2 + workspace.quartic[pair] / 3;
      row += secant * q[j];
      force[j] += secant * q[i];
    }
    force[i] += row + (stiffness_[pair] + workspace.cubic[pair] / 2 + workspace.quartic[pair] / 3) * q[i];
  }
  return energy;
}

double ReducedPolynomial::force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                                              Eigen::MatrixXd& stiffness) const noexcept {
  const double energy = this->force(q, workspace, force);
  for (Eigen::Index i = 0, pair = 0; i < modes_; ++i)
    for (Eigen::Index j = 0; j <= i; ++j, ++pair)
      stiffness(i, j) = stiffness_[pair] + workspace.cubic[pair] + workspace.quartic[pair];
  return energy;
}

}  // namespace exmat::runtime

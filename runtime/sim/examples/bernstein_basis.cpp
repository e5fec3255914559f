#include "runtime/sim/examples/bernstein_basis.h"

namespace exmat::runtime {
namespace {

// Times the largest multinomial coefficient far below rounding, yet products of several are far from the subnormal
// numbers, which are slow.
constexpr double kSmallestPower = 1e-60;

}  // namespace

BernsteinBasis::BernsteinBasis(int degree, int weights)
    : degree_(degree),
      weights_(weights),
      binomials_(Eigen::MatrixXd::Zero(degree + 1, degree + 1)),
      sums_(Eigen::MatrixXi::Zero(weights + 1, degree + 1)) {
  for (int n = 0; n <= degree; ++n)
    for (int a = 0; a <= n; ++a) binomials_(a, n) = a == 0 ? 1 : binomials_(a - 1, n - 1) + binomials_(a, n - 1);
  sums_(0, 0) = 1;
  for (int k = 1; k <= weights; ++k)
    for (int m = 0; m <= degree; ++m) sums_(k, m) = sums_(k - 1, m) + (m > 0 ? sums_(k, m - 1) : 0);
  size_ = sums_(weights, degree);
}

BernsteinBasis::Workspace BernsteinBasis::make_workspace() const {
  return {Eigen::MatrixXd::Zero(degree_ + 1, weights_)};
}

IndexMatrix BernsteinBasis::exponents() const {
  IndexMatrix all(size_, weights_);
  Eigen::VectorXi a = degree_ * Eigen::VectorXi::Unit(weights_, 0);
  for (Eigen::Index n = 0;; ++n) {
    all.row(n) = a.transpose();
    if (n + 1 == size_) return all;
    const int last = a[weights_ - 1];  // moves, with one more, to behind the last other exponent that is not zero
    a[weights_ - 1] = 0;
    int k = weights_ - 2;
    while (a[k] == 0) --k;
    --a[k];
    a[k + 1] = last + 1;
  }
}

Eigen::Index BernsteinBasis::number(const Eigen::VectorXi& exponents) const {
  Eigen::Index before = 0;
  int left = degree_;
  for (int k = 0; k + 1 < weights_; ++k) {
    left -= exponents[k];
    if (left > 0) before += sums_(weights_ - k, left - 1);  // those that agree up to k and are larger there
  }
  return before;
}

BernsteinArrays BernsteinBasis::arrays() const noexcept {
  return {degree_, weights_, binomials_.data(), kSmallestPower};
}

void BernsteinBasis::fill_powers(const Eigen::VectorXd& w, Workspace& workspace) const noexcept {
  for (int k = 0; k < weights_; ++k) {
    double power = 1;
    for (int a = 0; a <= degree_; ++a, power *= w[k]) {
      if (power < kSmallestPower) power = 0;
      workspace.powers(k == weights_ - 2 ? degree_ - a : a, k) = power;
    }
  }
}

// Polynomials whose first k exponents are given, `product` of their factors, and the rest of which add up to `left`.
void BernsteinBasis::expand(int k, int left, double product, const Workspace& workspace, double*& next) const noexcept {
  const double* powers = &workspace.powers(0, k);
  if (k + 2 < weights_) {
    for (int a = left; a >= 0; --a) expand(k + 1, left - a, product * binomials_(a, left) * powers[a], workspace, next);
    return;
  }
  const double* last = &workspace.powers(0, k + 1);
  const double* binomials = &binomials_(0, left);
  for (int b = 0; b <= left; ++b) next[b] = product * binomials[b] * (powers[degree_ - left + b] * last[b]);
  next += left + 1;
}

void BernsteinBasis::values(const Eigen::VectorXd& w, Workspace& workspace,
                            Eigen::Ref<Eigen::VectorXd> values) const noexcept {
  fill_powers(w, workspace);
  double* next = values.data();
  expand(0, degree_, 1.0, workspace, next);
}

}  // namespace exmat::runtime

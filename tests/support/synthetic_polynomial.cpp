#include "tests/support/synthetic_polynomial.h"

#include <Eigen/LU>
#include <cmath>

namespace exmat::test {
namespace {

/// Ten numbers whose dot product with those of another strain is c (2 mu A : B + lambda tr A tr B).
void write_strain(const Eigen::Matrix3d& strain, double c_mu, double c_lambda, Eigen::MatrixXd& columns,
                  Eigen::Index element, Eigen::Index column) {
  columns.col(column).segment<9>(10 * element) = std::sqrt(2 * c_mu) * strain.reshaped();
  columns(10 * element + 9, column) = std::sqrt(c_lambda) * strain.trace();
}

Eigen::Index pair_of(Eigen::Index i, Eigen::Index j) { return i < j ? pair_of(j, i) : i * (i + 1) / 2 + j; }

/// Columns of L_i [10s x r] and of Q_ij [10s x R], where E(q) = sum_i L_i q_i + sum_ij Q_ij q_i q_j, Q_ij = Q_ji.
struct StrainParts {
  Eigen::MatrixXd linear, quadratic;
};

StrainParts strain_parts(const CubatureData& cubature) {
  const Eigen::Index modes = cubature.gradient.cols(), elements = cubature.weights.size();
  StrainParts parts{Eigen::MatrixXd(10 * elements, modes), Eigen::MatrixXd(10 * elements, modes * (modes + 1) / 2)};
  for (Eigen::Index e = 0; e < elements; ++e) {
    const double young = cubature.youngs_modulus[e], poisson = cubature.poisson_ratio[e];
    const double c = cubature.weights[e] * cubature.volumes[e];
    const double c_mu = c * young / 2 / (1 + poisson);
    const double c_lambda = c * young * poisson / (1 + poisson) / (1 - 2 * poisson);
    const auto gradient = [&](Eigen::Index i) -> Eigen::Matrix3d {
      return cubature.gradient.col(i).segment<9>(9 * e).reshaped<Eigen::RowMajor>(3, 3);
    };
    for (Eigen::Index i = 0; i < modes; ++i) {
      const Eigen::Matrix3d first = gradient(i);
      write_strain(0.5 * (first + first.transpose()), c_mu, c_lambda, parts.linear, e, i);
      for (Eigen::Index j = 0; j <= i; ++j) {
        const Eigen::Matrix3d product = first.transpose() * gradient(j);
        write_strain(0.25 * (product + product.transpose()), c_mu, c_lambda, parts.quadratic, e, pair_of(i, j));
      }
    }
  }
  return parts;
}

}  // namespace

/// E = 1/2 <L + Q, L + Q>; the derivatives at rest sum over all orders of their indices.
PolynomialData make_polynomial(const CubatureData& cubature) {
  const auto [linear, quadratic] = strain_parts(cubature);
  const Eigen::Index modes = linear.cols(), pairs = quadratic.cols();
  const Eigen::MatrixXd lq = linear.transpose() * quadratic, qq = quadratic.transpose() * quadratic;
  PolynomialData data{linear.transpose() * linear, RowMatrix(pairs, modes), Eigen::VectorXd(pairs * (pairs + 1) / 2)};
  Eigen::Index entry = 0;
  for (Eigen::Index i = 0; i < modes; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) {
      for (Eigen::Index k = 0; k < modes; ++k)
        data.cubic(pair_of(i, j), k) = 2 * (lq(i, pair_of(j, k)) + lq(j, pair_of(i, k)) + lq(k, pair_of(i, j)));
      for (Eigen::Index k = 0; k <= i; ++k)
        for (Eigen::Index l = 0; l <= k && pair_of(k, l) <= pair_of(i, j); ++l)
          data.quartic[entry++] = 4 * (qq(pair_of(i, j), pair_of(k, l)) + qq(pair_of(i, k), pair_of(j, l)) +
                                       qq(pair_of(i, l), pair_of(j, k)));
    }
  return data;
}

}  // namespace exmat::test

#include "runtime/sim/elasticity/stiffness_polynomial.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace exmat::runtime {
namespace {

constexpr int kStrains = 6;

Eigen::Index pair_of(Eigen::Index i, Eigen::Index j) {
  const auto [low, high] = std::minmax(i, j);
  return high * (high + 1) / 2 + low;
}

/// Symmetric, shears times the root of 2: the product of two is their double dot.
Eigen::Matrix<double, kStrains, 1> strain_of(const Eigen::Matrix3d& M) {
  const double root = std::sqrt(0.5);
  return {
      M(0, 0), M(1, 1), M(2, 2), root * (M(1, 2) + M(2, 1)), root * (M(0, 2) + M(2, 0)), root * (M(0, 1) + M(1, 0))};
}

/// Derivatives of the Green strain of all elements: by q_i at rest, and by q_i and q_j, which are constant.
struct StrainDerivatives {
  Eigen::MatrixXd first, second;  ///< 6 s x r, 6 s x pairs

  explicit StrainDerivatives(const Eigen::Ref<const RowMatrix>& gradient)
      : first(gradient.rows() / 9 * kStrains, gradient.cols()),
        second(first.rows(), gradient.cols() * (gradient.cols() + 1) / 2) {
    std::vector<Eigen::Matrix3d> H(static_cast<std::size_t>(gradient.cols()));
    for (Eigen::Index element = 0; element < gradient.rows() / 9; ++element)
      for (Eigen::Index i = 0; i < gradient.cols(); ++i) {
        Eigen::Matrix3d& own = H[static_cast<std::size_t>(i)];
        own = gradient.block<9, 1>(9 * element, i).reshaped<Eigen::RowMajor>(3, 3);
        first.block<kStrains, 1>(kStrains * element, i) = strain_of(own);
        for (Eigen::Index j = 0; j <= i; ++j)
          second.block<kStrains, 1>(kStrains * element, pair_of(i, j)) =
              strain_of(own.transpose() * H[static_cast<std::size_t>(j)]);
      }
  }
};

/// Stresses of strains: lambda tr(E) I + 2 mu E.
Eigen::MatrixXd stresses(const Eigen::MatrixXd& strains, const Eigen::Ref<const Eigen::VectorXd>& mu,
                         const Eigen::Ref<const Eigen::VectorXd>& lambda) {
  Eigen::MatrixXd found = strains;
  for (Eigen::Index element = 0; element < mu.size(); ++element) {
    auto rows = found.middleRows<kStrains>(kStrains * element);
    const Eigen::RowVectorXd pressure = lambda[element] * rows.topRows<3>().colwise().sum();
    rows *= 2 * mu[element];
    rows.topRows<3>().rowwise() += pressure;
  }
  return found;
}

using Pair = std::pair<Eigen::Index, Eigen::Index>;

/// work(i, entries j, k of a block) of all blocks, in order: see StiffnessPolynomialArrays.
template <class Work>
void for_blocks(Eigen::Index modes, Work work) {
  std::vector<Pair> entries;
  for (Eigen::Index i = 0; i < modes; ++i)
    for (Eigen::Index row = 0; row <= i; row += kLaneBlock)
      for (Eigen::Index column = 0; column <= row; column += kLaneBlock) {
        entries.clear();
        for (Eigen::Index j = row; j < std::min(row + kLaneBlock, i + 1); ++j)
          for (Eigen::Index k = column; k < std::min(column + kLaneBlock, j + 1); ++k) entries.emplace_back(j, k);
        work(i, entries);
      }
}

}  // namespace

StiffnessPolynomial::StiffnessPolynomial(Eigen::Ref<const RowMatrix> gradient, Eigen::Ref<const Eigen::VectorXd> mu,
                                         Eigen::Ref<const Eigen::VectorXd> lambda)
    : modes_(gradient.cols()), constant_(lane_triangle(modes_) / kLanes) {
  const StrainDerivatives strains(gradient);
  const Eigen::MatrixXd stress = stresses(strains.second, mu, lambda);
  const Eigen::MatrixXd linear = strains.first.transpose() * stresses(strains.first, mu, lambda);
  const Eigen::MatrixXd mixed = strains.first.transpose() * stress, quartic = strains.second.transpose() * stress;
  const auto slope = [&](Eigen::Index i, Eigen::Index j, Eigen::Index k) {
    return mixed(i, pair_of(j, k)) + mixed(j, pair_of(i, k)) + mixed(k, pair_of(i, j));
  };
  const auto curvature = [&](Eigen::Index i, Eigen::Index j, Eigen::Index k, Eigen::Index l) {
    return quartic(pair_of(i, j), pair_of(k, l)) + quartic(pair_of(i, k), pair_of(j, l)) +
           quartic(pair_of(i, l), pair_of(j, k));
  };
  const Eigen::Index triples = modes_ * (modes_ + 1) * (modes_ + 2) / 6;
  numbers_ = AlignedArray(triples * (modes_ + 1));
  rounded_ = AlignedArray(triples * (modes_ / 2 + 1));
  double* numbers = numbers_.data();
  auto* pairs = reinterpret_cast<float*>(rounded_.data());
  for_blocks(modes_, [&](Eigen::Index i, const std::vector<Pair>& block) {
    const auto size = static_cast<Eigen::Index>(block.size());
    for (Eigen::Index t = 0; t < size; ++t) {
      const auto [j, k] = block[static_cast<std::size_t>(t)];
      for (Eigen::Index n = 0; n <= modes_; ++n) {
        const double number = n == 0 ? slope(i, j, k) : 0.5 * curvature(i, j, k, n - 1);
        numbers[n * size + t] = number;
        pairs[2 * (n / 2 * size + t) + n % 2] = static_cast<float>(number);
      }
    }
    numbers += (modes_ + 1) * size;
    pairs += 2 * (modes_ / 2 + 1) * size;
  });
  for (Eigen::Index i = 0; i < modes_; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) constant_[lane_entry(i, j) / kLanes] = linear(i, j);
}

void StiffnessPolynomial::evaluate_lanes(const double* q, Precision precision, double* stiffness) const noexcept {
  const auto evaluate = precision == Precision::kMixed ? kernels().lanes_mixed_polynomial_stiffness
                                                       : kernels().lanes_polynomial_stiffness;
  evaluate(arrays(), q, stiffness);
}

StiffnessPolynomialArrays StiffnessPolynomial::arrays() const noexcept {
  return {modes_, constant_.data(), numbers_.data(), reinterpret_cast<const float*>(rounded_.data())};
}

/// Products with each m_ijk of i >= j >= k, and those of m with q.
double StiffnessPolynomial::flops(Eigen::Index modes) {
  const auto r = static_cast<double>(modes);
  return r * (r + 1) * (r + 2) / 3 * r + r * (r + 1) * r;
}

}  // namespace exmat::runtime

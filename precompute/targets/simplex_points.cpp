#include "precompute/targets/simplex_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

namespace exmat::precompute {
namespace {

/// Node `index` of the n + 1 Chebyshev-Lobatto nodes of [0, 1].
double chebyshev_node(int n, int index) {
  if (n == 0) return 0.5;
  const double sine = std::sin(0.5 * std::numbers::pi * index / n);
  return sine * sine;
}

/// Isaac 2020, equation 3: the mean of the nodes of each facet without one coordinate, weighted by the 1D nodes.
Eigen::RowVectorXd recursive_node(const Eigen::RowVectorXi& exponents) {
  const Eigen::Index count = exponents.size();
  const int degree = exponents.sum();
  if (count == 1) return Eigen::RowVectorXd::Ones(1);
  if (count == 2) return Eigen::RowVector2d(chebyshev_node(degree, exponents[0]), chebyshev_node(degree, exponents[1]));
  Eigen::RowVectorXd node = Eigen::RowVectorXd::Zero(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    Eigen::RowVectorXi facet(count - 1);
    facet << exponents.head(k), exponents.tail(count - 1 - k);
    const double weight = chebyshev_node(degree, degree - exponents[k]);
    const Eigen::RowVectorXd on_facet = recursive_node(facet);
    node.head(k) += weight * on_facet.head(k);
    node.tail(count - 1 - k) += weight * on_facet.tail(count - 1 - k);
  }
  return node / node.sum();
}

/// The root x > 1 of x^(d+1) = x + 1.
double generalised_golden_ratio(int d) {
  double root = 2;
  for (int round = 0; round < 60; ++round) root = std::pow(1 + root, 1.0 / (d + 1));
  return root;
}

/// Point n on the simplex of d + 1 coordinates: the gaps between d sorted numbers of [0, 1].
Eigen::RowVectorXd spread_point(int d, int n) {
  const double ratio = generalised_golden_ratio(d);
  std::vector<double> cuts{0, 1};
  for (int i = 1; i <= d; ++i) {
    const double position = 0.5 + (n + 1) * std::pow(ratio, -i);
    cuts.push_back(position - std::floor(position));
  }
  std::sort(cuts.begin(), cuts.end());
  Eigen::RowVectorXd gaps(d + 1);
  for (int i = 0; i <= d; ++i) gaps[i] = cuts[i + 1] - cuts[i];
  return gaps;
}

}  // namespace

RowMatrix interpolation_nodes(const IndexMatrix& exponents) {
  RowMatrix nodes(exponents.rows(), exponents.cols());
  for (Eigen::Index n = 0; n < nodes.rows(); ++n) nodes.row(n) = recursive_node(exponents.row(n));
  return nodes;
}

RowMatrix spread_points(Eigen::Index coordinates, int per_dimension) {
  RowMatrix points(0, coordinates);
  for (std::uint32_t members = 1; members < (1U << coordinates); ++members) {
    const int dimension = std::popcount(members) - 1;
    for (int n = 0; n < dimension * per_dimension; ++n) {
      const Eigen::RowVectorXd inside = spread_point(dimension, n);
      points.conservativeResize(points.rows() + 1, Eigen::NoChange);
      for (Eigen::Index k = 0, used = 0; k < coordinates; ++k)
        points(points.rows() - 1, k) = (members >> k & 1U) != 0 ? inside[used++] : 0;
    }
  }
  return points;
}

RowMatrix some_together(Eigen::Index coordinates, Eigen::Index together, int count, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  // Exponential shares are uniform on the simplex.
  const auto share = [&] { return -std::log((static_cast<double>(generator() % 1024) + 0.5) / 1024); };
  RowMatrix points = RowMatrix::Zero(count, coordinates);
  std::vector<std::size_t> order;
  for (std::size_t k = 1; k < static_cast<std::size_t>(coordinates); ++k) order.push_back(k);
  const std::size_t most = std::min(order.size(), static_cast<std::size_t>(together));
  for (auto row : points.rowwise()) {
    for (std::size_t i = 0; i < most; ++i) {
      std::swap(order[i], order[i + generator() % (order.size() - i)]);
      row[static_cast<Eigen::Index>(order[i])] = share();
    }
    if (row.sum() == 0 || generator() % 2 == 0) row[0] = share();
    row /= row.sum();
  }
  return points;
}

}  // namespace exmat::precompute

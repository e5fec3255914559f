#include "precompute/alignment/spectral_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "common/mesh/farthest_points.h"

namespace exmat::precompute {
namespace {

constexpr double kGap = 0.08;                // relative, within a cluster
constexpr Eigen::Index kShapeSamples = 300;  // vertices of each shape
constexpr std::size_t kBeam = 48;
constexpr Eigen::Index kLargestCluster = 3;

// A partial map, and the squared distances [samples x samples] of the embeddings under it.
struct Branch {
  std::vector<std::size_t> choices;
  Eigen::MatrixXf squared;
  double score = 0;
};

double two_way_score(const Eigen::MatrixXf& squared) {
  return static_cast<double>(squared.rowwise().minCoeff().mean() + squared.colwise().minCoeff().mean());
}

Eigen::MatrixXf embedding(const AlignedShape& shape, Eigen::Index count) {
  const auto samples = farthest_points(shape.basis.vertices, kShapeSamples);
  const Eigen::MatrixXd functions = shape.basis.eigenfunctions.leftCols(count)(samples, Eigen::all);
  return (functions * shape.basis.eigenvalues.head(count).cwiseSqrt().cwiseInverse().asDiagonal()).cast<float>();
}

Eigen::MatrixXf squared_distances(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b) {
  Eigen::MatrixXf squared = -2 * a * b.transpose();
  squared.colwise() += a.rowwise().squaredNorm();
  squared.rowwise() += b.rowwise().squaredNorm().transpose();
  return squared;
}

// The best of all continuations of the branches by the choices for one cluster.
std::vector<Branch> continue_branches(const std::vector<Branch>& branches, const Eigen::MatrixXf& a,
                                      const Eigen::MatrixXf& b, const std::vector<Eigen::MatrixXd>& choices) {
  std::vector<Eigen::MatrixXf> added;
  for (const auto& choice : choices) added.push_back(squared_distances(a * choice.cast<float>(), b));
  const auto count = static_cast<std::int64_t>(branches.size() * choices.size());
  std::vector<double> scores(static_cast<std::size_t>(count));
#pragma omp parallel for schedule(static)
  for (std::int64_t k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    scores[at] = two_way_score(branches[at / choices.size()].squared + added[at % choices.size()]);
  }
  std::vector<std::size_t> order(scores.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t x, std::size_t y) { return scores[x] < scores[y]; });
  order.resize(std::min(order.size(), kBeam));
  std::vector<Branch> next;
  for (const std::size_t k : order) {
    const Branch& parent = branches[k / choices.size()];
    next.push_back({parent.choices, parent.squared + added[k % choices.size()], scores[k]});
    next.back().choices.push_back(k % choices.size());
  }
  return next;
}

}  // namespace

std::vector<Cluster> common_clusters(const Eigen::VectorXd& a, const Eigen::VectorXd& b, Eigen::Index count) {
  std::vector<Cluster> clusters;
  for (Eigen::Index k = 0; k < count; ++k) {
    const bool near = k > 0 && (a[k] - a[k - 1] < kGap * a[k] || b[k] - b[k - 1] < kGap * b[k]);
    if (near && clusters.back().size < kLargestCluster)
      ++clusters.back().size;
    else
      clusters.push_back({k, 1});
  }
  return clusters;
}

std::vector<Eigen::MatrixXd> cluster_choices(Eigen::Index size) {
  std::vector<Eigen::MatrixXd> choices;
  if (size == 1) {
    for (const double sign : {1.0, -1.0}) choices.emplace_back(Eigen::MatrixXd::Constant(1, 1, sign));
    return choices;
  }
  if (size == 2) {
    for (int step = 0; step < 8; ++step)
      for (const double reflection : {1.0, -1.0}) {
        const double angle = step * std::numbers::pi / 4;
        Eigen::Matrix2d choice;
        choice << std::cos(angle), -reflection * std::sin(angle), std::sin(angle), reflection * std::cos(angle);
        choices.emplace_back(choice);
      }
    return choices;
  }
  std::array<int, 3> order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::MatrixXd choice = Eigen::MatrixXd::Zero(3, 3);
      for (int k = 0; k < 3; ++k) choice(k, order[static_cast<std::size_t>(k)]) = (signs >> k & 1) != 0 ? -1 : 1;
      choices.push_back(std::move(choice));
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return choices;
}

std::vector<Eigen::MatrixXd> spectral_maps(const AlignedShape& a, const AlignedShape& b, Eigen::Index count,
                                           std::size_t kept) {
  const auto clusters = common_clusters(a.basis.eigenvalues, b.basis.eigenvalues, count);
  const Eigen::MatrixXf on_a = embedding(a, count), on_b = embedding(b, count);
  std::vector<Branch> branches{{{}, Eigen::MatrixXf::Zero(on_a.rows(), on_b.rows()), 0}};
  for (const Cluster& cluster : clusters)
    branches = continue_branches(branches, on_a.middleCols(cluster.first, cluster.size),
                                 on_b.middleCols(cluster.first, cluster.size), cluster_choices(cluster.size));
  std::vector<Eigen::MatrixXd> maps;
  for (const Branch& branch : branches) {
    if (maps.size() == kept) break;
    Eigen::MatrixXd map = Eigen::MatrixXd::Zero(count, count);
    for (std::size_t k = 0; k < clusters.size(); ++k)
      map.block(clusters[k].first, clusters[k].first, clusters[k].size, clusters[k].size) =
          cluster_choices(clusters[k].size)[branch.choices[k]];
    maps.push_back(std::move(map));
  }
  return maps;
}

}  // namespace exmat::precompute

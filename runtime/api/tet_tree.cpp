#include "runtime/api/tet_tree.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/mesh/geometry.h"

namespace exmat::runtime {
namespace {

constexpr std::size_t kLeafTets = 4;
constexpr double kRelativeRounding = 1e-12;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Of the origin from the simplex of N corners: from its plane where that meets the simplex, else from its faces.
template <int N>
double distance(const Eigen::Matrix<double, 3, N>& corners) {
  if constexpr (N == 1) {
    return corners.norm();
  } else {
    const Eigen::Matrix<double, 3, N - 1> edges = corners.template rightCols<N - 1>().colwise() - corners.col(0).eval();
    const Eigen::Matrix<double, N - 1, 1> foot =
        (edges.transpose() * edges).inverse() * (edges.transpose() * -corners.col(0));
    if (foot.minCoeff() >= 0 && foot.sum() <= 1) return N == 4 ? 0 : (corners.col(0) + edges * foot).norm();
    double least = kInfinity;
    for (int left_out = 0; left_out < N; ++left_out) {
      Eigen::Matrix<double, 3, N - 1> face;
      for (int i = 0; i < N - 1; ++i) face.col(i) = corners.col(i < left_out ? i : i + 1);
      least = std::min(least, distance<N - 1>(face));
    }
    return least;
  }
}

double distance_to_box(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper, const Eigen::Vector3d& point) {
  return (point - point.cwiseMax(lower).cwiseMin(upper)).norm();
}

}  // namespace

TetTree::TetTree(const TetMesh& mesh)
    : mesh_(mesh),
      rounding_(kRelativeRounding * bounding_box_diagonal(mesh.vertices)),
      order_(static_cast<std::size_t>(mesh.tet_count())) {
  std::iota(order_.begin(), order_.end(), Eigen::Index{0});
  nodes_.push_back(leaf(0, order_.size()));
  for (std::size_t node = 0; node < nodes_.size(); ++node) split(node);
}

TetTree::Node TetTree::leaf(std::size_t first, std::size_t last) const {
  Node node{Eigen::Vector3d::Constant(kInfinity), Eigen::Vector3d::Constant(-kInfinity), first, last, 0};
  for (std::size_t i = first; i < last; ++i) {
    const auto corners = tet_positions(mesh_, order_[i]);
    node.lower = node.lower.cwiseMin(corners.colwise().minCoeff().transpose());
    node.upper = node.upper.cwiseMax(corners.colwise().maxCoeff().transpose());
  }
  return node;
}

/// Halves a node that has too many tets, by their places along its longest edge.
void TetTree::split(std::size_t index) {
  const auto [lower, upper, first, last, children] = nodes_[index];
  if (last - first <= kLeafTets) return;
  Eigen::Index axis = 0;
  (upper - lower).maxCoeff(&axis);
  const std::size_t middle = first + (last - first) / 2;
  const auto tets = [this](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(tets(first), tets(middle), tets(last), [this, axis](Eigen::Index a, Eigen::Index b) {
    return tet_positions(mesh_, a).col(axis).sum() < tet_positions(mesh_, b).col(axis).sum();
  });
  nodes_[index].children = nodes_.size();
  nodes_.push_back(leaf(first, middle));
  nodes_.push_back(leaf(middle, last));
}

TetTree::Hit TetTree::nearest(const Eigen::Vector3d& point) const {
  Hit hit{order_.front(), kInfinity};
  search(0, point, hit);
  if (hit.distance < rounding_) hit.distance = 0;
  return hit;
}

void TetTree::search(std::size_t index, const Eigen::Vector3d& point, Hit& hit) const {
  const Node& node = nodes_[index];
  if (node.children == 0) {
    for (std::size_t i = node.first; i < node.last; ++i) {
      const double found = distance<4>(tet_positions(mesh_, order_[i]).transpose().colwise() - point);
      if (found < hit.distance) hit = {order_[i], found};
    }
    return;
  }
  std::size_t near = node.children, far = near + 1;
  double near_distance = distance_to_box(nodes_[near].lower, nodes_[near].upper, point);
  double far_distance = distance_to_box(nodes_[far].lower, nodes_[far].upper, point);
  if (far_distance < near_distance) {
    std::swap(near, far);
    std::swap(near_distance, far_distance);
  }
  if (near_distance < hit.distance) search(near, point, hit);
  if (far_distance < hit.distance) search(far, point, hit);
}

Eigen::Vector4d barycentric(const Eigen::Matrix<double, 4, 3>& corners, const Eigen::Vector3d& point) {
  const Eigen::Matrix3d edges = (corners.bottomRows<3>().rowwise() - corners.row(0)).transpose();
  const Eigen::Vector3d others = edges.partialPivLu().solve(point - corners.row(0).transpose());
  return {1 - others.sum(), others[0], others[1], others[2]};
}

}  // namespace exmat::runtime

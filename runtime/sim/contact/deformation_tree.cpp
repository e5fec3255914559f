#include "runtime/sim/contact/deformation_tree.h"

#include <cmath>
#include <numeric>

#include "common/core/decompositions.h"

namespace exmat::runtime {
namespace {

using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;

/// Largest singular value of each 3 x r block less `mean`.
double largest_norm(const RowMatrix& basis, const std::vector<int>& points, const Rows& mean) {
  double largest = 0;
  for (const int point : points) {
    const Rows rows = basis.middleRows<3>(3 * point) - mean;
    const Eigen::Matrix3d square = rows * rows.transpose();
    largest = std::max(largest, Eigen::JacobiSVD<Eigen::Matrix3d>(square).singularValues()[0]);
  }
  return std::sqrt(largest);
}

}  // namespace

struct DeformationTree::Points {
  const IndexMatrix& items;
  const VertexArray& rest;
  const RowMatrix& basis;
  int leaf_items;
  bool full_leaves;

  /// The points of some items; each once where items are points.
  std::vector<int> of(const std::vector<int>& order, int first, int last) const {
    std::vector<int> points;
    points.reserve(static_cast<std::size_t>((last - first) * items.cols()));
    for (int i = first; i < last; ++i)
      for (Eigen::Index c = 0; c < items.cols(); ++c) points.push_back(items(order[static_cast<std::size_t>(i)], c));
    if (items.cols() == 1) return points;
    std::ranges::sort(points);
    points.erase(std::unique(points.begin(), points.end()), points.end());
    return points;
  }
  Eigen::RowVector3d middle(int item) const {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    for (Eigen::Index c = 0; c < items.cols(); ++c) sum += rest.row(items(item, c));
    return sum / static_cast<double>(items.cols());
  }
};

DeformationTree::DeformationTree(const IndexMatrix& items, const VertexArray& rest, const RowMatrix& basis,
                                 int leaf_items, bool full_leaves)
    : order_(static_cast<std::size_t>(items.rows())) {
  if (order_.empty()) return;
  std::iota(order_.begin(), order_.end(), 0);
  const Points points{items, rest, basis, leaf_items, full_leaves};
  build(points, 0, static_cast<int>(order_.size()));
  const std::vector<int> all = points.of(order_, 0, static_cast<int>(order_.size()));
  movement_ = {largest_norm(basis, all, Rows::Zero(3, basis.cols())), Eigen::RowVectorXd::Zero(basis.cols())};
  for (const int id : all) movement_.modes = movement_.modes.cwiseMax(basis.middleRows<3>(3 * id).colwise().norm());
}

void DeformationTree::build(const Points& points, int first, int last) {
  const std::size_t at = nodes_.size();
  nodes_.emplace_back();
  nodes_[at].first = first;
  nodes_[at].last = last;
  nodes_[at].is_leaf = last - first <= points.leaf_items;
  set_bounds(points, nodes_[at]);
  if (!nodes_[at].is_leaf) {
    VertexArray middles(last - first, 3);
    for (int i = first; i < last; ++i) middles.row(i - first) = points.middle(order_[static_cast<std::size_t>(i)]);
    Eigen::Index axis = 0;
    (middles.colwise().maxCoeff() - middles.colwise().minCoeff()).maxCoeff(&axis);
    int half = first + (last - first) / 2;
    if (points.full_leaves) half += (points.leaf_items - (half - first) % points.leaf_items) % points.leaf_items;
    // All in one order: what nth_element leaves of it is another with each standard library.
    std::sort(order_.begin() + first, order_.begin() + last, [&](int a, int b) {
      const double at_a = points.middle(a)[axis], at_b = points.middle(b)[axis];
      return at_a != at_b ? at_a < at_b : a < b;
    });
    build(points, first, half);
    build(points, half, last);
  }
  nodes_[at].next = static_cast<int>(nodes_.size());
}

void DeformationTree::set_bounds(const Points& points, Node& node) {
  const RowMatrix& basis = points.basis;
  const std::vector<int> ids = points.of(order_, node.first, node.last);
  const VertexArray places = points.rest(ids, Eigen::all);
  node.centre = 0.5 * (places.colwise().maxCoeff() + places.colwise().minCoeff()).transpose();
  node.radius = (places.rowwise() - node.centre.transpose()).rowwise().norm().maxCoeff();
  Rows mean = Rows::Zero(3, basis.cols());
  for (const int id : ids) mean += basis.middleRows<3>(3 * id) / static_cast<double>(ids.size());
  Eigen::RowVectorXd deviation = Eigen::RowVectorXd::Zero(basis.cols());
  for (const int id : ids) deviation = deviation.cwiseMax((basis.middleRows<3>(3 * id) - mean).colwise().norm());
  node.deviation_norm = largest_norm(basis, ids, mean);
  const Eigen::Index index = deviations_.rows();
  means_.conservativeResize(3 * (index + 1), basis.cols());
  means_.bottomRows<3>() = mean;
  deviations_.conservativeResize(index + 1, basis.cols());
  deviations_.bottomRows<1>() = deviation;
}

}  // namespace exmat::runtime

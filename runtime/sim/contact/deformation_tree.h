#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/sim/contact/movement_bound.h"

namespace exmat::runtime {

/// A bounded deformation tree (James and Pai 2004) over the points or triangles of a reduced body: where each branch
/// may be, by r numbers and without its points. Depth first; frame of the body. r modes.
class DeformationTree {
 public:
  /// A branch: its items lie in the ball about centre + mean q of radius + min(deviation . |q|, deviation_norm |q|).
  struct Node {
    int first = 0, last = 0;  ///< items
    int next = 0;             ///< node after the whole branch
    bool is_leaf = false;
    double radius = 0, deviation_norm = 0;             ///< [m], [kg^-1/2]
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< at rest [m]
  };
  struct Ball {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< [m]
    double radius = 0;                                 ///< [m]
  };

  DeformationTree() = default;
  /// `items` [m x c] are rows of c ids of points at `rest` [n x 3] about the frame's origin, moved by `basis` [3n x r];
  /// leaves hold at most so many, or, with `full_leaves`, all but one as many.
  DeformationTree(const IndexMatrix& items, const VertexArray& rest, const RowMatrix& basis, int leaf_items,
                  bool full_leaves = false);

  /// Items in the order of the leaves: rows of the matrix that the tree was made of.
  const std::vector<int>& order() const noexcept { return order_; }
  const std::vector<Node>& nodes() const noexcept { return nodes_; }
  const Node& node(int index) const noexcept { return nodes_[static_cast<std::size_t>(index)]; }
  bool empty() const noexcept { return nodes_.empty(); }

  /// Around a branch at q [r].
  Ball ball(int node, const Eigen::VectorXd& q, double q_norm) const noexcept {
    const Node& branch = this->node(node);
    const double spread = std::min(deviations_.row(node).dot(q.cwiseAbs()), branch.deviation_norm * q_norm);
    return {branch.centre + means_.middleRows<3>(3 * node).lazyProduct(q), branch.radius + spread};
  }

  const MovementBound& movement() const noexcept { return movement_; }  ///< of its points

 private:
  struct Points;
  void build(const Points& points, int first, int last);
  void set_bounds(const Points& points, Node& node);

  std::vector<int> order_;
  std::vector<Node> nodes_;
  RowMatrix means_;       // 3 nodes x r
  RowMatrix deviations_;  // nodes x r
  MovementBound movement_;
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
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
    return {branch.centre + means_.middleRows<3>(3 * static_cast<Eigen::Index>(node)).lazyProduct(q),
            branch.radius + spread};
  }

  const MovementBound& movement() const noexcept { return movement_; }  ///< bound for its points

  /// The same branches about points that stand wherever they do and move at no more than `fastest` [m/s]: from now on
  /// of one mode, the way that they go, at q = 0. `extend(i, box)` extends a box by the i-th item in the order of the
  /// leaves. Allocates in its first call.
  template <class Extend>
  void fit(double fastest, const Extend& extend) {
    boxes_.resize(nodes_.size());
    if (means_.cols() != 1) {
      means_.setZero(3 * std::ssize(nodes_), 1);
      deviations_.setZero(std::ssize(nodes_), 1);
      for (Node& node : nodes_) node.deviation_norm = 0;
      movement_.modes.resize(1);
    }
    movement_.norm = fastest;
    movement_.modes[0] = fastest;
    for (std::size_t at = nodes_.size(); at-- > 0;) {
      Node& node = nodes_[at];
      Eigen::AlignedBox3d& box = boxes_[at];
      if (node.is_leaf) {
        box.setEmpty();
        for (int i = node.first; i < node.last; ++i) extend(i, box);
      } else {
        box = boxes_[at + 1].merged(boxes_[static_cast<std::size_t>(nodes_[at + 1].next)]);
      }
      node.centre = box.center();
      node.radius = 0.5 * box.diagonal().norm();
    }
  }

 private:
  struct Points;
  void build(const Points& points, int first, int last);
  void set_bounds(const Points& points, Node& node);

  std::vector<int> order_;
  std::vector<Node> nodes_;
  RowMatrix means_;       // 3 nodes x r
  RowMatrix deviations_;  // nodes x r
  MovementBound movement_;
  std::vector<Eigen::AlignedBox3d> boxes_;  // of the nodes, of fit()
};

}  // namespace exmat::runtime

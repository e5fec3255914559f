#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/mesh/tet_mesh.h"

namespace exmat::runtime {

/// Finds the tet of a mesh that holds a point, or the nearest one: boxes in a binary tree.
class TetTree {
 public:
  /// `mesh` has tets and outlives the tree.
  explicit TetTree(const TetMesh& mesh);

  struct Hit {
    Eigen::Index tet = 0;
    double distance = 0;  ///< of the point to the tet, 0 inside [m]
  };
  Hit nearest(const Eigen::Vector3d& point) const;

 private:
  struct Node {
    Eigen::Vector3d lower, upper;
    std::size_t first = 0, last = 0;  ///< of order_; a leaf where there are no children
    std::size_t children = 0;         ///< the first of two, next to each other; 0: a leaf
  };
  Node leaf(std::size_t first, std::size_t last) const;
  void split(std::size_t index);
  void search(std::size_t node, const Eigen::Vector3d& point, Hit& hit) const;

  const TetMesh& mesh_;
  double rounding_ = 0;  ///< distances below are 0 [m]
  std::vector<Eigen::Index> order_;
  std::vector<Node> nodes_;
};

/// Barycentric coordinates of a point in a tet with the given [4 x 3] corners; they add up to 1.
Eigen::Vector4d barycentric(const Eigen::Matrix<double, 4, 3>& corners, const Eigen::Vector3d& point);

}  // namespace exmat::runtime

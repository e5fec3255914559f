#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <unsupported/Eigen/BVH>

#include "common/mesh/tet_mesh.h"

namespace exmat {

/// A point of a tet mesh in barycentric coordinates.
struct NearestPoint {
  Eigen::Index tet = 0;
  Eigen::Vector4d weights = Eigen::Vector4d::Zero();  ///< one for each corner of the tet, >= 0, sum 1
  double distance = 0;                                ///< from the point that was asked for; 0 inside [m]
};

/// Finds the nearest point of a tet mesh: a tree of boxes. Ties on shared faces go to the lowest tet. Immutable.
class NearestPointSearch {
 public:
  /// `mesh` has tets, none of volume 0, and outlives the search.
  explicit NearestPointSearch(const TetMesh& mesh);

  NearestPoint nearest(const Eigen::Vector3d& point) const;

 private:
  using Tree = Eigen::KdBVH<double, 3, int>;
  static Tree tree_of(const TetMesh& mesh);

  const TetMesh& mesh_;
  Tree tree_;
};

/// Points of a tet mesh in barycentric coordinates.
struct BarycentricPoints {
  IndexVector tets;                                  ///< k
  Eigen::Matrix<double, Eigen::Dynamic, 4> weights;  ///< k x 4, >= 0, rows sum to 1
  Eigen::VectorXd distances;                         ///< k, from the queried points [m]

  /// [k x n] matrix that interpolates piecewise linear fields given on the vertices of the mesh.
  Eigen::SparseMatrix<double, Eigen::RowMajor> interpolation(const TetMesh& mesh) const;
};

/// The nearest point of the body for each of [k x 3] points; those inside it are their own.
BarycentricPoints nearest_points(const TetMesh& mesh, const VertexArray& points);

}  // namespace exmat

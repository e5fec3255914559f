#pragma once

#include "common/mesh/tet_mesh.h"
#include "precompute/alignment/kd_tree.h"

namespace exmat::precompute {

/// A point on a triangle of a surface.
struct SurfacePoint {
  Eigen::Index triangle = 0;
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< barycentric, >= 0, of sum 1
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// Centres, normals and areas of the triangles of a surface.
struct TriangleSamples {
  VertexArray centres;    ///< n_f x 3
  VertexArray normals;    ///< n_f x 3, unit, outward; zero for a triangle without area
  Eigen::VectorXd areas;  ///< n_f
};
TriangleSamples triangle_samples(const VertexArray& vertices, const TriangleArray& triangles);

/// The point of a triangle [3 x 3, a corner a row] nearest to a point. Ericson 2005, section 5.1.5.
SurfacePoint nearest_on_triangle(const Eigen::Matrix3d& corners, const Eigen::Vector3d& point);

/// Nearest points of a surface.
class SurfaceTree {
 public:
  SurfaceTree(VertexArray vertices, TriangleArray triangles);

  /// The nearest point of all, exact.
  SurfacePoint nearest(const Eigen::Vector3d& point) const;

  /// The nearest point on a side that faces as `normal` does: least |y - p|^2 + kNormalWeight^2 |n_y - n|^2, over the
  /// triangles whose centres are nearest in that metric. Keeps thin parts and folds from being matched with their far
  /// side.
  SurfacePoint nearest_facing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const;

  /// The surface turned, or mirrored.
  SurfaceTree rotated(const Eigen::Matrix3d& rotation) const { return {vertices_ * rotation.transpose(), triangles_}; }

  const TriangleSamples& samples() const { return samples_; }
  const TriangleArray& triangles() const { return triangles_; }

  /// Length that a unit of difference between normals counts as, in the unit of the positions (body of volume 1).
  static constexpr double kNormalWeight = 0.25;

 private:
  SurfacePoint nearest_on(Eigen::Index triangle, const Eigen::Vector3d& point) const;

  VertexArray vertices_;
  TriangleArray triangles_;
  TriangleSamples samples_;
  double largest_radius_ = 0;  // of a triangle about its centre
  KdTree centres_;
  KdTree centres_and_normals_;
};

/// Share of a surface's area that is farther than `distance` from another.
double uncovered_share(const SurfaceTree& surface, const SurfaceTree& other, double distance);

/// Mean squared distance of samples of each surface from the other, in both directions: their two-way Chamfer distance.
double two_way_chamfer(const SurfaceTree& a, const SurfaceTree& b);

}  // namespace exmat::precompute

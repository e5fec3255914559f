#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/sim/contact/nearest_on_triangle.h"
#include "runtime/sim/contact/ray.h"
#include "runtime/sim/contact/surface_point.h"

namespace exmat::runtime {

/// Signed distances to a rigid mesh of triangles, exact, by a tree of boxes. Without a thickness the mesh is closed
/// (surface_faults() finds nothing), its triangles look away from the solid, and angle-weighted normals tell the sides
/// apart (Baerentzen and Aanaes 2005). With a thickness, solid is what is nearer to any triangle than half of it, on
/// both sides: the mesh may be open. No call but the constructor allocates.
class RigidMesh {
 public:
  /// `vertices` [k x 3] [m], welded `triangles` [f x 3], f > 0, and a thickness >= 0 [m].
  RigidMesh(const VertexArray& vertices, const TriangleArray& triangles, double thickness);

  Eigen::Index triangles() const noexcept { return static_cast<Eigen::Index>(faces_.size()); }
  double thickness() const noexcept { return thickness_; }
  /// Corners of a triangle, 0 <= triangle < triangles(), in an order of its own.
  const std::array<Eigen::Vector3d, 3>& corners(Eigen::Index triangle) const noexcept {
    return faces_[static_cast<std::size_t>(triangle)].corners;
  }

  /// Largest distance of a point inside from the surface, to some percent of the size [m].
  double deepest() const noexcept { return deepest_; }

  SurfacePoint nearest(const Eigen::Vector3d& point) const noexcept;
  /// The same, at once where the hint of a point nearby holds.
  SurfacePoint nearest(const Eigen::Vector3d& point, NearestHint& hint) const noexcept;

  /// False only where the signed distance is above `radius`.
  bool may_be_within(const Eigen::Vector3d& point, double radius) const noexcept;

  /// Distance within `most` at which a ray that begins outside enters the solid [m].
  std::optional<double> entry(const Ray& ray, double most) const noexcept;

 private:
  struct Face {
    std::array<Eigen::Vector3d, 3> corners;
    Eigen::Vector3d normal;                          // unit; 0 without area
    std::array<Eigen::Vector3d, 3> edges, vertices;  // pseudo-normals, of the edge that begins at a corner
  };
  struct Box {
    Eigen::Vector3d low, high;
    double squared_distance(const Eigen::Vector3d& point) const noexcept {
      return (low - point).cwiseMax(point - high).cwiseMax(0).squaredNorm();
    }
  };
  struct Node {
    Box box;
    int first = 0, last = 0;  // faces
    int right = 0;            // node; 0: a leaf
  };
  struct Found {
    int face = -1;
    TrianglePoint on;
    double second = 0;  // squared distance of the second nearest
  };

  void build(const std::vector<Box>& boxes, std::vector<int>& order, int first, int last);
  void set_normals(const VertexArray& vertices, const TriangleArray& triangles, const std::vector<int>& order);
  void sample_cells();
  TrianglePoint nearest_on(int face, const Eigen::Vector3d& point) const noexcept;
  std::optional<double> entry_of(const Face& face, const Ray& ray) const noexcept;
  enum class Search { kNearest, kTwoNearest, kAny };
  template <Search kSearch>
  Found search(const Eigen::Vector3d& point, double reach) const noexcept;
  SurfacePoint surface_of(const Eigen::Vector3d& point, const Found& found) const noexcept;

  double thickness_ = 0;
  double deepest_ = 0;
  bool is_room_ = false;     // solid is what is around it
  double size_ = 0;          // of the bounding box, its diagonal
  std::vector<Face> faces_;  // in order of the leaves
  std::vector<Node> nodes_;  // depth first: the left branch follows its parent
  // Signed distances of the middles of cells, for bounds on those of points in them.
  Eigen::Vector3d cells_low_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i cell_counts_ = Eigen::Vector3i::Zero();
  double cell_ = 0;  // length of its edges
  std::vector<float> cell_distances_;
};

}  // namespace exmat::runtime

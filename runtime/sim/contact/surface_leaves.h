#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/contact/deformation_tree.h"

namespace exmat::runtime {

/// The leaves of a surface as they are.
struct PlacedLeaves {
  AlignedArray corners;             ///< corners of each leaf's triangles, as Kernels::triangle_distances() has them
  AlignedArray places, velocities;  ///< boxes of all leaves, as LeafBoxes has them
  AlignedArray scratch;             ///< space for one leaf
};

/// The leaves of a surface's tree, kLanes triangles each, one by one or all side by side: for many looks at the whole
/// surface boxes about all leaves cost less than branches that are opened one by one. A leaf is told by its first
/// triangle in the order of the tree.
class SurfaceLeaves {
 public:
  SurfaceLeaves() = default;
  /// Leaves of `tree`, whose items are the `triangles`, full ones of kLanes; vertices at `rest` [k x 3, m].
  SurfaceLeaves(const VertexArray& rest, const TriangleArray& triangles, const DeformationTree& tree);

  PlacedLeaves make_placed() const;

  const double* rest_corners(int first) const noexcept { return rest_corners_.data() + corners_begin(first); }
  static const double* corners(int first, const PlacedLeaves& placed) noexcept {
    return placed.corners.data() + corners_begin(first);
  }

  /// One of them with its vertices at `positions` [k x 3]: its corners, and the box about it.
  Eigen::AlignedBox3d place(int first, const VertexArray& positions, PlacedLeaves& placed) const noexcept;
  /// The box of the velocities [k x 3] of its vertices.
  Eigen::AlignedBox3d velocities(int first, const VertexArray& velocities, PlacedLeaves& placed) const noexcept;

  /// All of them: corners and boxes; with velocities, not null, their boxes, too.
  void place_all(const VertexArray& positions, const VertexArray* velocities, PlacedLeaves& placed) const noexcept;
  /// All of them: panel i holds leaves i kLanes and on.
  const std::vector<LeafPanel>& all() const noexcept { return all_; }
  /// Kernels::near_leaves(), after place_all(), with velocities where it `moves`.
  std::ptrdiff_t near(const PlacedLeaves& placed, bool moves, const LeafQuery& query, const LeafPanel* panels,
                      std::ptrdiff_t count, LeafPanel* kept) const noexcept;

 private:
  static constexpr Eigen::Index kCornerNumbers = 9 * kLanes;  // of a leaf
  static constexpr Eigen::Index corners_begin(int first) { return first / kLanes * kCornerNumbers; }
  Eigen::AlignedBox3d gather(int first, const VertexArray& points, double* corners) const noexcept;
  void set_boxes(const VertexArray& points, double* corners, Eigen::Index next, AlignedArray& boxes) const noexcept;

  Eigen::Index leaves_ = 0;
  std::vector<int> vertices_;  // leaves x 3 x kLanes
  AlignedArray rest_corners_, rest_boxes_;
  std::vector<LeafPanel> all_;
};

}  // namespace exmat::runtime

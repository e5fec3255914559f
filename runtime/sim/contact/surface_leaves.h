#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/contact/deformation_tree.h"

namespace exmat::runtime {

/// The leaves of a surface as they are: boxes as LeafBoxes has them.
struct PlacedLeaves {
  AlignedArray places, velocities;
  AlignedArray scratch;  ///< corners of a leaf
};

/// The leaves of a surface's tree, kLanes triangles each, side by side: for many looks at the whole surface, where
/// boxes about all leaves cost less than branches that are opened one by one.
class SurfaceLeaves {
 public:
  static constexpr Eigen::Index kCornerNumbers = 9 * kLanes;  ///< of a leaf, as Kernels::triangle_distances() has them

  SurfaceLeaves() = default;
  /// Of `tree`, whose items are the `triangles`, in full leaves of kLanes; vertices at `rest` [k x 3, m].
  SurfaceLeaves(const VertexArray& rest, const TriangleArray& triangles, const DeformationTree& tree);

  PlacedLeaves make_placed() const;
  /// With vertices at `positions` [k x 3]: boxes, and the corners of all leaves.
  void place(const VertexArray& positions, PlacedLeaves& placed, AlignedArray& corners) const noexcept;
  /// Boxes of the velocities of the vertices [k x 3].
  void set_velocities(const VertexArray& velocities, PlacedLeaves& placed) const noexcept;

  /// All of them: panel i holds leaves i kLanes and on.
  const std::vector<LeafPanel>& all() const noexcept { return all_; }
  /// Kernels::near_leaves().
  std::ptrdiff_t near(const PlacedLeaves& placed, bool moves, const LeafQuery& query, const LeafPanel* panels,
                      std::ptrdiff_t count, LeafPanel* kept) const noexcept;

 private:
  void set_boxes(const VertexArray& points, double* corners, Eigen::Index next, AlignedArray& boxes) const noexcept;

  Eigen::Index leaves_ = 0;
  std::vector<int> vertices_;  // leaves x 3 x kLanes
  AlignedArray rest_;
  std::vector<LeafPanel> all_;
};

}  // namespace exmat::runtime

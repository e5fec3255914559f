#include "runtime/sim/contact/surface_leaves.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

constexpr Eigen::Index kBoxNumbers = 6 * kLanes;     // of a panel
constexpr Eigen::Index kVertexNumbers = 3 * kLanes;  // of a leaf

}  // namespace

SurfaceLeaves::SurfaceLeaves(const VertexArray& rest, const TriangleArray& triangles, const DeformationTree& tree)
    : leaves_((triangles.rows() + kLanes - 1) / kLanes),
      vertices_(static_cast<std::size_t>(leaves_ * kVertexNumbers)),
      rest_corners_(leaves_ * kCornerNumbers),
      rest_boxes_(padded(leaves_) * 6) {
  for (Eigen::Index i = 0; i < leaves_ * kLanes; ++i) {  // of the last leaf the last triangle again
    const int triangle = tree.order()[static_cast<std::size_t>(std::min(i, triangles.rows() - 1))];
    for (int c = 0; c < 3; ++c)
      vertices_[static_cast<std::size_t>((i / kLanes * 3 + c) * kLanes + i % kLanes)] = triangles(triangle, c);
  }
  set_boxes(rest, rest_corners_.data(), kCornerNumbers, rest_boxes_);
  for (Eigen::Index leaf = 0; leaf < leaves_; leaf += kLanes) {
    const auto count = std::min<Eigen::Index>(kLanes, leaves_ - leaf);
    all_.push_back({static_cast<int>(leaf / kLanes), (1U << count) - 1U});
  }
}

PlacedLeaves SurfaceLeaves::make_placed() const {
  return {AlignedArray(rest_corners_.size()), AlignedArray(rest_boxes_.size()), AlignedArray(rest_boxes_.size()),
          AlignedArray(kCornerNumbers)};
}

Eigen::AlignedBox3d SurfaceLeaves::gather(int first, const VertexArray& points, double* corners) const noexcept {
  double box[kBoxNumbers];
  kernels().gather_triangles(points.data(), vertices_.data() + first / kLanes * kVertexNumbers, corners, box);
  return {Eigen::Vector3d(box[0], box[kLanes], box[2 * kLanes]),
          Eigen::Vector3d(box[3 * kLanes], box[4 * kLanes], box[5 * kLanes])};
}

Eigen::AlignedBox3d SurfaceLeaves::place(int first, const VertexArray& positions, PlacedLeaves& placed) const noexcept {
  return gather(first, positions, placed.corners.data() + corners_begin(first));
}

Eigen::AlignedBox3d SurfaceLeaves::velocities(int first, const VertexArray& velocities,
                                              PlacedLeaves& placed) const noexcept {
  return gather(first, velocities, placed.scratch.data());
}

void SurfaceLeaves::set_boxes(const VertexArray& points, double* corners, Eigen::Index next,
                              AlignedArray& boxes) const noexcept {
  for (Eigen::Index leaf = 0; leaf < leaves_; ++leaf, corners += next)
    kernels().gather_triangles(points.data(), vertices_.data() + leaf * kVertexNumbers, corners,
                               boxes.data() + leaf / kLanes * kBoxNumbers + leaf % kLanes);
}

void SurfaceLeaves::place_all(const VertexArray& positions, const VertexArray* velocities,
                              PlacedLeaves& placed) const noexcept {
  set_boxes(positions, placed.corners.data(), kCornerNumbers, placed.places);
  if (velocities != nullptr) set_boxes(*velocities, placed.scratch.data(), 0, placed.velocities);
}

std::ptrdiff_t SurfaceLeaves::near(const PlacedLeaves& placed, bool moves, const LeafQuery& query,
                                   const LeafPanel* panels, std::ptrdiff_t count, LeafPanel* kept) const noexcept {
  const LeafBoxes boxes{placed.places.data(), moves ? placed.velocities.data() : nullptr, rest_boxes_.data()};
  return kernels().near_leaves(boxes, query, panels, count, kept);
}

}  // namespace exmat::runtime

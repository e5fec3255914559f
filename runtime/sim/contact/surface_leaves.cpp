#include "runtime/sim/contact/surface_leaves.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

constexpr Eigen::Index kBoxNumbers = 6 * kLanes;  // of a panel

}  // namespace

SurfaceLeaves::SurfaceLeaves(const VertexArray& rest, const TriangleArray& triangles, const DeformationTree& tree)
    : leaves_((triangles.rows() + kLanes - 1) / kLanes), rest_(padded(leaves_) * 6) {
  vertices_.resize(static_cast<std::size_t>(leaves_ * 3 * kLanes));
  for (Eigen::Index i = 0; i < leaves_ * kLanes; ++i) {  // of the last leaf the last triangle again
    const int triangle = tree.order()[static_cast<std::size_t>(std::min(i, triangles.rows() - 1))];
    for (int c = 0; c < 3; ++c)
      vertices_[static_cast<std::size_t>((i / kLanes * 3 + c) * kLanes + i % kLanes)] = triangles(triangle, c);
  }
  AlignedArray corners(kCornerNumbers);
  set_boxes(rest, corners.data(), 0, rest_);
  for (Eigen::Index leaf = 0; leaf < leaves_; leaf += kLanes) {
    const auto count = std::min<Eigen::Index>(kLanes, leaves_ - leaf);
    all_.push_back({static_cast<int>(leaf / kLanes), (1U << count) - 1U});
  }
}

PlacedLeaves SurfaceLeaves::make_placed() const {
  return {AlignedArray(rest_.size()), AlignedArray(rest_.size()), AlignedArray(kCornerNumbers)};
}

void SurfaceLeaves::set_boxes(const VertexArray& points, double* corners, Eigen::Index next,
                              AlignedArray& boxes) const noexcept {
  for (Eigen::Index leaf = 0; leaf < leaves_; ++leaf, corners += next)
    kernels().gather_triangles(points.data(), vertices_.data() + leaf * 3 * kLanes, corners,
                               boxes.data() + leaf / kLanes * kBoxNumbers + leaf % kLanes);
}

void SurfaceLeaves::place(const VertexArray& positions, PlacedLeaves& placed, AlignedArray& corners) const noexcept {
  set_boxes(positions, corners.data(), kCornerNumbers, placed.places);
}

void SurfaceLeaves::set_velocities(const VertexArray& velocities, PlacedLeaves& placed) const noexcept {
  set_boxes(velocities, placed.scratch.data(), 0, placed.velocities);
}

std::ptrdiff_t SurfaceLeaves::near(const PlacedLeaves& placed, bool moves, const LeafQuery& query,
                                   const LeafPanel* panels, std::ptrdiff_t count, LeafPanel* kept) const noexcept {
  const LeafBoxes boxes{placed.places.data(), moves ? placed.velocities.data() : nullptr, rest_.data()};
  return kernels().near_leaves(boxes, query, panels, count, kept);
}

}  // namespace exmat::runtime

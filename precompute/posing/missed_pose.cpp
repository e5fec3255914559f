#include "precompute/posing/missed_pose.h"

#include <algorithm>
#include <fmt/format.h>
#include <vector>

#include "common/mesh/surface_check.h"

namespace exmat::precompute {
namespace {

// A pose may blow its body up. Edges of vertices in another order go across the body, many times their length.
constexpr double kOtherOrder = 3;
// A pose may squeeze its body, but turns no more of it inside out than where parts cross.
constexpr double kMirrored = -0.2;

double median_stretch(const SurfaceMesh& surface, const VertexArray& posed) {
  std::vector<double> stretches;
  for (const auto& corners : surface.triangles.rowwise())
    for (int k = 0; k < 3; ++k) {
      const std::int32_t from = corners[k], to = corners[(k + 1) % 3];
      const double length = (surface.vertices.row(to) - surface.vertices.row(from)).norm();
      if (length > 0) stretches.push_back((posed.row(to) - posed.row(from)).norm() / length);
    }
  const auto middle = stretches.begin() + std::ssize(stretches) / 2;
  std::nth_element(stretches.begin(), middle, stretches.end());
  return *middle;
}

// A pose may squeeze its body, but leaves it thick.
constexpr double kSqueezed = 0.01;

double volume_about_centre(const VertexArray& vertices, const TriangleArray& triangles) {
  return enclosed_volume(vertices.rowwise() - vertices.colwise().mean(), triangles);
}

}  // namespace

std::string fault_of_pose(const SurfaceMesh& surface, const VertexArray& posed) {
  const double thickness = least_extent(posed) / least_extent(surface.vertices);
  if (!is_flat(surface.vertices) && thickness < kSqueezed)
    return fmt::format(
        "it squeezes the body to {:.2g} times its thickness, as no elastic body can be; mend the pose, or its unit of "
        "length",
        thickness);
  const double volume = volume_about_centre(surface.vertices, surface.triangles);
  if (volume_about_centre(posed, surface.triangles) / volume < kMirrored)
    return "it is a mirror image of the object; export it without a negative scale";
  return "";
}

std::string reason_of_miss(const SurfaceMesh& surface, const VertexArray& posed, const SurfacePose& pose) {
  const double stretch = median_stretch(surface, posed);
  if (stretch > kOtherOrder)
    return fmt::format(
        "its edges are {:.2g} times as long as the object's, so its vertices are in another order; export both from "
        "one mesh",
        stretch);
  if (std::string fault = fault_of_pose(surface, posed); !fault.empty()) return fault;
  const Eigen::RowVector3d place = surface.vertices.row(pose.worst);
  return fmt::format(
      "worst at vertex {} at ({:.4g}, {:.4g}, {:.4g}): cells there are larger than what bends, or hold together what "
      "this pose takes apart; ask for more cells",
      pose.worst, place[0], place[1], place[2]);
}

}  // namespace exmat::precompute

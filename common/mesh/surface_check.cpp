#include "common/mesh/surface_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"

namespace exmat {
namespace {

std::string count_of(std::int64_t count, const char* what) {
  return std::to_string(count) + (count == 1 ? " edge " : " edges ") + what;
}

}  // namespace

std::string SurfaceFaults::words() const {
  std::string text;
  const auto add = [&](std::int64_t count, const char* what) {
    if (count > 0) text += (text.empty() ? "" : ", ") + count_of(count, what);
  };
  add(open, "of one triangle alone");
  add(turned, "whose two triangles look opposite ways");
  add(crowded, "of more than two triangles");
  if (text.empty()) return "a closed surface";
  return text + ", the first between vertices " + std::to_string(first[0]) + " and " + std::to_string(first[1]) +
         ", from 0";
}

SurfaceFaults surface_faults(const TriangleArray& triangles) {
  struct Uses {
    std::int64_t along = 0, against = 0;  // the direction from the lower vertex to the higher
    Eigen::Index triangle = 0;
  };
  std::map<std::array<std::int32_t, 2>, Uses> edges;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t from = triangles(t, c), to = triangles(t, (c + 1) % 3);
      Uses& uses = edges.try_emplace({std::min(from, to), std::max(from, to)}, Uses{0, 0, t}).first->second;
      ++(from < to ? uses.along : uses.against);
    }
  SurfaceFaults faults;
  Eigen::Index first = triangles.rows();
  for (const auto& [edge, uses] : edges) {
    if (uses.along == 1 && uses.against == 1) continue;
    const std::int64_t all = uses.along + uses.against;
    ++(all == 1 ? faults.open : all == 2 ? faults.turned : faults.crowded);
    if (uses.triangle >= first) continue;
    first = uses.triangle;
    faults.first = edge;
  }
  return faults;
}

void weld(const VertexArray& vertices, TriangleArray& triangles) {
  std::map<std::tuple<double, double, double>, std::int32_t> places;
  std::vector<std::int32_t> first(static_cast<std::size_t>(vertices.rows()));
  for (Eigen::Index v = 0; v < vertices.rows(); ++v)
    first[static_cast<std::size_t>(v)] =
        places.try_emplace({vertices(v, 0), vertices(v, 1), vertices(v, 2)}, static_cast<std::int32_t>(v))
            .first->second;
  Eigen::Index kept = 0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    std::array<std::int32_t, 3> corners{};
    for (int c = 0; c < 3; ++c) corners[static_cast<std::size_t>(c)] = first[static_cast<std::size_t>(triangles(t, c))];
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    triangles.row(kept++) << corners[0], corners[1], corners[2];
  }
  triangles.conservativeResize(kept, 3);
}

double enclosed_volume(const VertexArray& vertices, const TriangleArray& triangles) {
  if (triangles.rows() == 0) return 0;
  const Eigen::Vector3d about = vertices.row(triangles(0, 0));
  double sum = 0;
  for (const auto& triangle : triangles.rowwise()) {
    const auto corner = [&](int c) -> Eigen::Vector3d { return vertices.row(triangle[c]).transpose() - about; };
    sum += corner(0).dot(corner(1).cross(corner(2)));
  }
  return sum / 6;
}

double least_extent(const VertexArray& vertices) {
  const VertexArray own = vertices.rowwise() - vertices.colwise().mean();
  const Eigen::Matrix3d moments = own.transpose() * own / static_cast<double>(own.rows());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(axes.eigenvalues()[0], 0.0));
}

bool is_flat(const VertexArray& vertices) {
  constexpr double kFlat = 1e-6;
  return least_extent(vertices) <= kFlat * longest_box_edge(vertices);
}

}  // namespace exmat

#include "runtime/viewer/drawing/drawn_mesh.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace exmat::viewer {
namespace {

using Triangle = std::uint32_t;

Eigen::Vector3d point_of(std::span<const double> rest, std::int32_t id) {
  return Eigen::Map<const Eigen::Vector3d>(rest.data() + 3 * static_cast<std::ptrdiff_t>(id));
}

std::vector<Eigen::Vector3d> normals_of(std::span<const double> rest, std::span<const std::int32_t> triangles) {
  std::vector<Eigen::Vector3d> normals;
  for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) {
    const Eigen::Vector3d a = point_of(rest, triangles[i]);
    const Eigen::Vector3d normal = (point_of(rest, triangles[i + 1]) - a).cross(point_of(rest, triangles[i + 2]) - a);
    normals.push_back(normal.stableNormalized());
  }
  return normals;
}

/// The triangles at each point.
std::vector<std::vector<Triangle>> triangles_at(std::size_t points, std::span<const std::int32_t> triangles) {
  std::vector<std::vector<Triangle>> at(points);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    at[static_cast<std::size_t>(triangles[i])].push_back(static_cast<Triangle>(i / 3));
  return at;
}

bool share_edge(std::span<const std::int32_t> triangles, Triangle a, Triangle b) {
  int shared = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) shared += triangles[3 * a + i] == triangles[3 * b + j] ? 1 : 0;
  return shared >= 2;
}

/// Groups of the triangles at a point that go smoothly over into each other.
std::vector<std::vector<Triangle>> smooth_groups(std::vector<Triangle> at, std::span<const std::int32_t> triangles,
                                                 const std::vector<Eigen::Vector3d>& normals, double least_cosine) {
  std::vector<std::vector<Triangle>> groups;
  while (!at.empty()) {
    std::vector<Triangle>& group = groups.emplace_back(1, at.back());
    at.pop_back();
    for (std::size_t i = 0; i < group.size(); ++i)
      for (std::size_t j = at.size(); j-- > 0;)
        if (share_edge(triangles, group[i], at[j]) && normals[group[i]].dot(normals[at[j]]) > least_cosine) {
          group.push_back(at[j]);
          at.erase(at.begin() + static_cast<std::ptrdiff_t>(j));
        }
    std::ranges::sort(group);
  }
  return groups;
}

void add_edges(DrawnMesh& mesh) {
  std::vector<std::pair<std::uint64_t, std::pair<std::uint32_t, std::uint32_t>>> edges;
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    const std::uint32_t a = mesh.indices[i], b = mesh.indices[i % 3 == 2 ? i - 2 : i + 1];
    const std::uint64_t p = mesh.points[a], q = mesh.points[b];
    edges.push_back({std::min(p, q) << 32 | std::max(p, q), {a, b}});
  }
  std::ranges::sort(edges);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (i > 0 && edges[i].first == edges[i - 1].first) continue;
    mesh.edges.push_back(edges[i].second.first);
    mesh.edges.push_back(edges[i].second.second);
  }
}

}  // namespace

DrawnMesh make_drawn_mesh(std::span<const double> rest, std::span<const std::int32_t> triangles, double crease) {
  const std::vector<Eigen::Vector3d> normals = normals_of(rest, triangles);
  const std::vector<std::vector<Triangle>> at = triangles_at(rest.size() / 3, triangles);
  DrawnMesh mesh;
  mesh.indices.resize(triangles.size());
  mesh.starts.push_back(0);
  for (std::size_t point = 0; point < at.size(); ++point)
    for (const std::vector<Triangle>& group : smooth_groups(at[point], triangles, normals, std::cos(crease))) {
      const auto corner = static_cast<std::uint32_t>(mesh.points.size());
      mesh.points.push_back(static_cast<std::uint32_t>(point));
      for (const Triangle triangle : group) {
        mesh.around.push_back(triangle);
        for (std::size_t c = 0; c < 3; ++c)
          if (static_cast<std::size_t>(triangles[3 * triangle + c]) == point) mesh.indices[3 * triangle + c] = corner;
      }
      mesh.starts.push_back(static_cast<std::uint32_t>(mesh.around.size()));
    }
  add_edges(mesh);
  return mesh;
}

}  // namespace exmat::viewer

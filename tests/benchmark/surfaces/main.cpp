// Cages of a surface, and poses of cages by posed surfaces against the maps that made these. Prints the tables of
// docs/surfaces.md, and renews them where the page is named: exmat-surfaces-benchmark SURFACE.obj [PAGE.md]

#include <array>
#include <fmt/format.h>
#include <functional>
#include <iostream>
#include <numbers>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/timer.h"
#include "common/mesh/geometry.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/meshing/cage.h"
#include "precompute/posing/surface_pose.h"
#include "tests/support/pose_energy.h"
#include "tests/support/surfaces.h"
#include "tests/support/temporary_folder.h"

namespace exmat::benchmarks {
namespace {

using precompute::Cage;

// A map of space about the middle of a surface: along one axis, towards another.
struct Map {
  std::string name;
  std::function<VertexArray(VertexArray points, double length, int axis, int towards)> of;
};

VertexArray twisted(VertexArray x, double length, int axis, int towards) {
  const int third = 3 - axis - towards;
  for (auto point : x.rowwise()) {
    const double turn = std::numbers::pi * point[axis] / length, b = point[towards], c = point[third];
    point[towards] = std::cos(turn) * b - std::sin(turn) * c;
    point[third] = std::sin(turn) * b + std::cos(turn) * c;
  }
  return x;
}

VertexArray bent(VertexArray x, double length, int axis, int towards) {
  const double radius = length / (2 * std::numbers::pi / 3);
  for (auto point : x.rowwise()) {
    const double turn = point[axis] / radius, r = radius - point[towards];
    point[axis] = r * std::sin(turn);
    point[towards] = radius - r * std::cos(turn);
  }
  return x;
}

VertexArray squashed(VertexArray x, double, int axis, int) {
  x *= std::numbers::sqrt2;
  x.col(axis) *= 0.5 / std::numbers::sqrt2;
  return x;
}

const std::array<Map, 3> kMaps = {
    {{"twist by 180 degrees", twisted}, {"bend by 120 degrees", bent}, {"squash to half", squashed}}};

struct Body {
  std::string name;
  SurfaceMesh surface;
  int axis, towards;
};

SurfaceMesh centred(SurfaceMesh surface) {
  const Eigen::RowVector3d low = surface.vertices.colwise().minCoeff(), high = surface.vertices.colwise().maxCoeff();
  surface.vertices.rowwise() -= (low + high) / 2;
  return surface;
}

std::string cages_table(const SurfaceMesh& surface) {
  std::string text =
      "\n| asked for | tets | dihedral angles | volume over the surface's | farthest off | time |\n"
      "| ---: | ---: | --- | ---: | ---: | ---: |\n";
  const double diagonal = bounding_box_diagonal(surface.vertices);
  for (const int cells : {300, 600, 2000, 8000, 30000}) {
    const Timer timer;
    const Cage cage = precompute::make_cage(surface, {cells, {}}, "surface");
    text += fmt::format("| {} | {} | {:.1f} to {:.0f} | {:.2f} | {:.1f} % | {:.1f} s |\n", cells, cage.mesh.tet_count(),
                        cage.least_angle, cage.largest_angle, cage.volume_ratio.value_or(0),
                        100 * cage.farthest / diagonal, timer.seconds());
  }
  return text;
}

std::string poses_table(const std::vector<Body>& bodies) {
  std::string text =
      "\n| surface | pose | tets | missed (RMS) | missed (largest) | energy | iterations | time |\n"
      "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n";
  for (const Body& body : bodies)
    for (const int cells : {2000, 8000}) {
      const Cage cage = precompute::make_cage(body.surface, {cells, {}}, body.name);
      const auto embedding = precompute::embed_points(cage.mesh, body.surface.vertices, body.name);
      const double length =
          body.surface.vertices.col(body.axis).maxCoeff() - body.surface.vertices.col(body.axis).minCoeff();
      for (const Map& map : kMaps) {
        const auto mapped = [&](const VertexArray& points) { return map.of(points, length, body.axis, body.towards); };
        const Timer timer;
        const auto pose = precompute::pose_by_surface(cage.mesh, body.surface, embedding, mapped(body.surface.vertices),
                                                      cage.mesh.vertices, map.name);
        const double seconds = timer.seconds();
        if (tet_volumes({pose.positions, cage.mesh.tets}).minCoeff() <= 0)
          throw WorkError(body.name + ", " + map.name + ": tets inside out");
        text += fmt::format("| {} | {} | {} | {:.3f} | {:.2f} | {:.2f} | {} | {:.1f} s |\n", body.name, map.name,
                            cage.mesh.tet_count(), 100 * pose.rms, 100 * pose.farthest,
                            pose.energy / test::pose_energy(cage.mesh, mapped(cage.mesh.vertices)), pose.iterations,
                            seconds);
      }
    }
  return text;
}

void renew(const std::string& page_name, const std::string& part, const std::string& table) {
  const std::string page = test::read_file(page_name), begin = "<!-- " + part + ": begin -->",
                    end = "<!-- " + part + ": end -->";
  const auto from = page.find(begin), to = page.find(end);
  if (from == std::string::npos || to == std::string::npos) throw WorkError(page_name + ": no place for " + part);
  test::write_file(page_name, page.substr(0, from + begin.size()) + "\n" + table + page.substr(to));
}

int run(int argc, char** argv) {
  if (argc < 2) throw WorkError("usage: exmat-surfaces-benchmark SURFACE.obj [PAGE.md]");
  const SurfaceMesh teddy = centred(precompute::read_surface_file(argv[1]).mesh);
  const std::string cages = cages_table(teddy),
                    poses = poses_table(
                        {{"bar", centred(test::box_surface({40, 10, 10}, {4, 1, 1})), 0, 1}, {"teddy", teddy, 2, 1}});
  std::cout << cages << poses;
  if (argc < 3) return 0;
  renew(argv[2], "cages", cages);
  renew(argv[2], "poses", poses);
  return 0;
}

}  // namespace
}  // namespace exmat::benchmarks

int main(int argc, char** argv) {
  try {
    return exmat::benchmarks::run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}

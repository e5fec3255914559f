#include "precompute/meshing/cage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "common/core/disjoint_sets.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/checks.h"
#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"
#include "common/mesh/surface_check.h"
#include "precompute/alignment/surface_tree.h"
#include "precompute/meshing/mesher_module.h"

namespace exmat::precompute {
namespace {

// Gaps and hollows narrower than a cell are bridged; the cage stands off the surface by about a fifth of one.
constexpr double kAlpha = 1, kOffset = 0.2;
// Trials: to find the cell size of a number of tets; to get all of the surface inside and no flat tet.
constexpr int kSizeTrials = 6, kShapeTrials = 8;
// Cages that are made where the first has too many or too few tets.
constexpr int kCountRounds = 4;
// Tets grow as this power of the size, between those of a sheet and of a solid.
constexpr double kUsualPower = 2.5;
// Factor by which the cage stands off more at each trial.
constexpr double kFartherOff = 1.3;
// Rounds of drawing the cage out over vertices that stick out of it, and how much farther than they stick out.
constexpr int kDrawingRounds = 30;
constexpr double kDrawnFarther = 1.1;
// A number of tets is met by so much.
constexpr double kCountTolerance = 0.1;
// Cell sizes over the diagonal that are tried at most: one cell for all, ten million.
constexpr double kLargestSize = 0.5, kSmallestSize = 0.002;
// Twice the area of a triangle that has none, over the diagonal's square: rounding of corners on one line.
constexpr double kNoArea = 1e-14;
// A vertex is inside when it is no farther out, over the diagonal: rounding.
constexpr double kInside = 1e-9;
// Places at diagonal 1 are multiples of this (2^-40): a surface in another unit has the same ones, to the last bit.
constexpr double kGrid = 0x1p-40;

// The triangles that have an area, at diagonal 1 about the origin: any unit of length gives the same cage.
struct UnitSurface {
  SurfaceMesh mesh;  // vertices of triangles alone
  Eigen::RowVector3d centre;
  double diagonal = 0;
};

UnitSurface unit_surface(const SurfaceMesh& surface, const std::string& name) {
  require_extent(surface.vertices, name);
  UnitSurface unit;
  const Eigen::RowVector3d low = surface.vertices.colwise().minCoeff(), high = surface.vertices.colwise().maxCoeff();
  unit.centre = (low + high) / 2;
  unit.diagonal = (high - low).norm();
  const auto refuse = [&](const std::string& found) {
    throw InputError({name, "", "a surface: triangles that have an area", found, ""});
  };
  std::vector<std::int32_t> number(static_cast<std::size_t>(surface.vertices.rows()), -1), kept;
  std::vector<Eigen::RowVector3i> triangles;
  for (const auto& corners : surface.triangles.rowwise()) {
    const Eigen::RowVector3d a = surface.vertices.row(corners[0]), b = surface.vertices.row(corners[1]),
                             c = surface.vertices.row(corners[2]);
    if (((b - a) / unit.diagonal).cross((c - a) / unit.diagonal).norm() <= kNoArea) continue;
    Eigen::RowVector3i& triangle = triangles.emplace_back();
    for (int corner = 0; corner < 3; ++corner) {
      std::int32_t& found = number[static_cast<std::size_t>(corners[corner])];
      if (found < 0) {
        found = static_cast<std::int32_t>(kept.size());
        kept.push_back(corners[corner]);
      }
      triangle[corner] = found;
    }
  }
  if (triangles.empty()) refuse(fmt::format("{} triangles without any", surface.triangles.rows()));
  const VertexArray places = (surface.vertices(kept, Eigen::all).rowwise() - unit.centre) / unit.diagonal;
  unit.mesh.vertices = (places / kGrid).array().round() * kGrid;
  unit.mesh.triangles.resize(std::ssize(triangles), 3);
  for (Eigen::Index t = 0; t < unit.mesh.triangles.rows(); ++t)
    unit.mesh.triangles.row(t) = triangles[static_cast<std::size_t>(t)];
  return unit;
}

std::pair<double, double> dihedral_angles(const TetMesh& mesh) {
  constexpr std::array<std::array<int, 4>, 6> kEdges = {
      {{0, 1, 2, 3}, {0, 2, 1, 3}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 0, 2}, {2, 3, 0, 1}}};
  double least = std::numbers::pi, largest = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Eigen::Matrix<double, 4, 3> x = tet_positions(mesh, t);
    for (const auto& [a, b, c, d] : kEdges) {
      const Eigen::RowVector3d edge = x.row(b) - x.row(a);
      const Eigen::RowVector3d first = edge.cross(x.row(c) - x.row(a)), second = edge.cross(x.row(d) - x.row(a));
      const double angle = std::atan2(first.cross(second).norm(), first.dot(second));
      least = std::min(least, angle);
      largest = std::max(largest, angle);
    }
  }
  return {least * 180 / std::numbers::pi, largest * 180 / std::numbers::pi};
}

// All triangles hang together by vertices, or by places where several lie.
bool is_connected(const SurfaceMesh& surface) {
  TriangleArray triangles = surface.triangles;
  weld(surface.vertices, triangles);
  DisjointSets parts(static_cast<std::size_t>(surface.vertices.rows()));
  for (const auto& corners : triangles.rowwise())
    for (const int corner : {1, 2}) parts.join(corners[0], corners[corner]);
  return std::ranges::all_of(triangles.rowwise(), [&, first = parts.root(triangles(0, 0))](const auto& corners) {
    return parts.root(corners[0]) == first;
  });
}

// Every edge has a triangle on either side.
bool is_closed(const TriangleArray& triangles) {
  std::map<std::pair<std::int32_t, std::int32_t>, int> balance;
  for (const auto& corners : triangles.rowwise())
    for (int k = 0; k < 3; ++k) {
      const std::int32_t from = corners[k], to = corners[(k + 1) % 3];
      balance[std::minmax(from, to)] += from < to ? 1 : -1;
    }
  return std::ranges::all_of(balance, [](const auto& edge) { return edge.second == 0; });
}

class CageMaker {
 public:
  CageMaker(const UnitSurface& surface, const std::string& name)
      : surface_(surface), name_(name), connected_(is_connected(surface.mesh)) {}

  /// About so many tets; `size` becomes that of their cells.
  TetMesh of_count(int cells, double& size) const;
  /// `offset`, over the size, is that of the first trial and becomes that of the cage.
  TetMesh shape(double size, double& offset) const;

 private:
  double size_for(int cells) const;
  TetMesh tets(double size, double offset, unsigned seed, bool improve) const;
  bool draw_out(TetMesh& mesh) const;
  std::string fault_of(TetMesh& mesh) const;

  const UnitSurface& surface_;
  const std::string& name_;
  bool connected_;
};

TetMesh CageMaker::tets(double size, double offset, unsigned seed, bool improve) const {
  TetMesh mesh;
  std::string failure;
  mesher_module().make_tets(
      {surface_.mesh.vertices, surface_.mesh.triangles, kAlpha * size, offset * size, size, seed, improve}, mesh,
      failure);
  if (!failure.empty()) throw WorkError(fmt::format("{}: the mesher failed: {}", name_, failure));
  if (mesh.tet_count() == 0) throw WorkError(fmt::format("{}: the mesher found nothing to fill", name_));
  return mesh;
}

// Keeps few digits: the last ones of roots and powers differ between machines, and a mesh follows from every bit.
double tried_size(double size) { return std::round(std::clamp(size, kSmallestSize, kLargestSize) * 1e5) / 1e5; }

// The number of tets grows as a power of the cell size between 2 (sheets) and 3 (solids), and more where fine cells
// reach what coarse ones bridge: a secant in logarithms.
double CageMaker::size_for(int cells) const {
  double size = tried_size(std::cbrt(0.5 / cells));
  double best = size, best_miss = INFINITY, power = kUsualPower;
  double last_size = 0, last_count = 0;
  for (int trial = 0; trial < kSizeTrials; ++trial) {
    const auto count = static_cast<double>(tets(size, kOffset, 0, false).tet_count());
    log::debug(fmt::format("{}: {} tets for cells of {} of the diagonal", name_, count, size));
    const double miss = std::abs(std::log(count / cells));
    if (miss < best_miss) std::tie(best, best_miss) = std::pair(size, miss);
    if (miss <= kCountTolerance) break;
    if (last_size > 0 && std::abs(std::log(size / last_size)) > 1e-3)
      power = std::clamp(-std::log(count / last_count) / std::log(size / last_size), 1.5, 4.0);
    last_size = size;
    last_count = count;
    size = tried_size(size * std::pow(count / cells, 1 / power));
    if (size == last_size) break;
  }
  return best;
}

// Moves outer vertices of the tets outwards until no vertex of the surface is outside; false where some still are.
bool CageMaker::draw_out(TetMesh& mesh) const {
  for (int round = 0; round < kDrawingRounds; ++round) {
    const BarycentricPoints points = nearest_points(mesh, surface_.mesh.vertices);
    if (points.distances.maxCoeff() <= kInside) return true;
    VertexArray push = VertexArray::Zero(mesh.vertex_count(), 3);
    for (Eigen::Index k = 0; k < points.tets.size(); ++k) {
      if (points.distances[k] <= kInside) continue;
      const Eigen::RowVector4d weights = points.weights.row(k);
      const Eigen::RowVector3d missing = surface_.mesh.vertices.row(k) - weights * tet_positions(mesh, points.tets[k]);
      for (int corner = 0; corner < 4; ++corner) {
        const Eigen::RowVector3d move = kDrawnFarther * weights[corner] / weights.squaredNorm() * missing;
        auto pushed = push.row(mesh.tets(points.tets[k], corner));
        if (move.norm() > pushed.norm()) pushed = move;
      }
    }
    mesh.vertices += push;
  }
  return false;
}

// Draws the mesh out over the surface, and says what keeps it from being a cage, if anything does.
std::string CageMaker::fault_of(TetMesh& mesh) const {
  if (!draw_out(mesh)) return "vertices of the surface outside";
  const double angle = tet_volumes(mesh).minCoeff() > 0 ? dihedral_angles(mesh).first : 0;
  if (angle < kLeastDihedralAngle) return fmt::format("a dihedral angle of {:.1f} degrees", angle);
  if (!connected_) return "";
  TetMesh copy = mesh;
  const bool falls_apart = check_mesh(copy, name_, {.drop_smaller_components = true}).dropped_components > 0;
  return falls_apart ? "several components" : "";
}

TetMesh CageMaker::shape(double size, double& offset) const {
  std::string why;
  for (int trial = 0; trial < kShapeTrials; ++trial) {
    TetMesh mesh = tets(size, offset, static_cast<unsigned>(trial), true);
    why = fault_of(mesh);
    if (why.empty()) return mesh;
    offset *= kFartherOff;
    log::debug(fmt::format("{}: cage {} has {}; another trial", name_, trial + 1, why));
  }
  throw WorkError(
      fmt::format("{}: no cage without {} in {} trials; ask for another number of cells", name_, why, kShapeTrials));
}

// A cage that has to stand farther off the surface than the trials of size_for() has fewer tets than these.
TetMesh CageMaker::of_count(int cells, double& size) const {
  TetMesh best;
  double best_miss = INFINITY, tried = size_for(cells), offset = kOffset;
  for (int round = 0; round < kCountRounds && best_miss > kCountTolerance; ++round) {
    TetMesh mesh = shape(tried, offset);
    const double miss = std::log(static_cast<double>(mesh.tet_count()) / cells);
    if (std::abs(miss) < best_miss) {
      best = std::move(mesh);
      best_miss = std::abs(miss);
      size = tried;
    }
    tried = tried_size(tried * std::exp(miss / kUsualPower));
  }
  return best;
}

void require_mesher(const std::string& name) {
  const MesherModule& module = mesher_module();
  if (module.make_tets != nullptr) return;
  throw InputError({name, "", "a tet mesh, or the mesher that makes one of a surface",
                    "no exmat-mesher.so in " + module.searched,
                    "install the package exmat-meshing, or build with EXMAT_BUILD_MESHING"});
}

void require_one_body(TetMesh& mesh, const std::string& name) {
  try {
    check_mesh(mesh, name, {});
  } catch (const InputError& error) {
    Complaint complaint = error.complaint();
    complaint.place = "the tets that enclose the surface";
    complaint.advice =
        "join the parts of the surface, leave the others out, or ask for larger cells, which bridge the gaps";
    throw InputError(std::move(complaint));
  }
}

void require_settings(const CageSettings& settings, double diagonal, const std::string& name) {
  if (!settings.cell_size) return;
  const double share = *settings.cell_size / diagonal;
  if (share >= kSmallestSize && share <= kLargestSize) return;
  throw InputError({name, "cell size",
                    fmt::format("{:.3g} to {:.3g} m for a surface whose bounding box has a diagonal of {:.4g} m",
                                kSmallestSize * diagonal, kLargestSize * diagonal, diagonal),
                    fmt::format("{:.4g} m", *settings.cell_size), ""});
}

}  // namespace

Cage make_cage(const SurfaceMesh& surface, const CageSettings& settings, const std::string& name) {
  require_mesher(name);
  const UnitSurface unit = unit_surface(surface, name);
  require_settings(settings, unit.diagonal, name);
  const CageMaker maker(unit, name);
  double size = settings.cell_size.value_or(0) / unit.diagonal, offset = kOffset;
  Cage cage;
  cage.mesh =
      settings.cell_size ? maker.shape(size, offset) : maker.of_count(settings.cells.value_or(kDefaultCells), size);
  cage.farthest = 0;
  const SurfaceTree tree(unit.mesh.vertices, unit.mesh.triangles);
  const TriangleArray outer = surface_triangles(cage.mesh.tets);
  for (const auto& corners : outer.rowwise())
    for (const std::int32_t corner : corners) {
      const Eigen::Vector3d point = cage.mesh.vertices.row(corner).transpose();
      cage.farthest = std::max(cage.farthest, (tree.nearest(point).position - point).norm());
    }
  cage.mesh.vertices = (cage.mesh.vertices * unit.diagonal).rowwise() + unit.centre;
  require_one_body(cage.mesh, name);
  cage.cell_size = size * unit.diagonal;
  cage.farthest *= unit.diagonal;
  std::tie(cage.least_angle, cage.largest_angle) = dihedral_angles(cage.mesh);
  cage.volume = tet_volumes(cage.mesh).sum();
  const double own = std::abs(enclosed_volume(surface.vertices, surface.triangles));
  if (is_closed(surface.triangles) && own > 0) cage.volume_ratio = cage.volume / own;
  cage.mesher = mesher_module().version;
  log::info(fmt::format(
      "{}: a cage of {} tets and {} vertices, cells of {:.4g} m, dihedral angles {:.0f} to {:.0f} degrees{}", name,
      cage.mesh.tet_count(), cage.mesh.vertex_count(), cage.cell_size, cage.least_angle, cage.largest_angle,
      cage.volume_ratio ? fmt::format(", {:.2f} times the surface's volume", *cage.volume_ratio) : ""));
  return cage;
}

std::string mesher_version() { return mesher_module().version; }

}  // namespace exmat::precompute

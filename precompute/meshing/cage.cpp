#include "precompute/meshing/cage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
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

// Gaps and hollows narrower than `alpha` are bridged by a wrap that stands off the surface by `offset`, from which the
// tets' surface is by `deviation` at most: all over the cell size.
struct Fit {
  double alpha, offset, deviation;
};
// A cage follows the surface, half of whose vertices are within, so that it has the surface's volume.
constexpr std::array<Fit, 2> kFollowing = {{{0.5, 0.05, 0.2}, {0.5, 0.15, 0.15}}};
constexpr int kClose = std::ssize(kFollowing);
// Tets in parts that are thinner than a cell stand off, more at each trial.
constexpr Fit kStandingOff{1, 0.2, 0.1};
constexpr double kFartherOff = 1.3;
constexpr int kShapeTrials = 10;
// Parts of a surface that do not hang together by vertices are one body where tets of some of these trials bridge them.
constexpr int kJoiningTrials = 5;
// Trials to find the cell size of a number of tets.
constexpr int kSizeTrials = 6;
// Cages that are made where the first has too many or too few tets.
constexpr int kCountRounds = 4;
// Tets grow as this power of the size, between those of a sheet and of a solid.
constexpr double kUsualPower = 2.5;
// Vertices of the surface are no farther out of the cage, over the cell size.
constexpr double kOutside = 0.75;
// A cage with more of the surface's volume stands off.
constexpr double kStandingOffVolume = 1.15;
// Tets of a sheet in a cube of its thickness, small enough that they follow it.
constexpr double kCellsOfACube = 8.5;
// A number of tets is met by so much.
constexpr double kCountTolerance = 0.1;
// Cell sizes over the diagonal that are tried at most: one cell for all, ten million.
constexpr double kLargestSize = 0.5, kSmallestSize = 0.002;
// Twice the area of a triangle that has none, over the diagonal's square: rounding of corners on one line.
constexpr double kNoArea = 1e-14;
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

Fit fit_of(int trial) {
  if (trial < kClose) return kFollowing[static_cast<std::size_t>(trial)];
  const double farther = std::pow(kFartherOff, trial - kClose);
  return {kStandingOff.alpha, farther * kStandingOff.offset, farther * kStandingOff.deviation};
}

class CageMaker {
 public:
  CageMaker(const UnitSurface& surface, const std::string& name)
      : surface_(surface), name_(name), connected_(is_connected(surface.mesh)) {}

  /// About so many tets; `size` becomes that of their cells.
  TetMesh of_count(int cells, double& size) const;
  /// `trial` is the first and becomes the one that gave the cage.
  TetMesh shape(double size, int& trial) const;

 private:
  double size_for(int cells) const;
  TetMesh tets(double size, const Fit& fit, unsigned seed, bool improve) const;
  Eigen::Index first_count(double size) const;
  std::string fault_of(TetMesh& mesh, double size, int trial) const;

  const UnitSurface& surface_;
  const std::string& name_;
  bool connected_;
};

// None where the mesher finds nothing to fill.
TetMesh CageMaker::tets(double size, const Fit& fit, unsigned seed, bool improve) const {
  TetMesh mesh;
  std::string failure;
  mesher_module().make_tets({surface_.mesh.vertices, surface_.mesh.triangles, fit.alpha * size, fit.offset * size,
                             fit.deviation * size, size, seed, improve},
                            mesh, failure);
  if (!failure.empty()) throw WorkError(fmt::format("{}: the mesher failed: {}", name_, failure));
  return mesh;
}

// Keeps few digits: the last ones of roots and powers differ between machines, and a mesh follows from every bit.
double tried_size(double size) { return std::round(std::clamp(size, kSmallestSize, kLargestSize) * 1e5) / 1e5; }

// Tets of a first mesh that follows the surface, or of one that stands off where that has none.
Eigen::Index CageMaker::first_count(double size) const {
  for (int trial = 0; trial <= kClose; ++trial)
    if (const Eigen::Index count = tets(size, fit_of(trial), 0, false).tet_count(); count > 0) return count;
  throw WorkError(fmt::format("{}: the mesher found nothing to fill", name_));
}

// The number of tets grows as a power of the cell size between 2 (sheets) and 3 (solids), and more where fine cells
// reach what coarse ones bridge: a secant in logarithms.
double CageMaker::size_for(int cells) const {
  double size = tried_size(std::cbrt(0.5 / cells));
  double best = size, best_miss = INFINITY, power = kUsualPower;
  double last_size = 0, last_count = 0;
  for (int trial = 0; trial < kSizeTrials; ++trial) {
    const auto count = static_cast<double>(first_count(size));
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

// The reason why the mesh is no cage; empty where it is one.
std::string CageMaker::fault_of(TetMesh& mesh, double size, int trial) const {
  if (mesh.tet_count() == 0) return "nothing to fill";
  const double angle = tet_volumes(mesh).minCoeff() > 0 ? dihedral_angles(mesh).first : 0;
  if (angle < kLeastDihedralAngle) return fmt::format("a dihedral angle of {:.1f} degrees", angle);
  if (nearest_points(mesh, surface_.mesh.vertices).distances.maxCoeff() > kOutside * size)
    return "vertices of the surface far outside";
  if (!connected_ && trial >= kJoiningTrials) return "";
  TetMesh copy = mesh;
  const bool falls_apart = check_mesh(copy, name_, {.drop_smaller_components = true}).dropped_components > 0;
  return falls_apart ? "several components" : "";
}

TetMesh CageMaker::shape(double size, int& trial) const {
  std::string why;
  for (; trial < kShapeTrials; ++trial) {
    TetMesh mesh = tets(size, fit_of(trial), static_cast<unsigned>(trial), true);
    why = fault_of(mesh, size, trial);
    if (why.empty()) return mesh;
    log::debug(fmt::format("{}: cage {} has {}; another trial", name_, trial + 1, why));
  }
  throw WorkError(
      fmt::format("{}: no cage without {} in {} trials; ask for another number of cells", name_, why, kShapeTrials));
}

// A cage that has to stand farther off the surface than the trials of size_for() has fewer tets than these.
TetMesh CageMaker::of_count(int cells, double& size) const {
  TetMesh best;
  double best_miss = INFINITY, tried = size_for(cells);
  for (int round = 0, trial = 0; round < kCountRounds && best_miss > kCountTolerance; ++round) {
    TetMesh mesh = shape(tried, trial);
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
    complaint.place = "the tets that fill the surface";
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
  double size = settings.cell_size.value_or(0) / unit.diagonal;
  int trial = 0;
  Cage cage;
  cage.mesh =
      settings.cell_size ? maker.shape(size, trial) : maker.of_count(settings.cells.value_or(kDefaultCells), size);
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

std::optional<Eigen::Index> cells_that_follow(const SurfaceMesh& surface, const Cage& cage) {
  if (!cage.volume_ratio || *cage.volume_ratio <= kStandingOffVolume) return std::nullopt;
  double area = 0;
  for (const auto& corners : surface.triangles.rowwise()) {
    const Eigen::RowVector3d a = surface.vertices.row(corners[0]);
    const Eigen::RowVector3d ab = surface.vertices.row(corners[1]) - a, ac = surface.vertices.row(corners[2]) - a;
    area += 0.5 * ab.cross(ac).norm();
  }
  const double volume = cage.volume / *cage.volume_ratio, thickness = 2 * volume / area;
  const double cells = kCellsOfACube * volume / std::pow(thickness, 3);
  return std::max(static_cast<Eigen::Index>(std::lround(cells)), 2 * cage.mesh.tet_count());
}

void warn_of_thin_surface(const SurfaceMesh& surface, const Cage& cage, const std::string& name) {
  const auto cells = cells_that_follow(surface, cage);
  if (!cells) return;
  log::warning(fmt::format(
      "{}: the body has {:.2f} times the volume of its surface, which is thinner than cells of {:.3g} m: it "
      "is too heavy and too stiff; about {} cells (object.cells) follow it",
      name, *cage.volume_ratio, cage.cell_size, *cells));
}

std::string mesher_version() { return mesher_module().version; }

}  // namespace exmat::precompute

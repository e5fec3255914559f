#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <vector>

#include "common/core/decompositions.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/region_view.h"
#include "precompute/shape_space/region_window.h"
#include "precompute/solvers/semidefinite_solver.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"
#include "tests/support/refined_mesh.h"

namespace exmat::precompute {
namespace {

// A free bar of 4 x 1 x 1 whose middle, 1 <= x <= 3, is a region, and its mesh refined once and twice.
class RefinedRegion : public testing::Test {
 protected:
  static constexpr int kCells = 20;  // along the bar

  RefinedRegion() {
    TetMesh mesh = test::box_mesh({kCells, kCells / 4, kCells / 4}, {4, 1, 1});
    const Eigen::MatrixXd shakes = 0.16 * 4 / kCells * test::random_matrix(mesh.vertex_count(), 3, 5);
    const auto stays = [](double at, int axis) {
      return at == 0 || at == (axis == 0 ? 4 : 1) || (axis == 0 && in(at));
    };
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
      for (int axis = 0; axis < 3; ++axis)
        if (!stays(mesh.vertices(v, axis), axis)) mesh.vertices(v, axis) += shakes(v, axis);
    meshes_[0] = std::move(mesh);
    for (std::size_t level = 1; level < 3; ++level) meshes_[level] = test::refined(meshes_[level - 1]);
  }
  static bool in(double x) { return std::abs(x - 1) < 1e-9 || std::abs(x - 3) < 1e-9; }

  static FlagVector inside(const TetMesh& mesh) {
    FlagVector flags(mesh.vertex_count());
    for (Eigen::Index v = 0; v < flags.size(); ++v) flags[v] = std::abs(mesh.vertices(v, 0) - 2) < 1 + 1e-9 ? 1 : 0;
    return flags;
  }
  static RegionView view(const TetMesh& mesh) { return {mesh, inside(mesh), FlagVector::Zero(mesh.vertex_count())}; }

  // [3n x 3] forces of three densities in space: they stretch, bend and twist the middle.
  static Eigen::MatrixXd forces(const TetMesh& mesh) {
    Eigen::MatrixXd densities(3 * mesh.vertex_count(), 3);
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
      const Eigen::RowVector3d at = mesh.vertices.row(v) - Eigen::RowVector3d(2, 0.5, 0.5);
      densities.middleRows<3>(3 * v) << at[0], 0, 0,  //
          0, 1 - at[0] * at[0], -2 * at[0] * at[2],   //
          0, 0, 2 * at[0] * at[1];
    }
    return expand_to_vectors(scalar_mass(mesh)) * densities;
  }

  std::array<TetMesh, 3> meshes_;
};

Eigen::VectorXd each_axis(const Eigen::VectorXd& of_vertices) {
  return of_vertices.replicate(1, 3).transpose().reshaped();
}

// Forces on a region that is cut at its border, and balanced on the one layer of vertices there.
Eigen::MatrixXd cut_sharply(const TetMesh& mesh, const FlagVector& inside, const Eigen::MatrixXd& forces) {
  FlagVector border = FlagVector::Zero(inside.size());
  for (const auto& tet : mesh.tets.rowwise())
    if (!FlagVector(inside(tet.transpose())).all())
      for (const auto vertex : tet) border[vertex] = inside[vertex];
  Eigen::MatrixXd motions(forces.rows(), 6);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d arm = mesh.vertices.row(v), along = Eigen::Vector3d::Unit(axis);
      motions.block<3, 1>(3 * v, axis) = along;
      motions.block<3, 1>(3 * v, 3 + axis) = along.cross(arm);
    }
  const Eigen::MatrixXd weighted =
      each_axis(lumped_volumes(mesh).cwiseProduct(border.cast<double>())).asDiagonal() * motions;
  const Eigen::MatrixXd cut = each_axis(inside.cast<double>()).asDiagonal() * forces;
  return cut - weighted * (motions.transpose() * weighted).ldlt().solve(motions.transpose() * cut);
}

// The same local force moves the outside alike whichever of the meshes it comes from. All forces act on one elastic
// body, on the vertices that the finest mesh shares with theirs: that a coarse mesh bends less is not the region's
// matter. Where the band is two and a half cells wide, the motion is within a hundredth of that with five. Cut sharply,
// it is eight hundredths away.
TEST_F(RefinedRegion, MovesTheOutsideAlike) {
  const TetMesh& finest = meshes_.back();
  const Eigen::Index t = finest.tet_count();
  const TetMaterials materials{Eigen::VectorXd::Constant(t, 1000), Eigen::VectorXd::Constant(t, 1e5),
                               Eigen::VectorXd::Constant(t, 0.3)};
  const ElasticSystem system = build_elastic_system(finest, materials, FlagVector::Zero(finest.vertex_count()));
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "bar", system.rigid);
  std::vector<Eigen::Index> outside;
  for (Eigen::Index v = 0; v < meshes_[0].vertex_count(); ++v)
    if (std::abs(meshes_[0].vertices(v, 0) - 2) > 1 + 1e-9)
      for (const int axis : {0, 1, 2}) outside.push_back(3 * v + axis);

  std::array<Eigen::MatrixXd, 3> soft, sharp;
  for (std::size_t level = 0; level < 3; ++level) {
    const TetMesh& mesh = meshes_[level];
    Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(3 * finest.vertex_count(), 6);
    loads.topRows(3 * mesh.vertex_count()) << view(mesh).transposed(forces(mesh)),
        cut_sharply(mesh, inside(mesh), forces(mesh));
    const Eigen::MatrixXd motions = solver.solve(loads)(outside, Eigen::all);
    soft[level] = motions.leftCols(3);
    sharp[level] = motions.rightCols(3);
  }
  const auto change = [](const auto& motions, std::size_t level, int force) {
    return (motions[level].col(force) - motions[level - 1].col(force)).norm() / motions[2].col(force).norm();
  };
  for (int force = 0; force < 3; ++force) {
    fmt::print("force {}: refined once {:.2f} %, twice {:.2f} %; cut sharply {:.2f} %, {:.2f} %\n", force,
               100 * change(soft, 1, force), 100 * change(soft, 2, force), 100 * change(sharp, 1, force),
               100 * change(sharp, 2, force));
    EXPECT_LE(change(soft, 2, force), 0.01) << force;
    if (force == 1) continue;  // what bends is small at the border
    EXPECT_GE(change(sharp, 2, force), 0.05) << force;
  }
}

// The work of the felt forces along fields of a plain bar under tension, bending and torsion, which by Betti is the
// motion of its ends, against integrals over the bar with the window of the definition: chi = 3 t^2 - 2 t^3 with
// t = s / l, s = 1 - |x - 2| from the border, l = 1/4, as the mean of s is 1/2.
TEST_F(RefinedRegion, WorksAsTheIntegralsSay) {
  constexpr int kPoints = 4000;  // of the midpoint rule: errors of 1e-7
  double stretch = 0, bend = 0, twist = 0, weight = 0, sag = 0, load = 0;
  for (int i = 0; i < kPoints; ++i) {
    const double x = (i + 0.5) / kPoints, step = std::min(1.0, 4 * (1 - x));  // to one side of the middle
    const double window = step * step * (3 - 2 * step), band = step < 1 ? step * (1 - step) : 0;
    stretch += 2 * window * x * x / kPoints;
    twist += 2 * window * 2 * x * x / 6 / kPoints;  // the polar moment of the section is 1/6
    bend += 2 * window * (1 - x * x) * x * x / 2 / kPoints;
    load += 2 * window * (1 - x * x) / kPoints;
    weight += band;
    sag += band * x * x / 2;
  }
  // Seen from the band, whose mean sag is taken away. Of the other fields the two ends of the band have opposite parts,
  // and no rigid motion.
  bend -= load * sag / weight;
  const Eigen::Vector3d expected(stretch, bend, twist);
  // The band is a cell and a quarter wide, then two and a half, then five: an error of second order in that.
  double tolerance = 0.005;
  for (const TetMesh& mesh : meshes_) {
    Eigen::MatrixXd fields(3 * mesh.vertex_count(), 3);
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
      const Eigen::RowVector3d at = mesh.vertices.row(v) - Eigen::RowVector3d(2, 0.5, 0.5);
      fields.middleRows<3>(3 * v) << at[0], -at[0] * at[1], 0,  //
          0, at[0] * at[0] / 2, -at[0] * at[2],                 //
          0, 0, at[0] * at[1];
    }
    const Eigen::Vector3d work = (view(mesh).transposed(forces(mesh)).transpose() * fields).diagonal();
    const Eigen::Vector3d missed = (work - expected).cwiseQuotient(expected).cwiseAbs();
    fmt::print("missed by {:.3f}, {:.3f} and {:.3f} %\n", 100 * missed[0], 100 * missed[1], 100 * missed[2]);
    EXPECT_LE(missed.maxCoeff(), tolerance);
    tolerance /= 4;
  }
}

}  // namespace
}  // namespace exmat::precompute

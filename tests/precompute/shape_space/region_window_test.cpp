#include "precompute/shape_space/region_window.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/mesh/geometry.h"
#include "precompute/shape_space/region_view.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"
#include "tests/support/refined_mesh.h"

namespace exmat::precompute {
namespace region_window_test {

constexpr double kRounding = 1e-12;

double smooth_step(double t) { return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t); }

FlagVector flags_where(const TetMesh& mesh, const auto& condition) {
  FlagVector flags(mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) flags[v] = condition(mesh.vertices.row(v)) ? 1 : 0;
  return flags;
}

// A bar of 4 x 1 x 1 whose vertices are shaken but for its faces and the section at x = 1.
TetMesh shaken_bar(const std::array<int, 3>& cells) {
  TetMesh mesh = test::box_mesh(cells, {4, 1, 1});
  const Eigen::MatrixXd shakes = 0.04 * test::random_matrix(mesh.vertex_count(), 3, 5);
  const Eigen::RowVector3d ends(4, 1, 1);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    for (int axis = 0; axis < 3; ++axis) {
      const double at = mesh.vertices(v, axis);
      if (at != 0 && at != ends[axis] && (axis > 0 || at != 1)) mesh.vertices(v, axis) += shakes(v, axis);
    }
  return mesh;
}

// Distances from a plane border are exact and linear, and so is their mean, 1.5: any mesh has the formula's window.
TEST(RegionWindow, OfABarIsAStepAsLongAsAQuarterOfItOnAnyMesh) {
  const double width = 0.75;
  for (const TetMesh& mesh : {shaken_bar({12, 3, 3}), shaken_bar({16, 5, 4}), test::refined(shaken_bar({12, 3, 3}))}) {
    ASSERT_GT(tet_volumes(mesh).minCoeff(), 0);
    const FlagVector inside = flags_where(mesh, [](const auto& at) { return at[0] > 1 - 1e-9; });
    const RegionWindow window = region_window(mesh, inside);
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
      EXPECT_NEAR(window.values[v], smooth_step((mesh.vertices(v, 0) - 1) / width), kRounding) << v;

    // The slope's integral over the step is one: the band weighs its width times its section. Its middle is at half of
    // its width. The rule of integration misses by 2e-3 of the band at most: the slope has a kink at each end.
    const Eigen::RowVector3d middle = window.band.transpose() * mesh.vertices / window.band.sum();
    EXPECT_NEAR(window.band.sum(), width, 2e-3 * width);
    EXPECT_LE((middle - Eigen::RowVector3d(1 + width / 2, 0.5, 0.5)).norm(), 2e-3 * width);
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
      EXPECT_TRUE(window.band[v] == 0 || (window.band[v] > 0 && inside[v] != 0)) << v;
  }
}

// Cells that are longer than the band: it is found all the same.
TEST(RegionWindow, HasItsBandBetweenTheLayersOfACoarseMesh) {
  const TetMesh mesh = test::box_mesh({4, 1, 1}, {4, 1, 1});
  const RegionWindow window = region_window(mesh, flags_where(mesh, [](const auto& at) { return at[0] > 1.5; }));
  const Eigen::RowVector3d middle = window.band.transpose() * mesh.vertices / window.band.sum();
  EXPECT_NEAR(window.band.sum(), 0.5, 1e-3 * 0.5);
  EXPECT_LE((middle - Eigen::RowVector3d(2.25, 0.5, 0.5)).norm(), 1e-3 * 0.5);
}

// A U: the region is what is not the upper half of its left leg. Its right leg comes near the border, but not by a way
// through the body.
TEST(RegionWindow, IsOneWhereOnlyAGapPartsFromTheBorder) {
  TetMesh mesh = test::box_mesh({6, 2, 12}, {3, 1, 6});
  std::vector<Eigen::Index> kept;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Eigen::RowVector3d middle = tet_positions(mesh, t).colwise().mean();
    if (middle[0] < 1 || middle[0] > 2 || middle[2] < 1) kept.push_back(t);
  }
  mesh.tets = TetArray(mesh.tets(kept, Eigen::all));
  const FlagVector inside = flags_where(mesh, [](const auto& at) { return at[0] > 1.2 || at[2] < 3.1; });
  const RegionWindow window = region_window(mesh, inside);
  const auto at = [&](double x, double z) {
    return window.values[(static_cast<Eigen::Index>(2 * z) * 3 + 1) * 7 + static_cast<Eigen::Index>(2 * x)];
  };
  EXPECT_EQ(at(0.5, 3), 0);
  EXPECT_LT(at(0.5, 2), 0.99);  // one away
  EXPECT_EQ(at(2, 3), 1);       // as near, across the gap
  EXPECT_EQ(at(2.5, 6), 1);
  EXPECT_EQ(at(0.5, 6), 0);
}

TEST(RegionWindow, IsTheIndicatorWhereThereIsNoRoomOrNoBorder) {
  const TetMesh mesh = test::box_mesh({4, 2, 2}, {4, 1, 1});
  const FlagVector layer = flags_where(mesh, [](const auto& at) { return at[0] == 2; });
  const RegionWindow thin = region_window(mesh, layer);
  EXPECT_EQ(thin.values, layer.cast<double>());
  EXPECT_EQ(thin.band, lumped_volumes(mesh).cwiseProduct(layer.cast<double>()));
  EXPECT_NEAR(thin.band.sum(), 1, kRounding);  // half a cell to either side

  const RegionWindow all = region_window(mesh, FlagVector::Ones(mesh.vertex_count()));
  EXPECT_TRUE(all.values.isOnes(0));
  EXPECT_TRUE(all.band.isZero(0));
}

// The mean of the window over a tet inside; nothing of one that reaches out, even where the window does not.
TEST(RegionWindow, OfATetIsItsMean) {
  const TetMesh mesh = shaken_bar({8, 2, 2});
  const FlagVector inside = flags_where(mesh, [](const auto& x) { return x[0] > 0.9; });
  const Eigen::VectorXd window = region_window(mesh, inside).values;
  const Eigen::VectorXd shares = region_tet_shares(mesh, inside, window);
  const Eigen::VectorXd whole = region_tet_shares(mesh, inside, Eigen::VectorXd::Ones(window.size()));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    double sum = 0;
    bool within = true;
    for (const int v : mesh.tets.row(t)) {
      sum += window[v];
      within = within && inside[v] != 0;
    }
    EXPECT_NEAR(shares[t], within ? sum / 4 : 0, kRounding);
    EXPECT_EQ(whole[t], within ? 1 : 0);
  }
  EXPECT_GT(shares.maxCoeff(), 0.9);
}

}  // namespace region_window_test
}  // namespace exmat::precompute

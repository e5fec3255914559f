#include "precompute/shape_space/region_view.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "common/core/decompositions.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/modes/linear_modes.h"
#include "precompute/shape_space/region_poses.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

constexpr double kRounding = 1e-12;

class Region : public testing::TestWithParam<bool> {
 protected:
  Region() {
    const Eigen::Index n = mesh_.vertex_count();
    fixed_ = inside_ = FlagVector::Zero(n);
    for (Eigen::Index v = 0; v < n; ++v) {
      fixed_[v] = clamped() && mesh_.vertices(v, 0) < 1e-9 ? 1 : 0;
      inside_[v] = mesh_.vertices(v, 0) > 0.55 ? 1 : 0;
    }
  }
  static bool clamped() { return GetParam(); }
  Eigen::MatrixXd random(Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return uniform_(generator_); });
  }
  Eigen::VectorXd rigid_motion() {
    const Eigen::Vector3d shift = random(3, 1), spin = random(3, 1);
    Eigen::VectorXd motion(3 * mesh_.vertex_count());
    for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v)
      motion.segment<3>(3 * v) = shift + spin.cross(Eigen::Vector3d(mesh_.vertices.row(v)));
    return motion;
  }

  TetMesh mesh_ = test::box_mesh({6, 2, 2}, {1.0, 0.3, 0.25});
  FlagVector fixed_, inside_;
  std::mt19937 generator_{1};
  std::uniform_real_distribution<double> uniform_{-1, 1};
};
INSTANTIATE_TEST_SUITE_P(Bodies, Region, testing::Bool(),
                         [](const auto& body) { return body.param ? "clamped" : "free"; });

// The view sees the same of all displacements that agree on the region: what the window leaves of the motion against
// the rigid one that fits the band best, here found by least squares over its vertices.
TEST_P(Region, IsSeenFromItsBand) {
  const RegionView view(mesh_, inside_, fixed_);
  const Eigen::Index n = mesh_.vertex_count();
  EXPECT_LE(view.see(rigid_motion()).norm(), kRounding);
  Eigen::VectorXd field = random(3 * n, 1);
  const Eigen::VectorXd seen = view.see(field);
  Eigen::MatrixXd motions(3 * n, 6), weighted(3 * n, 7);
  for (Eigen::Index v = 0; v < n; ++v)
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d arm = mesh_.vertices.row(v), along = Eigen::Vector3d::Unit(axis);
      motions.block<3, 1>(3 * v, axis) = along;
      motions.block<3, 1>(3 * v, 3 + axis) = along.cross(arm);
    }
  weighted << motions, field;
  for (Eigen::Index v = 0; v < n; ++v) weighted.middleRows<3>(3 * v) *= std::sqrt(view.frame()[v]);
  const Eigen::VectorXd rest =
      field - motions * weighted.leftCols(6).colPivHouseholderQr().solve(weighted.col(6)).eval();
  for (Eigen::Index v = 0; v < n; ++v)
    EXPECT_LE((seen.segment<3>(3 * v) - view.window()[v] * rest.segment<3>(3 * v)).norm(), kRounding) << v;

  for (Eigen::Index v = 0; v < n; ++v) {
    EXPECT_TRUE(inside_[v] != 0 || (view.window()[v] == 0 && view.frame()[v] == 0)) << v;
    if (inside_[v] != 0) continue;
    EXPECT_TRUE(seen.segment<3>(3 * v).isZero(0));
    field.segment<3>(3 * v).setRandom();
  }
  EXPECT_LE((view.see(field) - seen).norm(), kRounding * seen.norm());

  // The band is a twelfth long, from the border at x = 2/3 on: within the cells up to x = 5/6. Beyond, all is seen.
  Eigen::VectorXd inner = Eigen::VectorXd::Zero(3 * n);
  for (Eigen::Index v = 0; v < n; ++v) {
    const double x = mesh_.vertices(v, 0);
    EXPECT_EQ(view.frame()[v] > 0, x > 0.6 && x < 0.9) << v;
    if (x > 0.9) inner.segment<3>(3 * v) = Eigen::Vector3d(0.1, -0.2, x);
  }
  EXPECT_LE((view.see(inner + rigid_motion()) - inner).norm(), kRounding * inner.norm());
}

TEST_P(Region, FeelsForcesInsideWithoutNetForceAndTorque) {
  const RegionView view(mesh_, inside_, fixed_);
  const Eigen::MatrixXd forces = random(3 * mesh_.vertex_count(), 4);
  const Eigen::MatrixXd felt = view.transposed(forces);
  for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v)
    EXPECT_TRUE(inside_[v] != 0 || felt.middleRows<3>(3 * v).isZero(0)) << v;
  for (int i = 0; i < 5; ++i) EXPECT_LE((felt.transpose() * rigid_motion()).norm(), kRounding * felt.norm());
  const Eigen::MatrixXd displacements = random(3 * mesh_.vertex_count(), 3);
  EXPECT_LE((felt.transpose() * displacements - forces.transpose() * view.see(displacements)).norm(),
            kRounding * felt.norm() * displacements.norm());
}

// No border, or the ground to stand on: nothing is taken away but by the window, at the border to the rest.
TEST_P(Region, ThatIsAllOrHoldsTheClampIsSeenAsItMoves) {
  const Eigen::VectorXd field = random(3 * mesh_.vertex_count(), 1);
  EXPECT_EQ(RegionView(mesh_, FlagVector::Ones(inside_.size()), fixed_).see(field), field);
  if (!clamped()) return;
  const FlagVector other = FlagVector::Ones(inside_.size()) - inside_;
  const RegionView view(mesh_, other, fixed_);
  const Eigen::VectorXd seen = view.see(field), felt = view.transposed(field);
  for (Eigen::Index v = 0; v < other.size(); ++v) {
    const double x = mesh_.vertices(v, 0);
    const double window = x < 0.4 ? 1 : 0;  // the border is the layer at x = 1/2, the next is beyond the band
    EXPECT_EQ(view.window()[v], window) << v;
    EXPECT_EQ(seen.segment<3>(3 * v), Eigen::Vector3d(window * field.segment<3>(3 * v)));
    EXPECT_EQ(felt.segment<3>(3 * v), seen.segment<3>(3 * v));
    EXPECT_EQ(view.frame()[v] > 0, fixed_[v] != 0) << v;
  }
}

// Against dense linear algebra: the minimiser over the complement of the rigid motions of the same sum of squares.
TEST_P(Region, PosesAreTheMinimumOfTheirEnergy) {
  const Eigen::Index n = mesh_.vertex_count(), t = mesh_.tet_count();
  const TetMaterials materials{Eigen::VectorXd::Constant(t, 1000), Eigen::VectorXd::Constant(t, 1e5),
                               Eigen::VectorXd::Constant(t, 0.35)};
  const ElasticSystem system = build_elastic_system(mesh_, materials, fixed_);
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "test");
  const LaplaceBasis object = laplace_basis(mesh_, 5, "test");
  const Eigen::VectorXd weights = object.eigenvalues;
  const RegionView view(mesh_, inside_, fixed_);
  const double stiffness = 3e4, mass = 1000 * object.volume;
  const RegionPoses poses(object, weights, view, system, solver, stiffness);

  Eigen::MatrixXd observe(15, 3 * n);  // a displacement's coefficients inside
  for (int i = 0; i < 5; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::VectorXd load = Eigen::VectorXd::Zero(3 * n);
      load(Eigen::seqN(axis, n, 3)) = object.mass * object.eigenfunctions.col(i);
      observe.row(3 * i + axis) = view.transposed(load).transpose();
    }
  // Free displacements orthogonal to the rigid motions.
  const Eigen::MatrixXd rigid = system.mass * system.null_space;
  const Eigen::Index f = system.mass.rows();
  Eigen::MatrixXd span = Eigen::MatrixXd::Identity(f, f);
  if (rigid.cols() > 0) span = Eigen::HouseholderQR<Eigen::MatrixXd>(rigid).householderQ() * span.rightCols(f - 6);
  const Eigen::MatrixXd seen = observe * system.extend(span);
  const Eigen::MatrixXd hessian =
      span.transpose() * (system.stiffness * span) + stiffness * mass * seen.transpose() * seen;
  const Eigen::MatrixXd changes = random(15, 3);
  Eigen::MatrixXd coefficients = changes;
  for (int i = 0; i < 15; ++i) coefficients.row(i) *= std::cbrt(object.volume) / weights[i / 3];
  const Eigen::MatrixXd expected = span * hessian.ldlt().solve(stiffness * mass * seen.transpose() * coefficients);
  const Eigen::MatrixXd found = poses.displacements(changes);
  // Condition number of the Hessian times rounding.
  EXPECT_LE((found - expected).norm(), 1e-8 * expected.norm());
}

}  // namespace
}  // namespace exmat::precompute

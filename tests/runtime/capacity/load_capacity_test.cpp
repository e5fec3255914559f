#include "runtime/capacity/load_capacity.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

/// The share by dense matrices of the bar, which another code assembled, and the best of all displacements in the span.
double dense_share(const test::Bar& bar, double h, const Eigen::VectorXd& load) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < load.size(); ++i)
    if (bar.model.object->fixed[i / 3] == 0) kept.push_back(i);
  const Eigen::MatrixXd A = (bar.mass + h * h * bar.stiffness)(kept, kept);
  const Eigen::VectorXd f = load(kept);
  Eigen::MatrixXd B = bar.basis()(kept, Eigen::all);
  if (std::ssize(kept) == load.size()) {
    const Eigen::Index modes = B.cols();
    B.conservativeResize(Eigen::NoChange, modes + 6);
    for (Eigen::Index i = 0; i < load.size(); ++i) {
      const Eigen::Vector3d x = bar.model.object->mesh.vertices.row(i / 3);
      for (int a = 0; a < 3; ++a) {
        B(i, modes + a) = i % 3 == a ? 1 : 0;
        B(i, modes + 3 + a) = Eigen::Vector3d::Unit(a).cross(x)[i % 3];
      }
    }
  }
  const Eigen::VectorXd y = A.fullPivLu().solve(f);
  const Eigen::VectorXd z = B * (B.transpose() * A * B).fullPivLu().solve(B.transpose() * f);
  return 1 - f.dot(z) / f.dot(y);
}

class Capacities : public ::testing::TestWithParam<bool> {
 protected:
  test::Bar bar_ = test::make_bar({.cells = {5, 2, 2}, .density_gradient = 0.5, .free = GetParam()});
};

TEST_P(Capacities, AreThoseOfTheFullMatrices) {
  const LoadCapacity capacity(bar_.model, 0.2);
  const Eigen::MatrixXd reduced = bar_.basis().transpose() * bar_.stiffness * bar_.basis();
  const double lowest = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(reduced).eigenvalues().minCoeff();
  EXPECT_NEAR(capacity.time_scale(), 1 / std::sqrt(lowest), 1e-6 * capacity.time_scale());
  VertexArray places(2, 3), forces(2, 3);
  places << 1, 0.25, 0.25, 0.6, 0, 0.1;
  forces << 1, -2, 0.5, 0, 3, 0;
  const Eigen::VectorXd spread = capacity.spread_load(places, forces);
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(Eigen::VectorXd(spread(Eigen::seq(axis, Eigen::last, 3))).sum(), forces.col(axis).sum(), 1e-12);
  Eigen::VectorXd point = Eigen::VectorXd::Zero(spread.size());
  point[point.size() - 1] = 1;
  for (const Eigen::VectorXd& load : {spread, point}) {
    const double expected = dense_share(bar_, capacity.time_scale(), load);
    EXPECT_NEAR(capacity.lost_share(load), expected, 1e-7);
    EXPECT_GT(expected, 0.01);
    for (const double size : {1e-200, 1e200}) EXPECT_NEAR(capacity.lost_share(size * load), expected, 1e-7) << size;
  }
  EXPECT_EQ(capacity.lost_share(0 * spread), 0);
}

// Loads that move the body within the span lose nothing.
TEST_P(Capacities, AreFullForLoadsOfTheModes) {
  const LoadCapacity capacity(bar_.model, 0);
  const double h = capacity.time_scale();
  const Eigen::VectorXd load = (bar_.mass + h * h * bar_.stiffness) * bar_.basis().col(2);
  EXPECT_LE(capacity.lost_share(load), 1e-9);
  if (!GetParam()) return;
  const Eigen::VectorXd weight = bar_.mass * Eigen::VectorXd::Ones(load.size());
  EXPECT_LE(capacity.lost_share(weight), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Bars, Capacities, ::testing::Bool(),
                         [](const auto& tested) { return tested.param ? "Free" : "Clamped"; });

}  // namespace
}  // namespace exmat::runtime

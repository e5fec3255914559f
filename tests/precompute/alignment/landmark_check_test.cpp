#include "precompute/alignment/landmark_check.h"

#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <random>

#include "tests/support/posed_bodies.h"

namespace exmat::precompute {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::array<int, 3> kCells{10, 3, 2};
constexpr std::array<double, 3> kLengths{4, 1, 0.6};

/// About an arc of so many degrees, lengths along the axis kept.
TetMesh bent(TetMesh mesh, double degrees) {
  const double curvature = degrees * std::numbers::pi / 180 / kLengths[0];
  for (auto x : mesh.vertices.rowwise()) {
    const double angle = curvature * x[0], radius = 1 / curvature - x[2];
    x[0] = radius * std::sin(angle);
    x[2] = 1 / curvature - radius * std::cos(angle);
  }
  return mesh;
}

TEST(EdgeDistances, AreThoseOfAllPairs) {
  const TetMesh mesh = test::shaken_box({3, 2, 2}, {3, 1, 1}, 5);
  const Eigen::Index n = mesh.vertex_count();
  // Floyd 1962.
  Eigen::MatrixXd all = Eigen::MatrixXd::Constant(n, n, std::numeric_limits<double>::infinity());
  for (const auto tet : mesh.tets.rowwise())
    for (const auto a : tet)
      for (const auto b : tet) all(a, b) = (mesh.vertices.row(a) - mesh.vertices.row(b)).norm();
  for (Eigen::Index k = 0; k < n; ++k)
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j) all(i, j) = std::min(all(i, j), all(i, k) + all(k, j));
  std::vector<std::int32_t> every(static_cast<std::size_t>(n));
  std::iota(every.begin(), every.end(), 0);
  EXPECT_LT((edge_distances(mesh, every) - all).cwiseAbs().maxCoeff(), 1e-13);
}

class ContradictingLandmarks : public testing::Test {
 protected:
  const TetMesh rest_ = test::shaken_box(kCells, kLengths, 1);
  const std::vector<std::int32_t> corners_ = test::box_corners(kCells);
};

TEST_F(ContradictingLandmarks, AreNoneWhereAllCorrespond) {
  for (const double degrees : {30.0, 90.0, 150.0}) {
    const TetMesh pose = bent(test::shaken_box(kCells, kLengths, 2), degrees);
    EXPECT_THAT(contradicting_landmarks(rest_, corners_, pose, corners_), IsEmpty()) << degrees;
  }
}

TEST_F(ContradictingLandmarks, IsTheOneThatIsElsewhere) {
  const TetMesh pose = bent(test::shaken_box(kCells, kLengths, 2), 90);
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    std::vector<std::int32_t> on_pose = corners_;
    on_pose[k] = corners_[k ^ 1U];  // the same corner of the other end
    EXPECT_THAT(contradicting_landmarks(rest_, corners_, pose, on_pose), ElementsAre(k));
  }
}

TEST_F(ContradictingLandmarks, AreLookedForFromSixOn) {
  const TetMesh pose = bent(rest_, 60);
  const std::vector<std::int32_t> five(corners_.begin(), corners_.begin() + 5);
  std::vector<std::int32_t> on_pose = five;
  on_pose[0] = corners_[1];
  EXPECT_THAT(contradicting_landmarks(rest_, five, pose, on_pose), IsEmpty());
}

// Nobody can say which are wrong where all are mixed up; more than a quarter is never left out.
TEST_F(ContradictingLandmarks, AreAQuarterAtMost) {
  std::mt19937 generator(3);
  for (int k = 0; k < 20; ++k) {
    std::vector<std::int32_t> on_pose = corners_;
    std::ranges::shuffle(on_pose, generator);
    EXPECT_LE(contradicting_landmarks(rest_, corners_, rest_, on_pose).size(), 2u);
  }
}

}  // namespace
}  // namespace exmat::precompute

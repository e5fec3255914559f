#include "runtime/export/morph_targets.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"

namespace exmat::runtime {
namespace {

constexpr Eigen::Index kModes = 6, kFrames = 40;

/// A wavy sheet whose modes are sines of it, neither orthogonal nor of one size.
DrawnSurface sheet() {
  constexpr int kSide = 12;
  DrawnSurface surface;
  surface.vertices.resize(kSide * kSide, 3);
  surface.triangles.resize(2 * (kSide - 1) * (kSide - 1), 3);
  surface.modes.resize(3 * kSide * kSide, kModes);
  Eigen::Index row = 0;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const int k = kSide * i + j;
      const double x = 0.1 * i, y = 0.1 * j;
      surface.vertices.row(k) << x, y, 0.1 * std::sin(3 * x + y);
      for (int m = 0; m < kModes; ++m)
        surface.modes.middleRows(3 * k, 3).col(m) << 0.01 * std::cos(m * y), 0.02 * std::sin(m * x + 1),
            0.1 / (1 + m) * std::sin((1 + 0.5 * m) * x + m * y);
      if (i + 1 == kSide || j + 1 == kSide) continue;
      surface.triangles.row(row++) << k, k + kSide, k + kSide + 1;
      surface.triangles.row(row++) << k, k + kSide + 1, k + 1;
    }
  return surface;
}

RowMatrix motion() {
  RowMatrix reduced(kFrames, kModes);
  for (Eigen::Index frame = 0; frame < kFrames; ++frame)
    for (Eigen::Index m = 0; m < kModes; ++m)
      reduced(frame, m) = 3 * std::sin(0.1 * static_cast<double>((m + 1) * frame + m)) / static_cast<double>(1 + m * m);
  return reduced;
}

class MorphTargetsTest : public testing::Test {
 protected:
  /// [3v x F] displacements of the drawn surface.
  RowMatrix drawn(const MorphTargets& targets) const { return targets.displacements * targets.weights.transpose(); }
  RowMatrix truth() const { return surface_.modes * motion_.transpose(); }

  DrawnSurface surface_ = sheet();
  RowMatrix motion_ = motion();
  VertexNormals normals_{surface_.vertices, surface_.triangles};
};

TEST_F(MorphTargetsTest, OfAllModesLoseNothing) {
  const MorphTargets targets = targets_of_motion(surface_, normals_, motion_);
  ASSERT_EQ(targets.displacements.cols(), kModes);
  EXPECT_LT((drawn(targets) - truth()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_EQ(targets.names.back(), "mode 6");
  // In single precision: half a unit in the last place of coordinates up to 1.1, and of products.
  EXPECT_LT(error_of(targets, surface_, normals_, motion_).largest, 3e-7);
}

TEST_F(MorphTargetsTest, HaveAsTheirLargestWeightOne) {
  for (const auto count : {std::optional<std::int64_t>{}, std::optional<std::int64_t>{3}}) {
    const MorphTargets targets = targets_of_motion(surface_, normals_, motion_, count);
    for (const auto column : targets.weights.colwise()) EXPECT_NEAR(column.cwiseAbs().maxCoeff(), 1, 1e-15);
  }
}

// Eckart and Young: no set of N targets misses less than the singular values after the N-th of all displacements.
TEST_F(MorphTargetsTest, MissAsLittleAsSoManyCan) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd{Eigen::MatrixXd(truth())};
  for (const std::int64_t count : {1, 2, 3, 5}) {
    const MorphTargets targets = targets_of_motion(surface_, normals_, motion_, count);
    ASSERT_EQ(targets.displacements.cols(), count);
    const double best = svd.singularValues().tail(svd.singularValues().size() - count).norm();
    EXPECT_NEAR((drawn(targets) - truth()).norm(), best, 1e-9 * svd.singularValues()[0]);
    // The reported error, in single precision.
    const MorphError error = error_of(targets, surface_, normals_, motion_);
    const double points = static_cast<double>(surface_.vertex_count() * kFrames);
    EXPECT_NEAR(error.rms, best / std::sqrt(points), 1e-7);
    const auto missed = RowMatrix(drawn(targets) - truth());
    double largest = 0;
    for (Eigen::Index k = 0; k < surface_.vertex_count(); ++k)
      largest = std::max(largest, missed.middleRows(3 * k, 3).colwise().norm().maxCoeff());
    EXPECT_NEAR(error.largest, largest, 3e-7);
  }
}

TEST_F(MorphTargetsTest, AreFewerWhereTheMotionHasFewer) {
  RowMatrix flat = RowMatrix::Zero(kFrames, kModes);
  flat.col(2) = motion_.col(2);
  const MorphTargets targets = targets_of_motion(surface_, normals_, flat, 4);
  EXPECT_LT((drawn(targets) - surface_.modes * flat.transpose()).cwiseAbs().maxCoeff(), 1e-13);
  // A body that does not move at all.
  const RowMatrix still = RowMatrix::Zero(2, kModes);
  const MorphTargets resting = targets_of_motion(surface_, normals_, still, 2);
  EXPECT_TRUE(drawn(resting).isZero(0));
  EXPECT_TRUE(resting.normals.allFinite());
  EXPECT_LT(error_of(resting, surface_, normals_, still).largest, 1e-7);
}

TEST_F(MorphTargetsTest, HaveNormalsThatTheMotionHas) {
  const MorphTargets fitted = targets_of_motion(surface_, normals_, motion_);
  MorphTargets derived = fitted;
  derived.normals = normals_.derivatives(surface_.vertices, derived.displacements);
  const double with = error_of(fitted, surface_, normals_, motion_).normal_rms;
  const double without = error_of(derived, surface_, normals_, motion_).normal_rms;
  EXPECT_LT(with, 0.5 * without);
  // Small motions: normals are linear in the weights, and what is left is of second order.
  const RowMatrix small = 1e-3 * motion_;
  const double of_small = error_of(targets_of_motion(surface_, normals_, small), surface_, normals_, small).normal_rms;
  EXPECT_LT(of_small, 1e-5);
}

TEST_F(MorphTargetsTest, OfModesHaveQAsWeights) {
  const MorphTargets targets = modes_as_targets(surface_, normals_);
  EXPECT_EQ(targets.displacements, surface_.modes);
  EXPECT_EQ(targets.weights.rows(), 0);
  EXPECT_EQ(targets.normals, normals_.derivatives(surface_.vertices, surface_.modes));
  EXPECT_EQ(targets.names.front(), "mode 1");
}

}  // namespace
}  // namespace exmat::runtime

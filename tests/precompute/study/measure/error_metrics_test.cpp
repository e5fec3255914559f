#include "precompute/study/measure/error_metrics.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <random>

#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class ErrorMetrics : public testing::Test {
 protected:
  ErrorMetrics() {
    Eigen::VectorXd density = Eigen::VectorXd::LinSpaced(mesh_.tet_count(), 500, 1500);
    mass_ = scalar_mass(mesh_, density);
    total_mass_ = density.dot(tet_volumes(mesh_));
  }

  // A rest body that does not move at the times 1, 2, 3.
  BodyFrames still() const {
    BodyFrames frames;
    for (int i = 1; i <= 3; ++i) {
      frames.times.push_back(i);
      frames.positions.push_back(mesh_.vertices);
      frames.velocities.push_back(VertexArray::Zero(mesh_.vertex_count(), 3));
      frames.kinetic.push_back(0);
      frames.elastic.push_back(0);
      frames.potential.push_back(0);
    }
    return frames;
  }
  // Shifted and moved as a whole, by so much in each frame.
  BodyFrames shifted(const std::array<double, 3>& shifts, const std::array<double, 3>& speeds) const {
    BodyFrames frames = still();
    for (std::size_t i = 0; i < 3; ++i) {
      frames.positions[i].col(0).array() += shifts[i];
      frames.velocities[i].col(1).setConstant(speeds[i]);
    }
    return frames;
  }
  TrajectoryErrors compare(const BodyFrames& a, const BodyFrames& b, bool free_body = false) const {
    return trajectory_errors(a, b, mesh_.vertices, mass_, free_body);
  }
  VertexArray random_field(double size) {
    std::normal_distribution<double> value;
    return VertexArray::NullaryExpr(mesh_.vertex_count(), 3, [&] { return size * value(random_); });
  }

  TetMesh mesh_ = test::box_mesh({3, 2, 2}, {1.0, 0.5, 0.4});
  SparseMatrix mass_;
  double total_mass_ = 0;
  std::mt19937 random_{3};
};

// Constant fields are in the norm sqrt(total mass) |c|: everything is known in closed form.
TEST_F(ErrorMetrics, OfTranslationsAreKnown) {
  EXPECT_NEAR(mass_norm(mass_, VertexArray::Constant(mesh_.vertex_count(), 3, 2)), 2 * std::sqrt(3 * total_mass_),
              1e-12 * std::sqrt(total_mass_));
  const BodyFrames reference = shifted({1, 2, 2}, {3, 4, 0}), other = shifted({1.1, 2.4, 1.8}, {3, 4.5, 1});
  const TrajectoryErrors errors = compare(other, reference);
  const double size = std::sqrt((1.0 + 4 + 4) / 3), speed = std::sqrt((9.0 + 16 + 0) / 3);
  EXPECT_NEAR(errors.position.mean, std::sqrt((0.01 + 0.16 + 0.04) / 3) / size, 1e-12);
  EXPECT_NEAR(errors.position.max, 0.4 / size, 1e-12);
  EXPECT_NEAR(errors.position.end, 0.2 / size, 1e-12);
  EXPECT_NEAR(errors.velocity.mean, std::sqrt((0 + 0.25 + 1) / 3) / speed, 1e-12);
  EXPECT_NEAR(errors.velocity.max, 1 / speed, 1e-12);
  EXPECT_NEAR(errors.velocity.end, 1 / speed, 1e-12);
  EXPECT_EQ(errors.worst_frame, 1U);
  EXPECT_FALSE(errors.shape);
}

// All are over one size, whichever two are apart.
TEST_F(ErrorMetrics, BetweenTwoMotionsAreOverTheSizeOfAThird) {
  const BodyFrames full = shifted({1, 2, 2}, {}), a = shifted({1.1, 2.4, 1.8}, {}), b = shifted({0, 2.4, 1}, {});
  const RelativeError error = headline_distance(a, b, full, mesh_.vertices, mass_, false);
  const double size = std::sqrt((1.0 + 4 + 4) / 3);
  EXPECT_NEAR(error.mean, std::sqrt((1.21 + 0 + 0.64) / 3) / size, 1e-12);
  EXPECT_NEAR(error.max, 1.1 / size, 1e-12);
  EXPECT_NEAR(error.end, 0.8 / size, 1e-12);
  EXPECT_NEAR(error.settled, 0.8 / size, 1e-12);
}

TEST_F(ErrorMetrics, OfShapesObeyTheTriangleInequality) {
  const auto turned = [&](double size) {
    BodyFrames frames = still();
    for (VertexArray& x : frames.positions) {
      const Eigen::Quaterniond turn =
          Eigen::Quaterniond(Eigen::Vector4d(random_field(1).topRows<1>().sum(), 1, -1, 0.5)).normalized();
      x = (x + random_field(size)) * turn.toRotationMatrix().transpose();
      x.rowwise() += random_field(3).row(0);
    }
    return frames;
  };
  const BodyFrames full = turned(0.1), a = turned(0.1), b = turned(0.05);
  const auto apart = [&](const BodyFrames& one, const BodyFrames& other) {
    return headline_distance(one, other, full, mesh_.vertices, mass_, true);
  };
  const RelativeError direct = apart(a, full), first = apart(b, full), second = apart(a, b);
  for (const auto member : {&RelativeError::mean, &RelativeError::max, &RelativeError::end, &RelativeError::settled}) {
    EXPECT_GT(direct.*member, 0.1);
    EXPECT_LE(direct.*member, first.*member + second.*member);
  }
  const TrajectoryErrors errors = compare(a, full, true);
  EXPECT_NEAR(direct.mean, errors.shape.value().mean, 1e-12);
  EXPECT_NEAR(direct.settled, errors.shape->settled, 1e-12);
}

// Norms against the integral over each tet of the interpolated field, by its closed form.
TEST_F(ErrorMetrics, UseTheConsistentMass) {
  const Eigen::VectorXd density = Eigen::VectorXd::LinSpaced(mesh_.tet_count(), 500, 1500);
  const Eigen::VectorXd volumes = tet_volumes(mesh_);
  const VertexArray field = random_field(1);
  double square = 0;
  for (Eigen::Index t = 0; t < mesh_.tet_count(); ++t)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        square += density[t] * volumes[t] / 20 * (i == j ? 2 : 1) *
                  field.row(mesh_.tets(t, i)).dot(field.row(mesh_.tets(t, j)));
  EXPECT_NEAR(mass_norm(mass_, field), std::sqrt(square), 1e-12 * std::sqrt(square));
}

// At 20 times the last tenth are those from 18 on; the size is that of all.
TEST_F(ErrorMetrics, OfTheSettledBodyAreThoseOfTheLastTenth) {
  BodyFrames reference, other;
  for (int i = 1; i <= 20; ++i) {
    const double difference = i < 18 ? 0.5 : 0.01 * i;
    for (const auto& [frames, shift] : {std::pair(&reference, 2.0), std::pair(&other, 2 + difference)}) {
      frames->times.push_back(0.1 * i);
      frames->positions.emplace_back(mesh_.vertices);
      frames->positions.back().col(2).array() += shift;
      frames->velocities.push_back(VertexArray::Constant(mesh_.vertex_count(), 3, shift));
      for (auto* energy : {&frames->kinetic, &frames->elastic, &frames->potential}) energy->push_back(0);
    }
  }
  const TrajectoryErrors errors = compare(other, reference);
  const double expected = std::sqrt((0.18 * 0.18 + 0.19 * 0.19 + 0.2 * 0.2) / 3) / 2;
  EXPECT_NEAR(errors.position.settled, expected, 1e-12);
  EXPECT_NEAR(errors.velocity.settled, expected, 1e-12);
  EXPECT_NEAR(errors.position.max, 0.25, 1e-12);
  EXPECT_NEAR(compare(shifted({1.1, 2.4, 1.8}, {}), shifted({1, 2, 2}, {})).position.settled,
              0.2 / std::sqrt((1.0 + 4 + 4) / 3), 1e-12)
      << "of few frames the last alone";
}

TEST_F(ErrorMetrics, HaveAHeadline) {
  BodyFrames reference = still(), other = still();
  for (std::size_t i = 0; i < 3; ++i) reference.positions[i] += random_field(0.05);
  other.positions[0].col(0).array() += 5;  // farthest in position, by a shift
  other.positions[2] += random_field(0.5);
  const TrajectoryErrors clamped = compare(other, reference), free = compare(other, reference, true);
  EXPECT_EQ(clamped.headline().mean, clamped.position.mean);
  EXPECT_EQ(clamped.worst_frame, 0U);
  EXPECT_EQ(free.headline().mean, free.shape.value().mean);
  EXPECT_NE(free.headline().mean, free.position.mean);
  EXPECT_EQ(free.worst_frame, 2U);
}

TEST_F(ErrorMetrics, OfReboundsAreThoseOfTheirVelocities) {
  BodyFrames reference = still(), other = still();
  reference.rebound = Rebound{1, {0, 0, 4}};
  EXPECT_FALSE(compare(other, reference).rebound);
  other.rebound = Rebound{2, {3, 0, 4}};
  EXPECT_EQ(compare(other, reference).rebound, 0.75);
}

TEST_F(ErrorMetrics, OfTheSameMotionVanish) {
  BodyFrames frames = shifted({1, 2, 3}, {1, 1, 1});
  for (VertexArray& x : frames.positions) x += random_field(0.1);
  const TrajectoryErrors errors = compare(frames, frames, true);
  EXPECT_EQ(errors.position.max, 0);
  EXPECT_EQ(errors.velocity.max, 0);
  EXPECT_EQ(errors.energy, 0);
  EXPECT_LE(errors.shape.value().max, 1e-12);
  EXPECT_LE(errors.nearest_phase.max, 1e-12);
}

TEST_F(ErrorMetrics, OfNothingAreNothingOrInfinite) {
  const TrajectoryErrors none = compare(still(), still(), true);
  EXPECT_EQ(none.position.mean, 0);
  EXPECT_EQ(none.velocity.mean, 0);
  EXPECT_EQ(none.energy, 0);
  EXPECT_EQ(none.shape.value().mean, 0);
  BodyFrames moved = shifted({0, 0.1, 0}, {0, 0.1, 0});
  moved.elastic[0] = 1;
  const TrajectoryErrors endless = compare(moved, still());
  EXPECT_EQ(endless.position.mean, kInfinity);
  EXPECT_EQ(endless.position.max, kInfinity);
  EXPECT_EQ(endless.position.end, 0) << "where it is again what it should be";
  EXPECT_EQ(endless.velocity.mean, kInfinity);
  EXPECT_EQ(endless.energy, kInfinity);
}

TEST_F(ErrorMetrics, OfEnergyAreOverTheLargestThatMovesOrDeforms) {
  BodyFrames reference = still(), other = still();
  reference.kinetic = {1, 5, 2};
  reference.elastic = {0, 3, 1};
  reference.potential = {-100, -105, -102};  // its zero is anywhere
  other.kinetic = {1, 5, 2};
  other.elastic = {0, 2, 1};
  other.potential = {-100, -104.5, -101.8};
  EXPECT_NEAR(compare(other, reference).energy, 0.5 / 8, 1e-12);
}

TEST_F(ErrorMetrics, OfShapeLeaveOutHowABodyIsMoved) {
  BodyFrames reference = still(), other = still();
  const VertexArray deformation = random_field(0.05), difference = random_field(0.01);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto angle = static_cast<double>(i);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    reference.positions[i] += deformation;
    other.positions[i] = ((reference.positions[i] + difference) * turn.transpose()).rowwise() +
                         Eigen::RowVector3d(10 * angle, -3, angle);
  }
  const TrajectoryErrors errors = compare(other, reference, true);
  EXPECT_GT(errors.position.max, 10);
  // The same in each frame; the fit takes a little more away.
  const double expected = mass_norm(mass_, difference) / mass_norm(mass_, deformation);
  EXPECT_NEAR(errors.shape->mean, errors.shape->max, 1e-10);
  EXPECT_LE(errors.shape->mean, 1.3 * expected);
  EXPECT_GE(errors.shape->mean, 0.6 * expected);
}

// No turn or shift of the fitted body brings it nearer.
TEST_F(ErrorMetrics, FitIsTheBestByBruteForce) {
  const VertexArray fixed = mesh_.vertices + random_field(0.1);
  const Eigen::Matrix3d far = Eigen::AngleAxisd(2.5, Eigen::Vector3d(3, -1, 1).normalized()).toRotationMatrix();
  const VertexArray moved = (mesh_.vertices * far.transpose()).rowwise() + Eigen::RowVector3d(5, 6, 7);
  const VertexArray best = fitted(mass_, moved, fixed);
  const double least = mass_norm(mass_, best - fixed);
  EXPECT_LT(least, 0.5 * mass_norm(mass_, mesh_.vertices - fixed) + least) << "a fit at all";
  for (int axis = 0; axis < 3; ++axis)
    for (const double step : {-1e-3, 1e-3}) {
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
      const VertexArray turned = best * turn.transpose();
      const VertexArray shifted = best.rowwise() + step * Eigen::RowVector3d::Unit(axis);
      EXPECT_GT(mass_norm(mass_, turned - fixed), least);
      EXPECT_GT(mass_norm(mass_, shifted - fixed), least);
    }
  EXPECT_NEAR((best.row(0) - best.row(5)).norm(), (moved.row(0) - moved.row(5)).norm(), 1e-12) << "rigid";
  EXPECT_LE(mass_norm(mass_, fitted(mass_, moved, mesh_.vertices) - mesh_.vertices), 1e-11) << "back to where it was";
}

}  // namespace
}  // namespace exmat::precompute

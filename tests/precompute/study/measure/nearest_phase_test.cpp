#include "precompute/study/measure/nearest_phase.h"

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

#include "common/mesh/geometry.h"
#include "precompute/study/measure/error_metrics.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

constexpr int kFrames = 200;     // over one second
constexpr double kReach = 0.05;  // of that
constexpr double kSpeed = 3;     // [m/s]
constexpr double kPi = std::numbers::pi;
constexpr double kOmega = 4 * kPi;  // two swings

class NearestPhase : public testing::Test {
 protected:
  NearestPhase() : mass_(scalar_mass(mesh_, Eigen::VectorXd::LinSpaced(mesh_.tet_count(), 500, 1500))) {
    std::mt19937 random{5};
    std::normal_distribution<double> value;
    field_ = VertexArray::NullaryExpr(mesh_.vertex_count(), 3, [&] { return 0.02 * value(random); });
    unit_ = mass_norm(mass_, VertexArray::Ones(mesh_.vertex_count(), 3)) / std::sqrt(3);
  }

  BodyFrames motion(const std::function<VertexArray(double)>& at) const {
    BodyFrames frames;
    for (int i = 1; i <= kFrames; ++i) {
      frames.times.push_back(static_cast<double>(i) / kFrames);
      frames.positions.push_back(at(frames.times.back()));
      frames.velocities.push_back(VertexArray::Zero(mesh_.vertex_count(), 3));
    }
    frames.kinetic = frames.elastic = frames.potential = std::vector<double>(kFrames, 0);
    return frames;
  }
  /// As a whole along x, with constant speed.
  BodyFrames moving(double delay) const {
    return motion([&](double t) {
      VertexArray positions = mesh_.vertices;
      positions.col(0).array() += kSpeed * (t - delay);
      return positions;
    });
  }
  /// A shape that swings, of a body that also flies and turns.
  BodyFrames swinging(double amplitude, double delay, double spin) const {
    return motion([&](double t) -> VertexArray {
      const VertexArray shape = mesh_.vertices + amplitude * std::sin(kOmega * (t - delay)) * field_;
      const Eigen::Matrix3d turn =
          Eigen::AngleAxisd(spin * t, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
      return (shape * turn.transpose()).rowwise() + Eigen::RowVector3d(t * spin, 1, -t * t);
    });
  }
  TrajectoryErrors errors(const BodyFrames& frames, const BodyFrames& reference, bool free_body) const {
    return trajectory_errors(frames, reference, mesh_.vertices, mass_, free_body);
  }

  TetMesh mesh_ = test::box_mesh({3, 2, 2}, {1.0, 0.5, 0.4});
  SparseMatrix mass_;
  VertexArray field_;
  double unit_ = 0;  // |.|_M of a shift by 1 m
};

// A delay within reach is made good but for the first frames, which are before the first of the reference. Squares
// cancel to 1e-16 of those of the way, 3 m.
TEST_F(NearestPhase, OfASteadyMotionIsWhatIsBeyondReach) {
  for (const double delay : {0.0, 0.03, -0.03, 0.08, -0.08}) {
    const auto found = nearest_distances(moving(delay), moving(0), mass_, kReach, false);
    for (int i = 1; i <= kFrames; ++i) {
      const double time = static_cast<double>(i) / kFrames, wanted = time - delay;
      const double from = std::max(time - kReach, 1.0 / kFrames), to = std::min(time + kReach, 1.0);
      const double expected = kSpeed * unit_ * std::abs(wanted - std::clamp(wanted, from, to));
      EXPECT_NEAR(found[static_cast<std::size_t>(i - 1)], expected, 2e-7 * kSpeed * unit_) << delay << " " << time;
    }
  }
}

// Late by four and a half frames, a quarter of a radian: a shape error of 2 sin(omega delay / 2) at the same time. At
// the nearest phase what is left is of the first five frames, which are before those of the reference, and of the
// chords from frame to frame, 1 - cos(omega / 2F) at the turning points. Early likewise of the last five. The reference
// turns by 1.5 radians from frame to frame.
TEST_F(NearestPhase, TellsADelayFromAnotherShape) {
  constexpr double kDelay = 0.0225, kFrame = 1.0 / kFrames, kSpin = 300;
  const double chords = 1 - std::cos(kOmega * kFrame / 2);
  double before = 0, after = 0;
  for (int i = 1; i <= 5; ++i) {
    before += std::pow(std::sin(kOmega * (i * kFrame - kDelay)) - std::sin(kOmega * kFrame), 2);
    after += std::pow(std::sin(kOmega * (kDelay - (i - 1) * kFrame)), 2);
  }
  const double size = kFrames / 2.0;  // of sin^2
  const TrajectoryErrors late = errors(swinging(1, kDelay, 7), swinging(1, 0, kSpin), true);
  EXPECT_NEAR(late.shape.value().mean, 2 * std::sin(kOmega * kDelay / 2), 0.01);
  EXPECT_GT(late.position.mean, 0.5) << "it turns and flies otherwise";
  EXPECT_NEAR(late.nearest_phase.mean, std::sqrt(before / size), chords);
  EXPECT_LE(late.nearest_phase.settled, chords);
  const TrajectoryErrors early = errors(swinging(1, -kDelay, 7), swinging(1, 0, kSpin), true);
  EXPECT_NEAR(early.nearest_phase.mean, std::sqrt(after / size), chords);
}

// The swing is 1.2 times as large: no phase makes good what is beyond the reference's largest. The field of the swing
// is turned by what the fit takes away, which leaves amplitudes as they are to first order of 0.02.
TEST_F(NearestPhase, LeavesAnotherShapeAsItIs) {
  constexpr double kLarger = 1.2;
  const TrajectoryErrors larger = errors(swinging(kLarger, 0, 0), swinging(1, 0, 3), true);
  double sum = 0, size = 0;
  for (int i = 1; i <= kFrames; ++i) {
    const double time = static_cast<double>(i) / kFrames, wanted = kLarger * std::sin(kOmega * time);
    double least = 10;
    for (double t = std::max(time - kReach, 1.0 / kFrames); t <= std::min(time + kReach, 1.0); t += 1e-5)
      least = std::min(least, std::abs(wanted - std::sin(kOmega * t)));
    sum += least * least;
    size += std::sin(kOmega * time) * std::sin(kOmega * time);
  }
  const double expected = std::sqrt(sum / size);
  EXPECT_GT(expected, 0.1);
  EXPECT_NEAR(larger.shape.value().mean, kLarger - 1, 0.003);
  EXPECT_NEAR(larger.nearest_phase.mean, expected, 0.003);
}

// Later by 8 % of the duration of a steady motion: 3 % are beyond reach, relative to the root mean square of the way.
TEST_F(NearestPhase, ReachesFivePercentOfTheDuration) {
  double square = 0;
  for (int i = 1; i <= kFrames; ++i) square += std::pow(static_cast<double>(i) / kFrames, 2);
  const TrajectoryErrors late = errors(moving(0.08), moving(0), false);
  EXPECT_NEAR(late.position.end, 0.08 / std::sqrt(square / kFrames), 1e-7);
  EXPECT_NEAR(late.nearest_phase.end, 0.03 / std::sqrt(square / kFrames), 1e-6);
}

// A mirrored body is another shape: it is turned, never reflected.
TEST_F(NearestPhase, TurnsBodiesAndDoesNotReflectThem) {
  const VertexArray shape = mesh_.vertices + field_;
  VertexArray mirrored = shape;
  mirrored.col(0) *= -1;
  const auto found = nearest_distances(motion([&](double) { return mirrored; }), motion([&](double) { return shape; }),
                                       mass_, kReach, true);
  const double expected = mass_norm(mass_, fitted(mass_, mirrored, shape) - shape);
  EXPECT_GT(expected, 0.01 * unit_) << "it is the same shape";
  for (const double distance : found) EXPECT_NEAR(distance, expected, 1e-6 * expected);
}

TEST_F(NearestPhase, IsNeverMoreThanAtTheSameTime) {
  for (const bool free_body : {false, true}) {
    const TrajectoryErrors same = errors(swinging(1, 0, 2), swinging(1, 0, 2), free_body);
    EXPECT_LE(same.nearest_phase.max, 1e-12);
    const TrajectoryErrors other = errors(swinging(0.7, 0.4, 1), swinging(1, 0, 2), free_body);
    EXPECT_LT(other.nearest_phase.mean, other.headline().mean);
    EXPECT_LE(other.nearest_phase.max, other.headline().max);
    EXPECT_LE(other.nearest_phase.end, other.headline().end);
  }
}

// Few frames are farther apart than the reach: the way between them serves.
TEST_F(NearestPhase, GoesBetweenFrames) {
  BodyFrames few = moving(0), late = moving(0.03);
  for (BodyFrames* frames : {&few, &late}) {
    frames->times = {frames->times[99], frames->times[199]};
    frames->positions = {frames->positions[99], frames->positions[199]};
  }
  const auto found = nearest_distances(late, few, mass_, kReach, false);
  EXPECT_NEAR(found[0], kSpeed * 0.03 * unit_, 1e-7 * kSpeed * unit_) << "nothing is before";
  EXPECT_LE(found[1], 1e-7 * kSpeed * unit_);
}

}  // namespace
}  // namespace exmat::precompute

#include "precompute/training/training_segments.h"

#include <gtest/gtest.h>
#include <numbers>

namespace exmat::precompute {
namespace {

constexpr int kMany = 4000;

struct Box {
  VertexArray vertices;
  std::vector<Eigen::Index> surface;

  Box() : vertices(8, 3) {
    for (Eigen::Index v = 0; v < 8; ++v) {
      const auto bit = [v](int i) { return static_cast<double>(v >> i & 1); };
      vertices.row(v) = Eigen::RowVector3d(2 * bit(0), bit(1), bit(2));
      surface.push_back(v);
    }
  }
  SegmentBody body() const { return {vertices, {1, 0.5, 0.5}, surface, std::sqrt(6.0), 10}; }
};

TrainingLoads some_loads() {
  TrainingLoads loads;
  loads.gravity = {0, 0, -9};
  loads.forces = {{{1, 2}, {0, 3, 0}}, {{4}, {5, 0, 0}, 0, 1}};
  loads.examples = {{400, 10, 0.8}};
  return loads;
}

std::vector<Segment> segments_of(const std::vector<Chain>& chains) {
  std::vector<Segment> all;
  for (const Chain& chain : chains) all.insert(all.end(), chain.begin(), chain.end());
  return all;
}

TEST(TrainingSegments, AreAsManyAsAskedForAndSixInTenBeginAtRest) {
  const Box box;
  const auto chains = draw_segments(some_loads(), box.body(), {kMany, 2.0, 1});
  EXPECT_EQ(std::ssize(segments_of(chains)), kMany);
  // Binomial: 4 standard deviations.
  EXPECT_NEAR(static_cast<double>(chains.size()) / kMany, 0.6, 4 * std::sqrt(0.24 / kMany));
}

TEST(TrainingSegments, VaryLoadsAboutThoseGiven) {
  const Box box;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero(), force = Eigen::Vector3d::Zero();
  double log_stiffness = 0;
  int ceased = 0;
  for (const Segment& segment : segments_of(draw_segments(some_loads(), box.body(), {kMany, 2.0, 1}))) {
    EXPECT_GE(segment.duration, 1.4);
    EXPECT_LE(segment.duration, 2.6);
    gravity += segment.gravity / kMany;
    force += segment.forces.front().force / kMany;
    log_stiffness += std::log(segment.examples.front().stiffness / 400) / kMany;
    EXPECT_LE(std::abs(std::log(segment.examples.front().stiffness / 400)), 0.7);
    EXPECT_GE(segment.examples.front().bias, 0.5);
    EXPECT_LE(segment.examples.front().bias, 1);
    ceased += segment.forces.size() == 1;
  }
  // Means of the distributions, by 5 standard errors of their widest component.
  EXPECT_LE((gravity - Eigen::Vector3d(0, 0, -9)).norm(), 5 * 9 * 0.5 / std::sqrt(kMany));
  EXPECT_LE((force - Eigen::Vector3d(0, 2.7, 0)).norm(), 5 * 3 * 0.6 / std::sqrt(kMany));
  EXPECT_NEAR(log_stiffness, 0, 5 * 0.41 / std::sqrt(kMany));
  EXPECT_NEAR(static_cast<double>(ceased) / kMany, 0.3, 4 * std::sqrt(0.21 / kMany));
}

TEST(TrainingSegments, PushAnywhereWhereTheDirectionIsNotKnown) {
  const Box box;
  TrainingLoads loads = some_loads();
  loads.any_direction = loads.any_gravity = true;
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (const Segment& segment : segments_of(draw_segments(loads, box.body(), {kMany, 2.0, 1})))
    force += segment.forces.front().force / kMany;
  EXPECT_LE(force.norm(), 5 * 3 / std::sqrt(kMany));
}

// Each thrown body begins outside of its obstacle, nearer than a tenth of its size, and moves towards it.
TEST(TrainingSegments, ThrowBodiesAtWhatTheyDoNotTouchYet) {
  const Box box;
  TrainingLoads loads;
  loads.obstacle = TrainingObstacle{1e6, 10, 0.5};
  loads.velocity = {-2, 0, 1};
  loads.spin = {0, 3, 0};
  const auto chains = draw_segments(loads, box.body(), {40, 2.0, 1});
  EXPECT_EQ(chains.size(), 60U);
  int turned = 0;
  for (const Chain& chain : chains) {
    ASSERT_EQ(chain.size(), 1U);
    const Segment& segment = chain.front();
    const auto& plane = std::get<runtime::Plane>(segment.obstacle->shape);
    const Eigen::Vector3d centre = box.body().centre.transpose();
    const Eigen::Matrix3d rotation = segment.motion.orientation.toRotationMatrix();
    double least = 10;
    for (const auto& vertex : box.vertices.rowwise()) {
      const Eigen::Vector3d placed = centre + rotation * (vertex.transpose() - centre);
      least = std::min(least, (placed - plane.point).dot(plane.normal));
    }
    EXPECT_GT(least, 0);
    EXPECT_LT(least, 0.1 * std::sqrt(6.0));
    EXPECT_LT(segment.motion.linear_velocity.dot(plane.normal), 0);
    turned += Eigen::AngleAxisd(segment.motion.orientation).angle() > 1.5;
  }
  EXPECT_GT(turned, 10);
  EXPECT_LT(turned, 35);
}

TEST(TrainingSegments, PushPatchesOfTheSurface) {
  const Box box;
  TrainingLoads loads;
  loads.patches = true;
  bool any = false;
  for (const Segment& segment : segments_of(draw_segments(loads, box.body(), {50, 1, 3})))
    for (const VertexForceConfig& patch : segment.forces) {
      any = true;
      EXPECT_FALSE(patch.vertices.empty());
      EXPECT_GT(patch.force.norm(), 0);
    }
  EXPECT_TRUE(any);
}

TEST(TrainingSegments, DependOnTheSeedAlone) {
  const Box box;
  const auto text = [&](std::uint64_t seed) {
    std::vector<double> numbers;
    for (const Segment& segment : segments_of(draw_segments(some_loads(), box.body(), {20, 2.0, seed})))
      numbers.insert(numbers.end(), {segment.duration, segment.gravity[0], segment.forces.front().force[1],
                                     segment.examples.front().stiffness});
    return numbers;
  };
  EXPECT_EQ(text(1), text(1));
  EXPECT_NE(text(1), text(2));
}

}  // namespace
}  // namespace exmat::precompute

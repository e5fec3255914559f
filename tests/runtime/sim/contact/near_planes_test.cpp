#include "runtime/sim/contact/near_planes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <set>
#include <utility>

#include "runtime/sim/contact/contact.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace near_planes_test {

using test::random_matrix;
using test::random_vector;

constexpr Eigen::Index kVertices = 200, kModes = 4;
constexpr double kMargin = 0.02, kTimeStep = 1e-3;  // [m], [s]

/// Vertices on a ball of radius 0.5, neighbours moving alike.
ContactData ball() {
  ContactData data;
  data.positions.resize(kVertices, 3);
  data.areas = Eigen::VectorXd::Ones(kVertices);
  data.basis.resize(3 * kVertices, kModes);
  const RowMatrix linear = random_matrix(3 * kModes, 3, 2);
  for (Eigen::Index i = 0; i < kVertices; ++i) {
    const Eigen::Vector3d X = 0.5 * random_vector(3, static_cast<std::uint32_t>(i + 100)).normalized();
    data.positions.row(i) = X.transpose();
    data.basis.middleRows<3>(3 * i) = (linear * X).reshaped<Eigen::RowMajor>(3, kModes);
  }
  return data;
}

/// A floor and a wall.
Obstacles corner(double height) {
  return {Obstacle{Plane{{0, height, 0}, {0, 1, 0}}, RigidMotion(), 1e4},
          Obstacle{Plane{{-1, 0, 0}, Eigen::Vector3d(1, 0.1, 0).normalized()}, RigidMotion(), 1e4}};
}

using Pairs = std::set<std::pair<int, int>>;  // vertex and obstacle

Pairs found(const ContactWorkspace& workspace) {
  Pairs pairs;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i)
    pairs.emplace(workspace.candidates[i].vertex, workspace.candidates[i].obstacle);
  return pairs;
}

Pairs brute_force(const ContactSet& set, const BodyPose& pose, const Obstacles& obstacles) {
  Pairs pairs;
  for (int vertex = 0; vertex < set.vertices(); ++vertex)
    for (std::size_t i = 0; i < obstacles.size(); ++i)
      if (signed_distance(obstacles[i]->shape, pose.position + set.world_arm(vertex, pose)) <= kMargin)
        pairs.emplace(vertex, static_cast<int>(i));
  return pairs;
}

// A ball that rolls, rises, deforms and now and then is put elsewhere, in a corner whose floor moves now and then: at
// each step its candidates are those of a search of all vertices, and most steps need no search of the tree.
TEST(NearPlanes, ChangeNoCandidate) {
  const ContactSet set(ball());
  constexpr int kSteps = 3000;
  NearPlanes near = set.make_state(2).near_planes;
  ContactWorkspace workspace(set, 2);
  int served = 0;
  std::size_t most = 0;
  for (int step = 0; step < kSteps; ++step) {
    const double t = step / static_cast<double>(kSteps);
    Placement place;
    place.position = {-0.55 + 0.3 * std::sin(9 * t), 0.5 + 0.03 * std::sin(20 * t), 0.4 * t};
    if (step / 300 % 2 == 1) place.position.x() += 0.05;
    place.rotation = Eigen::AngleAxisd(3 * t, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix();
    const Eigen::VectorXd q = 0.1 * (1 + std::sin(11 * t)) * random_vector(kModes, 7);
    const Obstacles obstacles = corner(step / 700 % 2 == 1 ? 0.02 : 0);
    const BodyPose pose{place, q};
    set.gather(obstacles, step * kTimeStep, kTimeStep, pose, kMargin, near, workspace);
    if (workspace.visited_nodes == 0) ++served;
    const Pairs pairs = found(workspace);
    ASSERT_EQ(pairs, brute_force(set, pose, obstacles)) << step;
    most = std::max(most, pairs.size());
  }
  EXPECT_GT(most, 5u);
  EXPECT_GT(served, kSteps / 2);
}

// A search that goes farther is worth nothing to a body that turns by a radian each step: most steps do with a plain
// one.
TEST(NearPlanes, GiveUpForABodyThatTheyDoNotServe) {
  const ContactSet set(ball());
  NearPlanes near = set.make_state(2).near_planes;
  ContactWorkspace workspace(set, 2);
  const Obstacles obstacles = corner(0);
  const Eigen::VectorXd q = Eigen::VectorXd::Zero(kModes);
  int plain = 0;
  for (int step = 0; step < 100; ++step) {
    Placement place;
    place.position = {0, 0.5, 0};
    place.rotation = Eigen::AngleAxisd(step, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    set.gather(obstacles, 0, kTimeStep, {place, q}, kMargin, near, workspace);
    EXPECT_GT(workspace.visited_nodes, 0);
    if (near.radius() < 0) ++plain;
  }
  EXPECT_GT(plain, 90);
}

TEST(NearPlanes, ServeOnlyPlanesThatStand) {
  const Plane plane;
  const RigidMotion motion(
      {{0, {0, 0, 0}, Eigen::Quaterniond::Identity()}, {1, {0, 1, 0}, Eigen::Quaterniond::Identity()}});
  const Obstacle standing{plane, RigidMotion(), 1}, moved{plane, motion, 1}, ball_obstacle{Sphere(), RigidMotion(), 1};
  const auto placed = [](const Obstacle& obstacle) { return PlacedObstacle(obstacle, 0.5, kTimeStep); };
  EXPECT_TRUE(NearPlanes::serve(std::vector{placed(standing)}));
  EXPECT_FALSE(NearPlanes::serve(std::vector{placed(standing), placed(moved)}));
  EXPECT_FALSE(NearPlanes::serve(std::vector{placed(standing), placed(ball_obstacle)}));
}

// No vertex goes farther, some go as far by one mode, and the norm tells where it is the better bound.
TEST(MovementBound, HoldsForEveryVertexAndIsReached) {
  const ContactSet set(ball());
  const MovementBound& bound = set.tree().movement();
  const auto farthest = [&](const Eigen::VectorXd& q) {
    double most = 0;
    for (int vertex = 0; vertex < set.vertices(); ++vertex)
      most = std::max(most, Eigen::Vector3d(set.basis_rows(vertex) * q).norm());
    return most;
  };
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const Eigen::VectorXd q = random_vector(kModes, seed);
    EXPECT_LE(farthest(q), (1 + 1e-14) * bound.of(q));
  }
  for (Eigen::Index k = 0; k < kModes; ++k) {
    const Eigen::VectorXd q = 2 * Eigen::VectorXd::Unit(kModes, k);
    EXPECT_NEAR(farthest(q), bound.of(q), 1e-14 * bound.of(q));
  }
  EXPECT_LT(bound.norm * std::sqrt(kModes), bound.modes.sum());
}

// By all q of one length on a fine grid of directions: none has more, and one has nearly as much.
TEST(MovementBound, TellsTheMostThatWeightsMayHave) {
  const MovementBound bound{2, Eigen::RowVector2d(1, 1.9)};
  for (const Eigen::RowVector2d& weights :
       {Eigen::RowVector2d(1, 0), Eigen::RowVector2d(0.3, 1), Eigen::RowVector2d(1, 1)}) {
    double most = 0;
    constexpr int kDirections = 100'000;
    for (int i = 0; i < kDirections; ++i) {
      const double angle = 0.5 * std::numbers::pi * i / (kDirections - 1);
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      most = std::max(most, weights.dot(direction) * 0.7 / bound.of(direction));
    }
    EXPECT_NEAR(bound.most(weights, 0.7), most, 1e-8);
  }
}

}  // namespace near_planes_test
}  // namespace exmat::runtime

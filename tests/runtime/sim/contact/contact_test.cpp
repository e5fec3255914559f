#include "runtime/sim/contact/contact.h"

#include <gtest/gtest.h>
#include <numbers>
#include <set>

#include "common/core/decompositions.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"
#include "tests/support/surfaces.h"

namespace exmat::runtime {
namespace {

using test::random_matrix;
using test::random_vector;

constexpr Eigen::Index kVertices = 300, kModes = 5;

/// Vertices on a ball of radius 0.5 about (0.2, 0, 0), neighbours moving alike.
ContactData ball_data() {
  ContactData data;
  data.positions.resize(kVertices, 3);
  data.areas = (0.01 * (random_vector(kVertices, 1).array() + 2)).matrix();
  data.basis.resize(3 * kVertices, kModes);
  const RowMatrix linear = random_matrix(3 * kModes, 3, 2), constant = 0.1 * random_matrix(3 * kModes, 1, 3);
  for (Eigen::Index i = 0; i < kVertices; ++i) {
    const Eigen::Vector3d X = 0.5 * random_vector(3, static_cast<std::uint32_t>(i + 100)).normalized();
    data.positions.row(i) = X.transpose() + Eigen::RowVector3d(0.2, 0, 0);
    data.basis.middleRows<3>(3 * i) = (linear * X + constant).reshaped<Eigen::RowMajor>(3, kModes);
  }
  return data;
}

Obstacle obstacle(Shape shape, double damping = 0, double friction = 0, RigidMotion motion = RigidMotion()) {
  return {std::move(shape), std::move(motion), 2e4, damping, friction};
}

Plane floor_at(double height) { return {{0, height, 0}, {0, 1, 0}}; }

/// Around and under the ball, all within reach, with damping and friction.
Obstacles many_obstacles(double damping = 300) {
  const RigidMotion motion({{0, {0, 0, 0}, Eigen::Quaterniond::Identity()},
                            {1, {0.1, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitX()))}});
  return {obstacle(floor_at(-0.4), damping, 0.5), obstacle(Sphere{{0.9, 0, 0}, 0.4}, damping, 0.3),
          obstacle(Box{{-0.4, 0, 0}, {0.3, 0.2, 0.25}, Eigen::Matrix3d::Identity()}, damping, 0.8, motion),
          obstacle(Capsule{{0, 0, 0.6}, {0.4, 0, 0.6}, 0.25}, damping, 0.2)};
}

/// A body in the middle of a step.
struct Scenario {
  explicit Scenario(const Obstacles& given, std::uint32_t seed = 5)
      : obstacles(given),
        set(ball_data(), {0.2, 0, 0}),
        workspace(set, given.size()),
        state(set.make_state(given.size())),
        position(Eigen::Vector3d(0.2, 0, 0) + 0.05 * random_vector(3, seed)),
        rotation(Eigen::AngleAxisd(0.8, random_vector(3, seed + 1).normalized()).toRotationMatrix()),
        q(0.08 * random_vector(kModes, seed + 2)),
        linear(random_vector(3, seed + 3)),
        angular(random_vector(3, seed + 4)),
        v(random_vector(kModes, seed + 5)) {}

  BodyPose pose() const { return {{Eigen::Vector3d::Zero(), position, rotation}, q}; }
  BodyVelocity velocity() const { return {{linear, angular}, v}; }

  /// With contacts of the step before, so that there is friction.
  void begin() {
    for (int pass = 0; pass < 2; ++pass) {
      set.gather(obstacles, kTime, kTimeStep, pose(), 0.05, state.near_planes, workspace);
      set.freeze(pose(), velocity(), velocity(), kTimeStep, state, workspace);
      set.evaluate(pose(), workspace);
      if (pass == 0) set.commit(pose(), workspace, state);
    }
  }
  void evaluate() { set.evaluate(pose(), workspace); }

  static constexpr double kTime = 0.5, kTimeStep = 1e-3;
  Obstacles obstacles;
  ContactSet set;
  ContactWorkspace workspace;
  ContactState state;
  Eigen::Vector3d position;
  Eigen::Matrix3d rotation;
  Eigen::VectorXd q;
  Eigen::Vector3d linear, angular;
  Eigen::VectorXd v;
};

/// By a world translation, a turn and a change of q.
void displace(Scenario& scenario, const Eigen::VectorXd& z) {
  scenario.position += z.head<3>();
  const Eigen::Vector3d turn = z.segment<3>(3);
  if (turn.norm() > 0)
    scenario.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * scenario.rotation;
  scenario.q += z.tail(kModes);
}

Eigen::VectorXd total_force(const Scenario& scenario) {
  Eigen::VectorXd force(6 + kModes);
  force << scenario.workspace.force, scenario.workspace.torque, scenario.workspace.generalised;
  return force;
}

double potential_after(const Scenario& scenario, const Eigen::VectorXd& z) {
  Scenario moved = scenario;
  displace(moved, z);
  return moved.set.potential(moved.pose(), moved.workspace);
}

Eigen::VectorXd force_after(const Scenario& scenario, const Eigen::VectorXd& z) {
  Scenario moved = scenario;
  displace(moved, z);
  moved.evaluate();
  return total_force(moved);
}

Eigen::VectorXd unit_step(Eigen::Index i, double size) { return size * Eigen::VectorXd::Unit(6 + kModes, i); }

void expect_descent(const Obstacles& obstacles, int least_touching) {
  constexpr double kStep = 1e-7;
  Scenario scenario(obstacles);
  scenario.begin();
  ASSERT_GT(scenario.workspace.touching, least_touching);
  displace(scenario, 1e-3 * random_vector(6 + kModes, 77));
  scenario.evaluate();
  const Eigen::VectorXd force = total_force(scenario);
  EXPECT_NEAR(scenario.workspace.potential, potential_after(scenario, unit_step(0, 0)),
              1e-12 * scenario.workspace.potential);
  for (Eigen::Index i = 0; i < force.size(); ++i) {
    const double slope =
        (potential_after(scenario, unit_step(i, kStep)) - potential_after(scenario, unit_step(i, -kStep))) /
        (2 * kStep);
    EXPECT_NEAR(-slope, force[i], 1e-6 * force.norm()) << i;
  }
}

TEST(Contact, ForceIsTheDescentOfThePotential) { expect_descent(many_obstacles(), 20); }

TEST(Contact, ForceOfMeshesAndHeightFieldsIsTheDescentOfThePotential) {
  const SurfaceMesh ball = test::ball_surface(6, 0.4);
  const MeshShape solid{std::make_shared<RigidMesh>(ball.vertices, ball.triangles, 0), {0.8, 0.1, 0}};
  const MeshShape shell{std::make_shared<RigidMesh>(ball.vertices, ball.triangles, 0.1), {-0.35, 0, 0.1}};
  RowMatrix heights(20, 20);
  for (Eigen::Index i = 0; i < heights.size(); ++i) heights(i) = -0.4 + 0.05 * std::sin(static_cast<double>(i));
  const HeightFieldShape hills{std::make_shared<HeightField>(heights, Eigen::Vector2d(0.1, 0.1)), {-1, -1, 0}};
  expect_descent({obstacle(solid, 300, 0.3), obstacle(shell, 300, 0.5), obstacle(hills, 300, 0.8)}, 20);
}

TEST(Contact, StiffnessIsTheDerivativeOfTheForceOnPlanes) {
  constexpr double kStep = 1e-7;
  const Plane slope{{0, -0.3, 0}, Eigen::Vector3d(0.3, 1, -0.2).normalized()};
  Scenario scenario({obstacle(slope, 300, 0.5)});
  scenario.begin();
  ASSERT_GT(scenario.workspace.touching, 20);
  displace(scenario, 1e-4 * random_vector(6 + kModes, 77));
  scenario.evaluate();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(6 + kModes, 6 + kModes);
  scenario.set.add_stiffness(scenario.pose(), scenario.workspace, stiffness);
  const Eigen::MatrixXd full = stiffness.selfadjointView<Eigen::Lower>();
  // In turns the arms change too, and with them torques.
  for (Eigen::Index i = 0; i < 6 + kModes; ++i) {
    if (i >= 3 && i < 6) continue;
    const Eigen::VectorXd column =
        -(force_after(scenario, unit_step(i, kStep)) - force_after(scenario, unit_step(i, -kStep))) / (2 * kStep);
    for (Eigen::Index j = 0; j < 6 + kModes; ++j) {
      if (j >= 3 && j < 6) continue;
      EXPECT_NEAR(column[j], full(j, i), 1e-5 * full.norm()) << i << " " << j;
    }
  }
}

/// 3 x (6 + r) by plain matrices.
Eigen::MatrixXd jacobian(const Scenario& scenario, const ContactData& data, int id) {
  const Eigen::MatrixXd U = data.basis.middleRows(3 * id, 3);
  const Eigen::Vector3d X = data.positions.row(id).transpose() - Eigen::Vector3d(0.2, 0, 0);
  const Eigen::Vector3d arm = scenario.rotation * (X + U * scenario.q);
  Eigen::MatrixXd J(3, 6 + kModes);
  J.leftCols<3>().setIdentity();
  J.middleCols<3>(3) << 0, arm[2], -arm[1], -arm[2], 0, arm[0], arm[1], -arm[0], 0;
  J.rightCols(kModes) = scenario.rotation * U;
  return J;
}

TEST(Contact, AddsUpForcesAndStiffnessOfItsVertices) {
  Scenario scenario(many_obstacles());
  const ContactData data = ball_data();
  scenario.begin();
  Eigen::VectorXd force = Eigen::VectorXd::Zero(6 + kModes);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(6 + kModes, 6 + kModes);
  for (std::size_t i = 0; i < scenario.workspace.candidate_count; ++i) {
    const ContactCandidate& candidate = scenario.workspace.candidates[i];
    const Eigen::MatrixXd J = jacobian(scenario, data, scenario.set.data_index(candidate.vertex));
    const StiffnessFactors factors(candidate);
    const Eigen::Matrix3d K = factors.used() * factors.used().transpose();
    force += J.transpose() * candidate.force;
    expected += J.transpose() * K * J;
  }
  EXPECT_LT((total_force(scenario) - force).norm(), 1e-12 * force.norm());

  const Eigen::MatrixXd noise = random_matrix(6 + kModes, 6 + kModes, 9);
  Eigen::MatrixXd stiffness = noise;
  scenario.set.add_stiffness(scenario.pose(), scenario.workspace, stiffness);
  EXPECT_LT(Eigen::MatrixXd((stiffness - noise - expected).triangularView<Eigen::Lower>()).norm(),
            1e-12 * expected.norm());
  EXPECT_TRUE(Eigen::MatrixXd((stiffness - noise).triangularView<Eigen::StrictlyUpper>()).isZero(0));

  const Eigen::MatrixXd corner = noise.topLeftCorner(kModes, kModes);
  Eigen::MatrixXd reduced = corner;
  scenario.set.add_reduced_stiffness(scenario.pose(), scenario.workspace, reduced);
  const Eigen::MatrixXd expected_corner = expected.bottomRightCorner(kModes, kModes);
  EXPECT_LT(Eigen::MatrixXd((reduced - corner - expected_corner).triangularView<Eigen::Lower>()).norm(),
            1e-12 * expected_corner.norm());
}

TEST(Contact, NeverPullsAndStaysInTheFrictionCone) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    Scenario scenario(many_obstacles(), 31 * seed);
    scenario.linear *= 5;
    scenario.begin();
    scenario.set.refresh_friction(scenario.workspace);
    scenario.evaluate();
    for (std::size_t i = 0; i < scenario.workspace.candidate_count; ++i) {
      const ContactCandidate& candidate = scenario.workspace.candidates[i];
      const double friction = scenario.obstacles[static_cast<std::size_t>(candidate.obstacle)]->friction;
      const double normal = candidate.force.dot(candidate.normal);
      const Eigen::Vector3d tangential = candidate.force - normal * candidate.normal;
      EXPECT_GE(normal, -1e-12);
      EXPECT_LE(tangential.norm(), (friction + 0.02) * candidate.normal_force + 1e-12);
    }
  }
}

TEST(Contact, RefreshedFrictionIsThatOfTheLastEvaluation) {
  Scenario scenario(many_obstacles());
  scenario.begin();
  displace(scenario, 1e-3 * random_vector(6 + kModes, 3));
  scenario.evaluate();
  EXPECT_GT(scenario.set.refresh_friction(scenario.workspace), 0);
  EXPECT_EQ(scenario.set.refresh_friction(scenario.workspace), 0);
}

/// Vertex and obstacle of all that are within the margin, one by one.
std::set<std::pair<int, int>> brute_force(const Scenario& scenario, double margin) {
  const ContactData data = ball_data();
  std::set<std::pair<int, int>> pairs;
  for (int id = 0; id < kVertices; ++id) {
    const Eigen::Vector3d X = data.positions.row(id).transpose() - Eigen::Vector3d(0.2, 0, 0);
    const Eigen::Vector3d point =
        scenario.position + scenario.rotation * (X + data.basis.middleRows(3 * id, 3) * scenario.q);
    for (std::size_t i = 0; i < scenario.obstacles.size(); ++i)
      if (PlacedObstacle(*scenario.obstacles[i], Scenario::kTime, Scenario::kTimeStep).signed_distance(point) <= margin)
        pairs.emplace(id, static_cast<int>(i));
  }
  return pairs;
}

TEST(Contact, BroadPhaseMissesNoContact) {
  std::size_t found = 0;
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    Scenario scenario(many_obstacles(), 17 * seed);
    scenario.position += (seed % 7) * 0.2 * random_vector(3, seed);
    scenario.q *= 1 << (seed % 8);
    scenario.set.gather(scenario.obstacles, Scenario::kTime, Scenario::kTimeStep, scenario.pose(), 0.01,
                        scenario.state.near_planes, scenario.workspace);
    std::set<std::pair<int, int>> pairs;
    std::pair<int, int> before{-1, -1};
    for (std::size_t i = 0; i < scenario.workspace.candidate_count; ++i) {
      const ContactCandidate& candidate = scenario.workspace.candidates[i];
      EXPECT_LT(before, std::pair(candidate.vertex, candidate.obstacle));
      before = {candidate.vertex, candidate.obstacle};
      pairs.emplace(scenario.set.data_index(candidate.vertex), candidate.obstacle);
    }
    EXPECT_EQ(pairs, brute_force(scenario, 0.01)) << seed;
    found += pairs.size();
  }
  EXPECT_GT(found, 500u);
}

TEST(Contact, CostsNothingAwayFromObstaclesAndLittleAtACorner) {
  Scenario scenario({obstacle(floor_at(-0.6))});
  scenario.position = {0, 0, 0};
  scenario.set.gather(scenario.obstacles, 0, Scenario::kTimeStep, scenario.pose(), 1e-3, scenario.state.near_planes,
                      scenario.workspace);
  const int visited = scenario.workspace.visited_nodes;
  scenario.position[1] = -0.02;
  scenario.set.gather(scenario.obstacles, 0, Scenario::kTimeStep, scenario.pose(), 1e-3, scenario.state.near_planes,
                      scenario.workspace);
  EXPECT_LT(scenario.workspace.tested_vertices, kVertices / 2);
  scenario.position[1] = 5;
  scenario.set.gather(scenario.obstacles, 0, Scenario::kTimeStep, scenario.pose(), 1e-3, scenario.state.near_planes,
                      scenario.workspace);
  EXPECT_EQ(scenario.workspace.visited_nodes, 0);
  EXPECT_EQ(scenario.workspace.tested_vertices, 0);
  EXPECT_EQ(scenario.workspace.candidate_count, 0u);
  EXPECT_GE(visited, 0);
}

TEST(Contact, BoundsHowFarItsVerticesTravel) {
  Scenario scenario({obstacle(floor_at(0))});
  const ContactData data = ball_data();
  Eigen::VectorXd velocity(6 + kModes);
  velocity << scenario.linear, scenario.angular, scenario.v;
  double fastest = 0;
  for (int id = 0; id < kVertices; ++id) fastest = std::max(fastest, (jacobian(scenario, data, id) * velocity).norm());
  const double bound = scenario.set.travel_bound(scenario.pose(), scenario.velocity(), 0.1);
  EXPECT_GE(bound, 0.1 * fastest);
  EXPECT_LE(bound, 0.4 * fastest);
}

TEST(Contact, StepsWithoutAllocations) {
  Scenario scenario(many_obstacles());
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(6 + kModes, 6 + kModes);
  Eigen::MatrixXd reduced = Eigen::MatrixXd::Zero(kModes, kModes);
  double sum = 0;
  const test::AllocationCounter counter;
  for (int i = 0; i < 3; ++i) {
    scenario.begin();
    sum += scenario.set.travel_bound(scenario.pose(), scenario.velocity(), 1e-3);
    sum += scenario.set.potential(scenario.pose(), scenario.workspace);
    sum += scenario.set.refresh_friction(scenario.workspace);
    scenario.set.add_stiffness(scenario.pose(), scenario.workspace, stiffness);
    scenario.set.add_reduced_stiffness(scenario.pose(), scenario.workspace, reduced);
    scenario.set.commit(scenario.pose(), scenario.workspace, scenario.state);
  }
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_GT(sum, 0);
  EXPECT_GT(scenario.state.count, 20u);
}

TEST(Contact, OfNoVerticesOrObstaclesDoesNothing) {
  ContactWorkspace workspace(ContactSet(), 0);
  const Eigen::VectorXd none;
  NearPlanes near_planes;
  ContactSet().gather({}, 0, 1, {Placement(), none}, 1, near_planes, workspace);
  EXPECT_EQ(workspace.candidate_count, 0u);
  Scenario scenario({});
  scenario.begin();
  EXPECT_EQ(scenario.workspace.candidate_count, 0u);
}

/// One vertex of mass 1 kg and area 1 m^2 that only translates, by backward Euler.
class Particle {
 public:
  explicit Particle(Obstacles given)
      : obstacles(std::move(given)),
        set(data()),
        workspace(set, obstacles.size()),
        state(set.make_state(obstacles.size())) {}

  void step(const Eigen::Vector3d& gravity) {
    const Eigen::Vector3d start = position, free_flight = position + kStep * (velocity + kStep * gravity);
    const double margin = 2 * set.travel_bound(pose(position), speed(velocity), kStep) + kStep * kStep * gravity.norm();
    time += kStep;
    set.gather(obstacles, time, kStep, pose(start), margin, state.near_planes, workspace);
    set.freeze(pose(start), speed(velocity), speed(velocity), kStep, state, workspace);
    Eigen::Vector3d x = start;
    for (int iteration = 0; iteration < 30; ++iteration) {
      set.evaluate(pose(x), workspace);
      const Eigen::Vector3d residual = (x - free_flight) / (kStep * kStep) - workspace.force;
      if (residual.norm() < 1e-10 * (gravity.norm() + workspace.force.norm())) break;
      Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(7, 7);
      set.add_stiffness(pose(x), workspace, hessian);
      hessian.diagonal().array() += 1 / (kStep * kStep);
      x -= Eigen::Matrix3d(hessian.topLeftCorner<3, 3>().selfadjointView<Eigen::Lower>()).inverse() * residual;
    }
    set.commit(pose(x), workspace, state);
    position = x;
    velocity = (x - start) / kStep;
  }

  static constexpr double kStep = 1e-3;
  Obstacles obstacles;
  ContactSet set;
  ContactWorkspace workspace;
  ContactState state;
  double time = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();

 private:
  static ContactData data() {
    ContactData data;
    data.positions = VertexArray::Zero(1, 3);
    data.areas = Eigen::VectorXd::Ones(1);
    data.basis = RowMatrix::Zero(3, 1);
    return data;
  }
  BodyPose pose(const Eigen::Vector3d& x) const {
    return {{Eigen::Vector3d::Zero(), x, Eigen::Matrix3d::Identity()}, zero_};
  }
  BodyVelocity speed(const Eigen::Vector3d& v) const { return {{v, Eigen::Vector3d::Zero()}, zero_}; }
  Eigen::VectorXd zero_ = Eigen::VectorXd::Zero(1);
};

constexpr double kSlope = 20 * std::numbers::pi / 180;
const Eigen::Vector3d kDownhill(std::cos(kSlope), -std::sin(kSlope), 0);
const Eigen::Vector3d kGravity(0, -9.81, 0);
const Plane kHill{{0, 0, 0}, {std::sin(kSlope), std::cos(kSlope), 0}};

TEST(ContactOfAParticle, HoldsItOnASlopeBelowTheConeOfFriction) {
  for (const double friction : {std::tan(kSlope) * 1.05, 0.8}) {
    Particle particle({obstacle(kHill, 400, friction)});
    particle.position = 0.02 * kHill.normal;
    for (int i = 0; i < 2000; ++i) particle.step(kGravity);
    const Eigen::Vector3d settled = particle.position;
    for (int i = 0; i < 10000; ++i) particle.step(kGravity);
    EXPECT_LT((particle.position - settled).norm(), 1e-9);
  }
}

TEST(ContactOfAParticle, LetsItSlideAboveWithTheRightAcceleration) {
  const double friction = 0.2;
  Particle particle({obstacle(kHill, 400, friction)});
  particle.position = -9.81 * std::cos(kSlope) / 2e4 * kHill.normal;
  for (int i = 0; i < 1000; ++i) particle.step(kGravity);
  const double expected = 9.81 * (std::sin(kSlope) - friction * std::cos(kSlope));
  EXPECT_NEAR(particle.velocity.dot(kDownhill), expected, 0.02 * expected);
  EXPECT_NEAR(particle.velocity.dot(kHill.normal), 0, 1e-6);
}

TEST(ContactOfAParticle, StopsItAfterTheRightDistance) {
  Particle particle({obstacle(floor_at(0), 400, 0.5)});
  particle.position[1] = -9.81 / 2e4;
  particle.velocity[0] = 2;
  for (int i = 0; i < 1000; ++i) particle.step(kGravity);
  EXPECT_NEAR(particle.position[0], 2 * 2 / (2 * 0.5 * 9.81), 0.005);
  EXPECT_NEAR(particle.velocity.norm(), 0, 1e-6);
}

double bounce_height(double damping) {
  Particle particle({obstacle(floor_at(0), damping)});
  particle.position[1] = 1;
  double lowest = 1, height = 0;
  for (int i = 0; i < 900; ++i) {
    particle.step(kGravity);
    lowest = std::min(lowest, particle.position[1]);
    if (lowest < 0) height = std::max(height, particle.position[1]);
  }
  return height;
}

TEST(ContactOfAParticle, BouncesTheLessTheMoreItIsDamped) {
  EXPECT_GT(bounce_height(0), 0.6);
  EXPECT_LT(bounce_height(0), 1.0);
  EXPECT_LT(bounce_height(60), 0.9 * bounce_height(0));
  EXPECT_LT(bounce_height(500), 1e-3);
}

TEST(ContactOfAParticle, FollowsAMovingFloor) {
  const RigidMotion motion(
      {{0.5, {0, 0, 0}, Eigen::Quaterniond::Identity()}, {2.5, {1, 0.4, 0}, Eigen::Quaterniond::Identity()}});
  Particle particle({obstacle(floor_at(0), 400, 0.8, motion)});
  particle.position[1] = -9.81 / 2e4;
  for (int i = 0; i < 3000; ++i) particle.step(kGravity);
  EXPECT_LT((particle.position - Eigen::Vector3d(1, 0.4 - 9.81 / 2e4, 0)).norm(), 2e-3);
  EXPECT_LT(particle.velocity.norm(), 1e-6);
}

TEST(ContactOfAParticle, TurnsWithARotatingFloor) {
  std::vector<Keyframe> keys;
  for (int i = 0; i < 8; ++i)
    keys.push_back({0.5 * i, {0, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * i, Eigen::Vector3d::UnitY()))});
  Particle particle({obstacle(floor_at(0), 400, 0.9, RigidMotion(keys))});
  particle.position = {0.5, -9.81 / 2e4, 0};
  for (int i = 0; i < 4000; ++i) particle.step(kGravity);
  const Eigen::Vector3d expected(0.5 * std::cos(3.5), -9.81 / 2e4, -0.5 * std::sin(3.5));
  EXPECT_LT((particle.position - expected).norm(), 5e-3);
}

}  // namespace
}  // namespace exmat::runtime

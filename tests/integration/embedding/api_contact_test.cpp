#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdlib>
#include <exmat/exmat.hpp>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <sys/resource.h>
#include <unistd.h>

#include "common/bundle/bundle.h"
#include "tests/integration/embedding/api_fixture.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/synthetic_model.h"

namespace exmat::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kGravity = 9.81;
constexpr double kTimeStep = 0.002;

/// Free blocks that obstacles may be put beside, and the same with a scene file's floor.
class ApiContactTest : public ::testing::Test {
 protected:
  ApiContactTest() {
    bar_.model.contact = surface_contact(bar_.model);
    write_bundle(bar_.model, files_.bundle());
  }

  static exmat_settings settings() {
    exmat_settings settings = default_settings();
    settings.time_step = kTimeStep;
    settings.gravity[2] = -kGravity;
    settings.mass_damping = 2;
    settings.stiffness_damping = 2e-3;
    settings.use_contact = 1;
    return settings;
  }
  Model model() const { return Model(files_.bundle(), settings()); }

  static exmat_obstacle floor(double friction = 0.5) {
    exmat_obstacle floor = default_obstacle();
    floor.stiffness = 1e7;
    floor.damping = 2e4;
    floor.friction = friction;
    return floor;
  }
  static exmat_motion at(double x, double y, double z) { return {0, {x, y, z}, {1, 0, 0, 0}, {0, 0, 0}, {0, 0, 0}}; }

  double mass() const { return bar_.model.rigid->mass; }

  Bar bar_ = make_bar({.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true});
  BarFiles files_;
};

TEST_F(ApiContactTest, ObstaclesOfTheHostAreThoseOfASceneBitForBit) {
  const Model scene = Model::from_scene(files_.folder().write(
      "floor.json",
      R"({"bundle": "bar.h5", "time_step": 0.002, "gravity": [0, 0, -9.81], "damping": {"mass": 2, "stiffness": 0.002},
                            "obstacles": [{"plane": {"normal": [0, 0, 1]}, "stiffness": 1e7, "damping": 2e4, "friction": 0.5},
                                          {"sphere": {"center": [0.5, 0.1, 0.1], "radius": 0.08}}]})"));
  Body expected(scene);
  const Model model = this->model();
  Body body(model);
  exmat_obstacle ball = default_obstacle();
  ball.shape = EXMAT_SPHERE;
  ball.point[0] = 0.5;
  ball.point[1] = ball.point[2] = 0.1;
  ball.radius = 0.08;
  EXPECT_EQ(body.world().add_obstacle(floor()), 0);
  EXPECT_EQ(body.world().add_obstacle(ball), 1);
  for (Body* each : {&body, &expected}) {
    exmat_motion motion = at(0, 0, 0.05);
    motion.linear_velocity[0] = 1;
    each->set_motion(motion);
    each->step(400);
  }
  const std::array<exmat_body*, 1> ours{body.get()}, theirs{expected.get()};
  std::uint64_t a = 0, b = 1;
  exmat_bodies_hash(ours.data(), 1, &a);
  exmat_bodies_hash(theirs.data(), 1, &b);
  EXPECT_EQ(a, b);
  EXPECT_GT(body.contacts().size(), 3);
}

// At rest the floor carries the weight, the contacts add up to it, and the floor feels the opposite.
TEST_F(ApiContactTest, ContactsAndLoadsAddUpToTheWeight) {
  const Model model = this->model();
  Body body(model);
  const std::int64_t id = body.world().add_obstacle(floor());
  body.step(3000);
  const double weight = mass() * kGravity;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero(), on_body, on_floor, turns, of_floor;
  const exmat_motion now = body.motion();
  const Eigen::Vector3d centre = bar_.model.rigid->centre_of_mass + Eigen::Vector3d(now.position);
  for (const exmat_contact& contact : body.contacts()) {
    const Eigen::Vector3d force(contact.force), position(contact.position);
    sum += force;
    torque += (position - centre).cross(force);
    EXPECT_EQ(contact.obstacle, id);
    EXPECT_EQ(Eigen::Vector3d(contact.normal), Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(contact.depth, -position[2], 1e-15);
    const std::array<std::int64_t, 1> vertex{contact.vertex};
    std::array<float, 3> xyz{};
    body.read_positions(Points::vertices(model, vertex), xyz);
    EXPECT_LE((Eigen::Map<Eigen::Vector3f>(xyz.data()).cast<double>() - position).norm(), 1e-7);  // single precision
  }
  body.step(1);  // the load of one step
  body.read_contact_load(-1, on_body.data(), turns.data());
  body.read_contact_load(id, on_floor.data(), of_floor.data());
  EXPECT_NEAR(sum[2], weight, 1e-3 * weight);
  EXPECT_LE((on_body - sum).norm(), 1e-5 * weight);
  EXPECT_LE((on_body + on_floor).norm(), 1e-12 * weight);
  // About the floor's origin: the torque about the centre, and that of the force there.
  EXPECT_LE((of_floor + turns + centre.cross(on_body)).norm(), 1e-9 * weight);
  EXPECT_LE((turns - torque).norm(), 1e-5 * weight);
}

// The load is what the momenta changed by, over all steps of a call.
TEST_F(ApiContactTest, TheLoadIsTheChangeOfMomentumOverTheCall) {
  const Model model = this->model();
  Body body(model);
  body.world().add_obstacle(floor());
  exmat_motion motion = at(0, 0, 0.02);
  motion.linear_velocity[0] = 1;
  motion.linear_velocity[2] = -2;
  body.set_motion(motion);
  for (int call = 0; call < 10; ++call) {
    constexpr int kSteps = 7;
    const exmat_motion before = body.motion();
    body.step(kSteps);
    const exmat_motion after = body.motion();
    std::array<double, 3> force{};
    body.read_contact_load(-1, force.data(), nullptr);
    for (std::size_t i = 0; i < 3; ++i) {
      const double gained = mass() * (after.linear_velocity[i] - before.linear_velocity[i]);
      const double expected = kSteps * kTimeStep * (force[i] + mass() * (i == 2 ? -kGravity : 0));
      EXPECT_NEAR(gained, expected, 1e-11 * mass()) << call;
    }
  }
}

// A plate that the host moves carries what lies on it, as one that keyframes move; removed, it lets go.
TEST_F(ApiContactTest, MovedObstaclesCarryAndRemovedOnesLetGo) {
  const Model model = this->model();
  Body body(model);
  exmat_obstacle plate = floor(1);
  plate.shape = EXMAT_BOX;
  plate.half_extents[0] = plate.half_extents[1] = 2;
  plate.half_extents[2] = 0.1;
  plate.point[2] = -0.1;
  const std::int64_t ball = body.world().add_obstacle([] {
    exmat_obstacle shape = default_obstacle();
    shape.shape = EXMAT_SPHERE;
    shape.point[0] = 50;
    return shape;
  }());
  const std::int64_t id = body.world().add_obstacle(plate);
  body.step(1500);
  const double start = body.motion().position[0];
  constexpr double kVelocity = 0.3;
  for (int i = 0; i < 1000; ++i) {  // as an engine does: pose and velocity before each step
    exmat_motion motion = at(kVelocity * kTimeStep * i, 0, 0);
    motion.linear_velocity[0] = kVelocity;
    body.world().move_obstacle(id, motion);
    body.step(1);
  }
  EXPECT_NEAR(body.world().obstacle_motion(id).position[0], kVelocity * kTimeStep * 1000, 1e-12);
  // Dragged along but for what it slid until it had the velocity: v^2 / (2 mu g) = 4.6e-3 m, and the damping of mass.
  EXPECT_NEAR(body.motion().linear_velocity[0], kVelocity, 0.02 * kVelocity);
  EXPECT_NEAR(body.motion().position[0] - start, kVelocity * kTimeStep * 1000, 0.02);
  body.world().remove_obstacle(ball);
  const std::size_t touching = body.contacts().size();
  body.step(1);
  EXPECT_THAT(body.world().obstacle_ids(), ::testing::ElementsAre(id));
  EXPECT_GT(body.contacts().size(), 3);
  EXPECT_EQ(touching, 0);  // those of the last call went with the obstacle
  const double height = body.motion().position[2];
  body.world().remove_obstacle(id);
  body.step(100);
  EXPECT_TRUE(body.contacts().empty());
  EXPECT_LT(body.motion().position[2], height - 0.1);
  EXPECT_EQ(body.world().add_obstacle(plate), 2);
}

TEST_F(ApiContactTest, ResetAndStatesKeepTheHostsObstaclesWhereTheyAre) {
  const Model model = this->model();
  Body body(model);
  const std::int64_t id = body.world().add_obstacle(floor());
  exmat_motion rising = at(0, 0, -0.05);
  rising.linear_velocity[2] = 0.2;
  body.world().move_obstacle(id, rising);
  body.step(100);
  const std::vector<double> state = body.state();
  const double height = body.world().obstacle_motion(id).position[2];
  EXPECT_NEAR(height, -0.05 + 0.2 * 100 * kTimeStep, 1e-12);
  body.step(50);
  const auto twice = [&] {
    body.set_state(state);
    exmat_motion motion = body.world().obstacle_motion(id);
    motion.position[2] = height;
    body.world().move_obstacle(id, motion);
    body.step(50);
    return body.state();
  };
  EXPECT_EQ(twice(), twice());
  const double before = body.world().obstacle_motion(id).position[2];
  body.reset();
  EXPECT_EQ(body.world().obstacle_motion(id).position[2], before);
}

TEST_F(ApiContactTest, WhatWasAddedIsRead) {
  const Model model = this->model();
  Body body(model);
  exmat_obstacle capsule = default_obstacle();
  capsule.shape = EXMAT_CAPSULE;
  capsule.point[1] = 3;
  capsule.direction[0] = -2;
  capsule.radius = 0.25;
  capsule.friction = 0.3;
  const std::int64_t id = body.world().add_obstacle(capsule);
  body.world().set_obstacle_law(id, 2e5, 10, 0.7);
  const exmat_obstacle found = body.world().obstacle(id);
  EXPECT_EQ(found.shape, EXMAT_CAPSULE);
  EXPECT_EQ(found.point[1], 3);
  EXPECT_EQ(found.direction[0], -2);
  EXPECT_EQ(found.direction[2], 1);
  EXPECT_EQ(found.radius, 0.25);
  EXPECT_EQ(found.stiffness, 2e5);
  EXPECT_EQ(found.damping, 10);
  EXPECT_EQ(found.friction, 0.7);
}

/// A table of 2 x 2 x 0.2 m whose top is at z = 0.
Shape table_mesh() {
  const std::vector<double> vertices{-1, -1, -0.2, 1, -1, -0.2, -1, 1, -0.2, 1, 1, -0.2,
                                     -1, -1, 0,    1, -1, 0,    -1, 1, 0,    1, 1, 0};
  const std::vector<std::int32_t> triangles{0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                            2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  return Shape::mesh(vertices, triangles);
}

// The same block on a box, on its mesh and on flat ground of heights; the handle may go before the obstacles.
TEST_F(ApiContactTest, MeshesAndHeightFieldsCarryAsABoxDoes) {
  const Model model = this->model();
  Body on_box(model), on_mesh(model), on_heights(model), on_shell(model);
  exmat_obstacle law = floor();
  law.shape = EXMAT_BOX;
  law.point[2] = -0.1;
  law.half_extents[0] = law.half_extents[1] = 1;
  law.half_extents[2] = 0.1;
  on_box.world().add_obstacle(law);
  law = floor();
  std::int64_t id = -1;
  {
    const Shape mesh = table_mesh();
    id = on_mesh.world().add_shape(mesh, law);
    const std::vector<double> heights(9, 0.5);
    law.point[0] = law.point[1] = -1;
    law.point[2] = -0.5;
    on_heights.world().add_shape(Shape::height_field(heights, 3, {1, 1}), law);
    law = floor();
    law.point[2] = -0.05;
    const std::vector<double> corners{-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
    const std::vector<std::int32_t> sheet{0, 1, 2, 0, 2, 3};
    on_shell.world().add_shape(Shape::mesh(corners, sheet, 0.1), law);
  }
  for (Body* body : {&on_box, &on_mesh, &on_heights, &on_shell}) {
    body->step(400);
    EXPECT_GT(body->contacts().size(), 3u);
  }
  for (Body* body : {&on_mesh, &on_heights, &on_shell})
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(body->motion().position[axis], on_box.motion().position[axis], 1e-9);
  EXPECT_EQ(on_mesh.world().obstacle(id).shape, EXMAT_MESH);
  EXPECT_EQ(on_mesh.world().obstacle(id).friction, 0.5);
  exmat_motion up = at(0, 0, 0);
  up.linear_velocity[2] = 0.5;
  on_mesh.world().move_obstacle(id, up);
  on_mesh.step(100);
  EXPECT_NEAR(on_mesh.motion().position[2] - on_box.motion().position[2], 100 * kTimeStep * 0.5, 2e-3);
  on_mesh.world().remove_obstacle(id);
  on_mesh.step(10);
  EXPECT_TRUE(on_mesh.contacts().empty());
}

// Half way through a thin shell the state knows which way is out.
TEST_F(ApiContactTest, AStateRemembersTheSideThatABodyCameInBy) {
  const Model model = this->model();
  const std::vector<double> corners{-2, -2, -0.3, 2, -2, -0.3, 2, 2, -0.3, -2, 2, -0.3};
  const std::vector<std::int32_t> sheet{0, 1, 2, 0, 2, 3};
  const Shape shell = Shape::mesh(corners, sheet, 0.02);
  exmat_obstacle law = floor(0);
  law.stiffness = 1e6;
  law.damping = 0;
  Body body(model), other(model);
  body.world().add_shape(shell, law);
  other.world().add_shape(shell, law);
  exmat_motion fall = at(0, 0, 0);
  fall.linear_velocity[2] = -50;
  body.set_motion(fall);
  body.step(8);
  EXPECT_LT(body.motion().position[2], -0.35);  // its lower side is beyond the shell
  other.set_state(body.state());
  body.step(200);
  other.step(200);
  EXPECT_GT(body.motion().position[2], -0.3);
  EXPECT_EQ(body.state(), other.state());
}

TEST_F(ApiContactTest, WrongShapesAreRefusedInWords) {
  exmat_shape* shape = nullptr;
  const std::vector<double> corners{0, 0, 0, 1, 0, 0, 0, 1, 0};
  const auto refused = [&](const std::vector<double>& vertices, const std::vector<std::int32_t>& triangles,
                           double thickness) {
    EXPECT_EQ(exmat_shape_create_mesh(vertices.data(), std::ssize(vertices), triangles.data(), std::ssize(triangles),
                                      thickness, &shape),
              EXMAT_INVALID_ARGUMENT);
    EXPECT_EQ(shape, nullptr);
    return std::string(exmat_last_error());
  };
  EXPECT_THAT(refused(corners, {0, 1, 2}, 0),
              AllOf(HasSubstr("3 edges of one triangle alone"), HasSubstr("thickness")));
  EXPECT_THAT(refused(corners, {0, 1, 3}, 1), HasSubstr("triangles[2] = 3: expected a vertex, 0 to 2"));
  EXPECT_THAT(refused(corners, {0, 1, 1}, 1), HasSubstr("triangles: expected some"));
  EXPECT_THAT(refused(corners, {0, 1}, 1), HasSubstr("corners = 2"));
  EXPECT_THAT(refused({0, 0}, {0, 1, 2}, 1), HasSubstr("coordinates = 2"));
  EXPECT_THAT(refused({0, 0, NAN, 1, 0, 0, 0, 1, 0}, {0, 1, 2}, 1),
              HasSubstr("vertices[2] = nan: expected finite numbers of at most 1e+30 m"));
  EXPECT_THAT(refused(corners, {0, 1, 2}, -1), HasSubstr("thickness = -1"));
  const std::array<double, 2> spacing{1, 0};
  EXPECT_EQ(exmat_shape_create_height_field(corners.data(), 3, 3, spacing.data(), &shape), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("spacing"));
  EXPECT_EQ(exmat_shape_create_height_field(corners.data(), 1, 9, spacing.data(), &shape), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("1 rows"));
  Body body(model());
  exmat_obstacle obstacle = floor();
  obstacle.shape = EXMAT_MESH;
  std::int64_t id = 0;
  EXPECT_EQ(exmat_world_add_obstacle(exmat_body_world(body.get()), &obstacle, &id), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("it is made of arrays: expected the shape"));
  obstacle.friction = -1;
  EXPECT_EQ(exmat_world_add_shape(exmat_body_world(body.get()), table_mesh().get(), &obstacle, &id),
            EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("obstacle.friction"));
  EXPECT_TRUE(body.world().obstacle_ids().empty());
}

TEST_F(ApiContactTest, WrongObstaclesAreRefusedInWords) {
  const Model model = this->model();
  Body body(model);
  const auto refused = [&](auto change) {
    exmat_obstacle obstacle = default_obstacle();
    change(obstacle);
    std::int64_t id = 0;
    EXPECT_EQ(exmat_world_add_obstacle(exmat_body_world(body.get()), &obstacle, &id), EXMAT_INVALID_ARGUMENT);
    EXPECT_EQ(id, -1);
    EXPECT_TRUE(body.world().obstacle_ids().empty());
    return std::string(exmat_last_error());
  };
  EXPECT_THAT(refused([](auto& o) { o.shape = 9; }), HasSubstr("obstacle.shape = 9: expected 0 to 3"));
  EXPECT_THAT(refused([](auto& o) { o.direction[2] = 0; }), HasSubstr("obstacle.direction"));
  EXPECT_THAT(refused([](auto& o) { o.stiffness = 0; }), HasSubstr("obstacle.stiffness = 0"));
  EXPECT_THAT(refused([](auto& o) { o.stiffness = 1e16; }), HasSubstr("obstacle.stiffness = 1e+16: expected a number"));
  EXPECT_THAT(refused([](auto& o) { o.friction = -1; }), HasSubstr("obstacle.friction = -1"));
  EXPECT_THAT(refused([](auto& o) { o.point[0] = NAN; }), HasSubstr("obstacle.point"));
  EXPECT_THAT(refused([](auto& o) { o.shape = EXMAT_SPHERE, o.radius = -2; }), HasSubstr("obstacle.radius = -2"));
  EXPECT_THAT(refused([](auto& o) { o.shape = EXMAT_BOX, o.orientation[0] = 0; }), HasSubstr("quaternion"));
  EXPECT_THAT(refused([](auto& o) { o.size = 3; }), HasSubstr("size = 3"));
  EXPECT_EQ(exmat_world_remove_obstacle(exmat_body_world(body.get()), 4), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("id = 4: the world has no such obstacle"));
  exmat_settings plain = settings();
  plain.use_contact = 0;
  Body other(Model(files_.bundle(), plain));
  try {
    other.world().add_obstacle(floor());
    FAIL() << "added";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("use_contact"));
  }
}

// Free fall with gravity that turns: the velocity is its integral.
TEST_F(ApiContactTest, GravityChangesBetweenSteps) {
  exmat_settings light = settings();
  light.mass_damping = light.stiffness_damping = 0;
  Body body(Model(files_.bundle(), light));
  body.step(10);
  body.set_gravity(std::array{3.0, 0.0, 0.0});
  body.restart_integrator();
  body.step(20);
  body.reset();
  body.step(5);
  EXPECT_NEAR(body.motion().linear_velocity[0], 5 * kTimeStep * 3, 1e-14);
  EXPECT_EQ(body.motion().linear_velocity[2], 0);
  EXPECT_EQ(exmat_body_set_gravity(body.get(), std::array<double, 3>{0, NAN, 0}.data()), EXMAT_INVALID_ARGUMENT);
}

TEST_F(ApiContactTest, StepsAndReadsOfContactsDoNotAllocate) {
  if (!AllocationCounter::works()) GTEST_SKIP() << "a sanitizer owns malloc";
  const Model model = this->model();
  Body body(model);
  const std::int64_t id = body.world().add_obstacle(floor());
  body.step(200);
  std::vector<exmat_contact> contacts(body.contacts().size() + 64);
  std::array<double, 6> load{};
  exmat_motion motion = at(0, 0, 0);
  motion.size = sizeof motion;
  const AllocationCounter counter;
  int status = exmat_body_step(body.get(), 10, nullptr);
  const std::int64_t count = exmat_body_contacts(body.get());
  status |= exmat_body_read_contacts(body.get(), contacts.data(), count, sizeof(exmat_contact));
  status |= exmat_body_read_contact_load(body.get(), id, load.data(), load.data() + 3);
  status |= exmat_world_move_obstacle(exmat_body_world(body.get()), id, &motion);
  status |= exmat_body_set_gravity(body.get(), load.data());
  status |= exmat_body_reset(body.get());
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_EQ(status, EXMAT_OK);
  EXPECT_GT(count, 0);
}

/// Leaves room for no more than some bytes beyond what the process has, and steps many bodies by many threads.
[[noreturn]] void step_with_little_memory(const Model& model, rlim_t room) {
  exmat_contact_law law = default_contact_law();
  law.apart = 1;
  World bodies(law);
  for (int i = 0; i < 64; ++i) bodies.add(Body(model));
  std::ifstream memory("/proc/self/statm");
  rlim_t pages = 0;
  memory >> pages;
  const rlim_t limit = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + room;
  const rlimit limits{limit, limit};
  setrlimit(RLIMIT_AS, &limits);
  bodies.step(2, 1500);
  std::_Exit(bodies.body(63).report().steps == 2 ? 0 : 1);
}

// OpenMP ends the process where a thread does not start; the library asks for no more than do.
TEST_F(ApiContactTest, ManyThreadsInLittleMemoryDoNotEndTheProcess) {
  if (!AllocationCounter::works()) GTEST_SKIP() << "a sanitizer reserves more memory than there is";
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const Model model = this->model();
  for (const rlim_t room : {rlim_t{1} << 20, rlim_t{12} << 20, rlim_t{100} << 20})
    EXPECT_EXIT(step_with_little_memory(model, room), testing::ExitedWithCode(0), "") << room;
}

}  // namespace
}  // namespace exmat::test

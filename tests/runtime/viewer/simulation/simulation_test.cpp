#include "runtime/viewer/simulation/simulation.h"

#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "runtime/viewer/simulation/runner.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::viewer {
namespace simulation_test {

constexpr const char* kScene = R"({"bundle": "bar.h5", "gravity": [0, 0, -1], "damping": {"mass": 1, "stiffness": 0.01},
  "examples": {"stiffness": 50, "damping": 1}, "instances": 2})";

class Simulations : public ::testing::Test {
 protected:
  explicit Simulations(bool free = false) {
    test::Bar bar = test::make_bar({.free = free, .examples = 3});
    bar.model.contact = test::surface_contact(bar.model);
    write_bundle(bar.model, folder_ / "bar.h5");
    bar_ = std::move(bar);
  }
  Simulation make(const std::string& text = kScene) {
    return {{SceneDocument::open(folder_.write("scene.json", text))}, EXMAT_SURFACE_AUTO};
  }
  /// Hash of a world by the library alone.
  static std::uint64_t hash_of(const std::filesystem::path& scene, std::size_t bodies, std::int64_t steps) {
    World world = World::from_scene(scene.string());
    EXPECT_EQ(world.size(), bodies);
    world.step(steps);
    return world.hash();
  }
  static SurfaceHit tip(const Simulation& simulation) {
    const auto shape = simulation.shape(0);
    return nearest_place(shape->bounds.most, shape->rest, shape->triangles);
  }

  test::Bar bar_;
  test::TemporaryFolder folder_;
};

class FreeSimulations : public Simulations {
 protected:
  FreeSimulations() : Simulations(true) {}
};

TEST_F(Simulations, StepAsTheLibraryDoes) {
  Simulation simulation = make();
  simulation.advance(120);
  EXPECT_EQ(simulation.bodies(), 2U);
  EXPECT_EQ(simulation.hash(), hash_of(folder_ / "scene.json", 2, 120));
}

TEST_F(Simulations, WithWhatWasSetAreThoseOfTheSceneThatIsSaved) {
  Simulation simulation = make();
  Settings settings = simulation.settings(0);
  settings.gravity = {0.5, 0, -3};
  settings.stiffness_damping = 0.02;
  settings.integrator = "newmark";
  settings.forces[0].stiffness = 400;
  settings.forces[0].given = true;
  settings.forces[0].weights = {0.25, 0.25, 0.5};
  simulation.apply(0, settings);
  exmat_obstacle floor = default_obstacle();
  floor.point[2] = -0.1;
  floor.friction = 0.3;
  simulation.add_obstacle(floor);
  simulation.advance(150);
  simulation.save_scene(folder_ / "saved.json");
  EXPECT_EQ(simulation.hash(), hash_of(folder_ / "saved.json", 2, 150));
  EXPECT_NE(simulation.hash(), hash_of(folder_ / "scene.json", 2, 150));
}

TEST_F(Simulations, KeysOfTheSceneGoOnWhileSomethingElseIsTurned) {
  Simulation simulation =
      make(R"({"bundle": "bar.h5", "gravity": [0, 0, -1], "examples": {"stiffness": 50, "damping": 1,
    "weights": {"keys": [{"time": 0, "value": [1, 0, 0]}, {"time": 0.1, "value": [0, 1, 0]}]}}})");
  Settings settings = simulation.settings(0);
  EXPECT_TRUE(settings.forces[0].keyed);
  settings.mass_damping += 0.5;
  simulation.apply(0, settings);
  simulation.advance(150);
  simulation.save_scene(folder_ / "saved.json");
  EXPECT_EQ(simulation.hash(), hash_of(folder_ / "saved.json", 1, 150));
  // A slider that is moved takes the weights over, in what is saved, too.
  settings.forces[0].keyed = false;
  settings.forces[0].weights = {0.5, 0.25, 0.25};
  simulation.apply(0, settings);
  simulation.reset();
  simulation.advance(150);
  simulation.save_scene(folder_ / "taken.json");
  EXPECT_EQ(simulation.hash(), hash_of(folder_ / "taken.json", 1, 150));
}

TEST_F(Simulations, AreSetBackToTheirStart) {
  Simulation simulation = make();
  simulation.advance(40);
  const std::uint64_t once = simulation.hash();
  simulation.grab(0, tip(simulation));
  simulation.advance(10);
  simulation.reset();
  simulation.advance(40);
  EXPECT_EQ(simulation.hash(), once);
}

TEST_F(Simulations, SayWhatTheBasisLosesOfAPush) {
  Simulation simulation = make();
  EXPECT_FALSE(simulation.lost_work().hand);
  const int hand = simulation.grab(0, tip(simulation));
  simulation.move_grip(hand, simulation.snapshot({}).grips[0].point + Eigen::Vector3d(0, 0, 0.05));
  simulation.advance(100);
  const LostWork lost = simulation.lost_work();
  EXPECT_TRUE(lost.measured);
  EXPECT_GT(lost.hand.value(), 0);
  EXPECT_LT(lost.hand.value(), 1);
  EXPECT_FALSE(lost.contact);
}

// A held point goes to the hand and stays there: what the spring lacks of it is the body's own force over its
// stiffness.
TEST_F(Simulations, FollowAHandAndLetGo) {
  Simulation simulation = make(R"({"bundle": "bar.h5", "damping": {"mass": 2, "stiffness": 0.02}})");
  const int hand = simulation.grab(0, tip(simulation));
  const Eigen::Vector3d from = simulation.snapshot({}).grips[0].point, way(0, 0.02, 0.08);
  simulation.move_grip(hand, from + way);
  simulation.advance(3000);
  const GripSnapshot grip = simulation.snapshot({}).grips.at(0);
  EXPECT_LE((grip.point - from - way).norm(), 0.1 * way.norm());
  EXPECT_GT(grip.force.dot(way), 0);
  EXPECT_LE((grip.point - from - simulation.shape(0)->bounds.diagonal() * Eigen::Vector3d::Ones()).norm(), 10);
  simulation.release(hand);
  simulation.advance(6000);
  const std::vector<float> positions = simulation.positions(0);
  const std::vector<double>& rest = simulation.shape(0)->rest;
  for (std::size_t i = 0; i < rest.size(); ++i) EXPECT_NEAR(positions[i], rest[i], 1e-3);
}

// In its modes, in all vertices, and by a spring where bodies may touch.
TEST_F(FreeSimulations, HangOnAPinUntilItIsTakenOut) {
  const std::string settings = R"("gravity": [0, 0, -9.81], "damping": {"mass": 2, "stiffness": 0.02})";
  for (const char* const bodies : {R"("bundle": "bar.h5", "space": "reduced")", R"("bundle": "bar.h5")",
                                   R"("bodies": [{"name": "bar", "bundle": "bar.h5"}], "space": "reduced")"}) {
    SCOPED_TRACE(bodies);
    Simulation simulation = make("{" + std::string(bodies) + ", " + settings + "}");
    const SurfaceHit place = tip(simulation);
    const auto height = [&] {
      const std::vector<float> now = simulation.positions(0);
      double z = 0;
      for (int c = 0; c < 3; ++c)
        z += place.shares[c] * now[3 * static_cast<std::size_t>(simulation.shape(0)->point(place.triangle, c)) + 2];
      return z;
    };
    const auto centre = [&] { return simulation.snapshot({}).bodies[0].motion.position[2]; };
    const double rest = height();
    simulation.toggle_pin(0, place);
    ASSERT_EQ(simulation.snapshot({}).pins.size(), 1U);
    EXPECT_LE((simulation.snapshot({}).pins[0] - simulation.shape(0)->rest_place(place)).norm(), 1e-6);
    simulation.advance(400);
    EXPECT_TRUE(simulation.failure().empty());
    EXPECT_NEAR(height(), rest, 0.02);  // about what is held it turns
    EXPECT_LT(centre(), -0.1);
    simulation.toggle_pin(0, place);
    EXPECT_TRUE(simulation.snapshot({}).pins.empty());
    const double before = height();
    simulation.advance(600);
    EXPECT_LT(height(), before - 0.5);
    simulation.toggle_pin(0, place);
    simulation.reset();
    EXPECT_TRUE(simulation.snapshot({}).pins.empty());
    simulation.advance(400);
    EXPECT_LT(centre(), -0.5);
  }
}

TEST_F(Simulations, AreMetByRaysBeforeObstaclesOrAfter) {
  Simulation simulation = make(R"({"bundle": "bar.h5"})");
  const auto& bounds = simulation.shape(0)->bounds;
  exmat_obstacle floor = default_obstacle();  // between the eye and the ball: not met
  floor.point[2] = bounds.most.z() + 3;
  simulation.add_obstacle(floor);
  exmat_obstacle ball = default_obstacle();
  ball.shape = EXMAT_SPHERE;
  ball.radius = 0.5;
  std::copy_n(bounds.centre().data(), 3, ball.point);
  ball.point[2] = bounds.most.z() + 2;
  simulation.add_obstacle(ball);
  const Ray down{bounds.centre() + Eigen::Vector3d(0, 0, 9), {0, 0, -1}};
  const auto hit = simulation.cast(down);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->number, 1U);
  EXPECT_NEAR(down.at(hit->distance).z(), bounds.most.z() + 2.5, 1e-7);
  const auto body = simulation.cast(0, down, 1e300);
  ASSERT_TRUE(body);
  EXPECT_NEAR(down.at(body->distance).z(), bounds.most.z(), 1e-6);
  EXPECT_LE((simulation.shape(0)->rest_place(*body) - down.at(body->distance)).norm(), 1e-6);
  EXPECT_FALSE(simulation.cast(0, down, 0.9 * body->distance));
  EXPECT_FALSE(simulation.cast({down.origin, {0, 0, 1}}));
}

TEST_F(Simulations, GoOnUnderAnotherModel) {
  Simulation simulation = make();
  simulation.advance(200);
  const std::vector<float> before = simulation.positions(0);
  Settings settings = simulation.settings(0);
  settings.time_step = 0.0005;
  settings.forces[0].target = "solve";
  simulation.apply(0, settings);
  EXPECT_EQ(simulation.positions(0), before);
  EXPECT_EQ(simulation.time_step(), 0.0005);
  simulation.advance(10);
  EXPECT_TRUE(simulation.failure().empty());
}

TEST_F(Simulations, ThatCannotBeAreLeftAsTheyWere) {
  Simulation simulation = make();
  Settings settings = simulation.settings(0);
  settings.internal_force = "polynomial";  // the bundle has none
  EXPECT_THROW(simulation.apply(0, settings), Error);
  EXPECT_EQ(simulation.settings(0).internal_force, "auto");
  simulation.advance(50);
  EXPECT_EQ(simulation.hash(), hash_of(folder_ / "scene.json", 2, 50));
}

TEST_F(Simulations, MoveObstaclesSmoothlyToTheHand) {
  Simulation simulation = make();
  exmat_obstacle ball = default_obstacle();
  ball.shape = EXMAT_SPHERE;
  ball.radius = 0.1;
  ball.point[2] = 5;
  simulation.add_obstacle(ball);
  simulation.move_obstacle(0, {0, 0, 1});
  simulation.advance(2000);
  EXPECT_NEAR(simulation.snapshot({}).obstacles[0].motion.position[2], 1, 1e-6);
}

TEST_F(FreeSimulations, AreThrown) {
  Simulation simulation = make(R"({"bundle": "bar.h5"})");
  double mass = 0;
  for (Eigen::Index i = 0; i < bar_.mass.rows(); i += 3)
    for (Eigen::Index j = 0; j < bar_.mass.cols(); j += 3) mass += bar_.mass(i, j);
  EXPECT_NEAR(simulation.shape(0)->mass, mass, 1e-6 * mass);
  EXPECT_TRUE(simulation.throw_body(0, {1, 2, 3}, Eigen::Vector3d::Zero()));
  simulation.advance(500);
  const exmat_motion motion = simulation.snapshot({}).bodies[0].motion;
  EXPECT_NEAR(motion.position[0], 0.5, 1e-6);
  EXPECT_NEAR(motion.position[2], 1.5, 1e-6);
}

TEST_F(Simulations, RunByAClockOrInRealTime) {
  Simulation simulation = make();
  {
    Runner runner(simulation);
    for (int frame = 0; frame < 60; ++frame) runner.advance(1.0 / 60);
    EXPECT_EQ(simulation.steps(), 1000);
    runner.set_paused(true);
    runner.advance(1);
    EXPECT_EQ(simulation.steps(), 1000);
    runner.step(5);
    EXPECT_EQ(runner.latest()->steps, 1005);
    runner.set_paused(false);
    runner.start();
    while (runner.latest()->steps < 1010) std::this_thread::yield();
    runner.with([](Simulation& held) { held.reset(); });
  }
  simulation.reset();
  EXPECT_EQ(simulation.steps(), 0);
}

}  // namespace simulation_test
}  // namespace exmat::viewer

#include <algorithm>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "runtime/viewer/simulation/simulation.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::viewer {
namespace world_simulation_test {

constexpr const char* kScene = R"({
  "time_step": 0.002, "gravity": [0, 0, -9.81], "damping": {"mass": 0.5, "stiffness": 0.002},
  "contact": {"stiffness": 1e7, "damping": 2e4, "friction": 0.4},
  "obstacles": [{"plane": {"point": [0, 0, -0.02], "normal": [0, 0, 1]}, "stiffness": 1e7, "damping": 2e4},
                {"mesh": {"file": "sub/block.obj", "position": [5, 0, 0]}, "stiffness": 1e6}],
  "bodies": [{"name": "block", "bundle": "sub/block.h5", "examples": {"stiffness": 100, "damping": 2},
              "grid": {"counts": [1, 1, 2], "spacing": [1, 1, 0.22]}},
             {"name": "light", "bundle": "sub/block.h5", "poses": "sub/poses.txt", "gravity": [0, 0, -1],
              "examples": {"stiffness": 10}}]})";

constexpr const char* kTetrahedron = R"(v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 1 4 3
)";

/// Two blocks on each other, and one of another kind on top, of which only the scene file knows.
class WorldSimulations : public ::testing::Test {
 protected:
  WorldSimulations() {
    test::Bar block = test::make_bar(
        {.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true, .examples = 2});
    block.model.contact = test::surface_contact(block.model);
    std::filesystem::create_directories(folder_ / "sub");
    write_bundle(block.model, folder_ / "sub/block.h5");
    folder_.write("sub/poses.txt", "0.1 0.03 0.45\n");
    folder_.write("sub/block.obj", kTetrahedron);
  }
  Simulation make() { return {{SceneDocument::open(folder_.write("scene.json", kScene))}, EXMAT_SURFACE_AUTO}; }
  /// By the library alone.
  static std::uint64_t hash_of(const std::filesystem::path& scene, std::int64_t steps) {
    World world = World::from_scene(scene.string());
    world.step(steps, 1);
    return world.hash();
  }

  test::TemporaryFolder folder_;
};

TEST_F(WorldSimulations, StepAsTheLibraryDoesAndGoBackToTheirStart) {
  Simulation simulation = make();
  ASSERT_EQ(simulation.bodies(), 3U);
  ASSERT_EQ(simulation.kinds(), 2U);
  EXPECT_EQ(simulation.kind_name(1), "light");
  EXPECT_EQ(simulation.kind_of(2), 1U);
  simulation.advance(100);
  const std::uint64_t expected = hash_of(folder_ / "scene.json", 100);
  EXPECT_EQ(simulation.hash(), expected);
  const Snapshot snapshot = simulation.snapshot({});
  std::size_t between = 0;
  for (const BodySnapshot& body : snapshot.bodies)
    between += static_cast<std::size_t>(std::ranges::count(body.contacts, -1, &exmat_contact::obstacle));
  EXPECT_GT(between, 3U);
  const std::vector<float> pressed = simulation.snapshot({.colouring = Colouring::kContactForce}).bodies[0].field;
  EXPECT_GT(std::ranges::count_if(pressed, [](float force) { return force > 0; }), 3);
  EXPECT_EQ(snapshot.obstacles.at(1).corners->size(), 9U * 4);
  EXPECT_TRUE(simulation.lost_work().contact);
  simulation.reset();
  simulation.advance(100);
  EXPECT_EQ(simulation.hash(), expected);
}

TEST_F(WorldSimulations, WithWhatWasSetAreThoseOfTheSceneThatIsSaved) {
  Simulation simulation = make();
  Settings blocks = simulation.settings(0), light = simulation.settings(1);
  EXPECT_EQ(light.gravity[2], -1);
  blocks.gravity = {0.5, 0, -3};
  blocks.forces[0].stiffness = 400;
  blocks.mass_damping = 0.1;
  simulation.apply(0, blocks);
  EXPECT_EQ(simulation.settings(1).gravity, light.gravity);  // its own
  EXPECT_EQ(simulation.settings(1).mass_damping, 0.1);
  light = simulation.settings(1);
  light.gravity[2] = -2;
  light.forces[0].given = true;
  light.forces[0].weights = {0.25, 0.75};
  simulation.apply(1, light);
  EXPECT_EQ(simulation.settings(0).gravity, blocks.gravity);
  exmat_obstacle ball = default_obstacle();
  ball.shape = EXMAT_SPHERE;
  ball.radius = 0.1;
  ball.point[0] = 0.5;
  simulation.add_obstacle(ball);
  simulation.advance(120);
  std::filesystem::create_directories(folder_ / "other");
  simulation.save_scene(folder_ / "other/saved.json");
  EXPECT_EQ(simulation.hash(), hash_of(folder_ / "other/saved.json", 120));
  EXPECT_NE(simulation.hash(), hash_of(folder_ / "scene.json", 120));
}

TEST_F(WorldSimulations, GoOnUnderAnotherModel) {
  Simulation simulation = make();
  simulation.advance(50);
  const std::vector<float> before = simulation.positions(2);
  Settings settings = simulation.settings(1);
  settings.time_step = 0.001;
  simulation.apply(1, settings);
  EXPECT_EQ(simulation.positions(2), before);
  EXPECT_EQ(simulation.time_step(), 0.001);
  EXPECT_EQ(simulation.settings(0).time_step, 0.001);
  simulation.advance(20);
  EXPECT_TRUE(simulation.failure().empty());
}

// A hand lifts the upper one of two kinds off the others; thrown, it flies as a free body does.
TEST_F(WorldSimulations, AreHeldAndThrown) {
  Simulation simulation = make();
  simulation.advance(100);
  const auto shape = simulation.shape(1);
  const int hand = simulation.grab(2, nearest_place(shape->bounds.most, shape->rest, shape->triangles));
  const Eigen::Vector3d from = simulation.snapshot({}).grips.at(0).point;
  simulation.move_grip(hand, from + Eigen::Vector3d(0, 0, 1));
  simulation.advance(200);
  EXPECT_GT(simulation.snapshot({}).grips.at(0).point.z(), from.z() + 0.75);
  simulation.release(hand);
  const auto height = [&] { return simulation.snapshot({}).bodies[2].motion.position[2]; };
  const double start = height();
  ASSERT_TRUE(simulation.throw_body(2, {0, 0, 3}, Eigen::Vector3d::Zero()));
  simulation.advance(100);
  // v t - g t^2 / 2 with the damping of the scene, 0.5 / s, which takes 0.03 m of it.
  EXPECT_NEAR(height() - start, 3 * 0.2 - 0.5 * 1 * 0.04, 0.035);
}

TEST_F(WorldSimulations, AreAlone) {
  const SceneDocument scene = SceneDocument::open(folder_.write("scene.json", kScene));
  EXPECT_ANY_THROW(scene.with_bundle(folder_ / "sub/block.h5"));
}

}  // namespace world_simulation_test
}  // namespace exmat::viewer

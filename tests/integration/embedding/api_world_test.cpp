#include <Eigen/Geometry>
#include <exmat/exmat.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "runtime/scene/scene_run.h"
#include "tests/integration/embedding/api_fixture.h"
#include "tests/support/synthetic_model.h"

namespace exmat::test {
namespace api_world_test {

using ::testing::HasSubstr;

constexpr double kTimeStep = 0.002;

/// Free blocks of 0.4 x 0.2 x 0.2 m that touch each other.
class ApiWorldTest : public ::testing::Test {
 protected:
  ApiWorldTest() {
    block_.model.contact = surface_contact(block_.model);
    write_bundle(block_.model, files_.folder() / "block.h5");
  }

  static exmat_settings settings(double gravity = 0) {
    exmat_settings settings = default_settings();
    settings.time_step = kTimeStep;
    settings.gravity[2] = -gravity;
    settings.use_contact = 1;
    return settings;
  }
  Model model(double gravity = 0) const { return Model(files_.folder() / "block.h5", settings(gravity)); }

  static exmat_contact_law law(double friction = 0.4) {
    exmat_contact_law law = default_contact_law();
    law.stiffness = 1e7;
    law.damping = 2e4;
    law.friction = friction;
    return law;
  }
  static exmat_motion at(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero()) {
    return {0, {position[0], position[1], position[2]}, {1, 0, 0, 0}, {velocity[0], velocity[1], velocity[2]}, {}};
  }
  static Body body(const Model& model, const exmat_motion& motion) {
    Body body(model);
    body.set_motion(motion);
    return body;
  }
  /// Two blocks that are about to meet, off centre.
  World collision(const Model& model) const {
    World world(law());
    world.add(body(model, at({0, 0, 0}, {2, 0, 0})));
    world.add(body(model, at({0.45, 0.06, 0.03}, {-2, 0, 0})));
    return world;
  }

  double mass() const { return block_.model.rigid->mass; }

  Bar block_ = make_bar({.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true});
  BarFiles files_;
};

Eigen::Vector3d velocity_of(const BodyRef& body) { return Eigen::Vector3d(body.motion().linear_velocity); }

exmat_status code_of(const std::function<void()>& action) {
  try {
    action();
    return EXMAT_OK;
  } catch (const Error& error) {
    return error.status();
  }
}

TEST_F(ApiWorldTest, AWorldOfASceneAndOneOfItsHostAreThatOfARunBitForBit) {
  const std::string scene = files_.folder().write("world.json", R"({
    "time_step": 0.002, "steps": 150, "gravity": [0, 0, -9.81],
    "contact": {"stiffness": 1e7, "damping": 2e4, "friction": 0.4},
    "obstacles": [{"plane": {"normal": [0, 0, 1]}, "stiffness": 1e7, "damping": 2e4, "friction": 0.5}],
    "bodies": [{"name": "block", "bundle": "block.h5",
                "body": {"position": [0, 0, 0.02]},
                "grid": {"counts": [1, 2, 2], "spacing": [0.1, 0.15, 0.22]}}]})");
  const WorldConfig config = load_world(scene);
  const runtime::RunSummary expected = run(runtime::load_world_run(config), config);
  ASSERT_GT(expected.most_pairs, 1);
  ASSERT_TRUE(expected.overlap) << "blocks of 0.2 m begin 0.15 m apart";
  EXPECT_FALSE(expected.overlap->is_obstacle);
  EXPECT_NEAR(expected.overlap->depth, 0.05, 1e-6);

  World of_scene = World::from_scene(scene);
  ASSERT_THAT(of_scene.ids(), ::testing::ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(of_scene.name(2), "block_2");
  EXPECT_EQ(of_scene.kind(3), 0);
  EXPECT_EQ(of_scene.kind(4), -1);
  const exmat_world_report report = of_scene.step(150, 1);
  EXPECT_EQ(report.steps, 150);
  EXPECT_EQ(report.unconverged_islands, expected.unconverged_islands);
  EXPECT_EQ(report.largest_island, expected.largest_island);
  EXPECT_EQ(of_scene.hash(), expected.state_hash);

  World of_text = World::from_text(read_file(scene), files_.folder() / "elsewhere.json");
  of_text.step(150);
  EXPECT_EQ(of_text.hash(), expected.state_hash);

  const Model model = this->model(9.81);
  World of_host(law());
  exmat_obstacle floor = default_obstacle();
  floor.stiffness = 1e7;
  floor.damping = 2e4;
  floor.friction = 0.5;
  for (const std::int64_t id : of_scene.ids()) {
    Body body(model);
    body.set_motion(
        at(Eigen::Vector3d(0, 0, 0.02) + config.bodies.front().places[static_cast<std::size_t>(id)].position));
    EXPECT_EQ(of_host.kind(of_host.add(std::move(body))), -1);
  }
  EXPECT_EQ(of_host.add_obstacle(floor), 0);
  for (int i = 0; i < 15; ++i) of_host.step(10, 2);
  EXPECT_EQ(of_host.hash(), expected.state_hash);
}

TEST_F(ApiWorldTest, ContactsAreEqualAndOppositeAndAddUpToTheLoadOfEachBody) {
  const Model model = this->model();
  World world = collision(model);
  bool met = false;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d before[] = {velocity_of(world.body(0)), velocity_of(world.body(1))};
    const exmat_world_report report = world.step(1, 1);
    ASSERT_EQ(report.unconverged_islands, 0);
    Eigen::Vector3d force[] = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    for (const exmat_body_contact& contact : world.contacts()) {
      ASSERT_EQ(contact.body + contact.other, 1);
      const Eigen::Vector3d own(contact.force);
      force[contact.body] += own;
      force[contact.other] -= own;
      EXPECT_GT(own.dot(Eigen::Vector3d(contact.normal)), 0);
      EXPECT_NEAR(Eigen::Vector3d(contact.normal).norm(), 1, 1e-12);
    }
    for (int k = 0; k < 2; ++k) {
      Eigen::Vector3d load;
      world.body(k).read_contact_load(-1, load.data(), nullptr);
      const Eigen::Vector3d change = mass() * (velocity_of(world.body(k)) - before[k]) / kTimeStep;
      // The load is the change of momentum; the contacts listed are those with a normal force, all but those that
      // friction alone still holds.
      EXPECT_LE((load - change).norm(), 1e-9 * (1 + change.norm()));
      if (load.norm() > 0) {
        EXPECT_LE((force[k] - load).norm(), 0.05 * load.norm()) << i;
      }
      met = met || load.norm() > 1;
    }
  }
  EXPECT_TRUE(met);
  EXPECT_LE((velocity_of(world.body(0)) + velocity_of(world.body(1))).norm(), 1e-12);
}

using Touch = std::tuple<std::int64_t, std::int64_t, std::int64_t, std::int32_t>;

std::vector<Touch> touches_of(const World& world) {
  std::vector<Touch> touches;
  for (const exmat_touch& touch : world.touches())
    touches.emplace_back(touch.body, touch.other, touch.obstacle, touch.change);
  return touches;
}

TEST_F(ApiWorldTest, ATouchBeginsStaysAndEnds) {
  const Model model = this->model();
  World world = collision(model);
  std::string changes;
  for (int i = 0; i < 60; ++i) {
    world.step(1, 1);
    const std::vector<Touch> touches = touches_of(world);
    ASSERT_LE(touches.size(), 1u);
    EXPECT_TRUE(world.contacts().empty() || !touches.empty());
    if (touches.empty()) continue;
    const auto [body, other, obstacle, change] = touches.front();
    EXPECT_EQ(std::tuple(body, other, obstacle), std::tuple(0, 1, -1));
    changes += static_cast<char>('0' + change);
  }
  EXPECT_THAT(changes, ::testing::MatchesRegex("01+2"));

  // All of it in one call leaves nothing to tell, and an end needs what touched where the call began.
  World again = collision(model);
  again.step(60, 1);
  EXPECT_TRUE(again.touches().empty());
  World part = collision(model);
  part.step(14, 1);
  EXPECT_THAT(touches_of(part), ::testing::ElementsAre(Touch(0, 1, -1, EXMAT_TOUCH_BEGINS)));
  part.step(46, 1);
  EXPECT_THAT(touches_of(part), ::testing::ElementsAre(Touch(0, 1, -1, EXMAT_TOUCH_ENDS)));
  Body out = part.remove(1);
  EXPECT_TRUE(part.touches().empty());
}

TEST_F(ApiWorldTest, TouchesOfBodiesThatFallAsleepStay) {
  exmat_settings settings = this->settings(9.81);
  settings.mass_damping = 5;
  settings.sleep_energy = 1e-3;
  settings.sleep_time = 0.02;
  const Model model(files_.folder() / "block.h5", settings);
  World world(law());
  world.add(body(model, at({0, 0, 0})));
  world.add(body(model, at({0, 0, 0.2})));
  exmat_obstacle floor = default_obstacle();
  floor.stiffness = 1e7;
  floor.damping = 2e4;
  EXPECT_EQ(world.add_obstacle(floor), 0);
  floor.point[2] = -1;
  EXPECT_EQ(world.add_obstacle(floor), 1);
  world.step(200, 1);
  const Touch piled(0, 1, -1, EXMAT_TOUCH_STAYS), stands(0, -1, 0, EXMAT_TOUCH_STAYS);
  bool slept = false;
  for (int i = 0; i < 200; ++i) {
    slept = world.step(1, 1).asleep == 2;
    EXPECT_THAT(touches_of(world), ::testing::ElementsAre(piled, stands)) << i;
  }
  EXPECT_TRUE(slept);

  // Rollback: what a world does again it tells again.
  std::vector<std::uint64_t> snapshot;
  world.save(snapshot);
  const auto push = [&] {
    exmat_motion up = world.body(1).motion();
    up.linear_velocity[2] = 1;
    world.body(1).set_motion(up);
    world.step(10, 1);
    return touches_of(world);
  };
  const std::vector<Touch> first = push();
  EXPECT_THAT(first, ::testing::ElementsAre(stands));
  world.restore(snapshot);
  EXPECT_TRUE(world.touches().empty());
  EXPECT_EQ(push(), first);
  world.remove_obstacle(0);
  world.step(1, 1);
  EXPECT_TRUE(world.touches().empty());
}

TEST_F(ApiWorldTest, AStateTakesAWorldBackToTheLastBit) {
  const Model model = this->model(9.81);
  World world = collision(model);
  world.step(14, 1);
  ASSERT_FALSE(world.contacts().empty());
  const std::vector<double> state = world.state();
  world.step(40, 1);
  const std::uint64_t there = world.hash();
  world.set_state(state);
  world.step(40, 2);
  EXPECT_EQ(world.hash(), there);

  World other = collision(model);
  other.set_state(state);
  other.step(40, 1);
  EXPECT_EQ(other.hash(), there);
}

TEST_F(ApiWorldTest, NumbersThatAreNoStateOfItLeaveAWorldAsItIs) {
  const Model model = this->model();
  World world = collision(model);
  world.step(14, 1);
  const std::vector<double> state = world.state();
  const std::uint64_t before = world.hash();
  for (std::size_t length = 0; length < state.size(); ++length) {
    const std::vector<double> cut(state.begin(), state.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_EQ(code_of([&] { world.set_state(cut); }), EXMAT_INVALID_ARGUMENT) << length;
  }
  for (const double odd : {-1.0, 0.5, 1e18, std::nan("")})
    for (std::size_t i = 0; i < state.size(); i += i < 10 || i + 40 > state.size() ? 1 : 7) {
      std::vector<double> changed = state;
      changed[i] = odd;
      if (code_of([&] { world.set_state(changed); }) == EXMAT_OK) world.set_state(state);  // a number like any other
    }
  EXPECT_EQ(world.hash(), before);
  EXPECT_EQ(world.state(), state);
}

TEST_F(ApiWorldTest, ABodyThatIsTakenOutGoesOnAlone) {
  const Model model = this->model();
  World world = collision(model);
  world.step(14, 1);
  ASSERT_FALSE(world.contacts().empty());
  Body out = world.remove(0);
  EXPECT_TRUE(world.contacts().empty());
  EXPECT_EQ(world.size(), 1u);
  EXPECT_EQ(world.ids(), std::vector<std::int64_t>{1});
  const Eigen::Vector3d velocity = velocity_of(out), others = velocity_of(world.body(1));
  out.step(20);
  world.step(20, 1);
  EXPECT_LE((velocity_of(out) - velocity).norm(), 1e-12);
  EXPECT_LE((velocity_of(world.body(1)) - others).norm(), 1e-12);
  EXPECT_EQ(world.add(std::move(out)), 2);
  EXPECT_EQ(exmat_world_body(world.get(), 0), nullptr);
  world.step(1, 1);
  exmat_body_destroy(world.body(2).get());
  EXPECT_EQ(world.size(), 1u);
}

TEST_F(ApiWorldTest, ABodyThatIsPutElsewhereIsNotHeldByWhatItTouched) {
  const Model model = this->model();
  World world = collision(model);
  world.step(14, 1);
  ASSERT_FALSE(world.contacts().empty());
  world.body(1).set_motion(at({5, 0, 0}));
  EXPECT_TRUE(world.contacts().empty());
  const exmat_world_report report = world.step(30, 1);
  EXPECT_EQ(report.pairs, 0);
  EXPECT_LE(velocity_of(world.body(1)).norm(), 1e-12);

  // Put into one another they part.
  world.body(1).reset();
  world.body(0).set_motion(at({0.38, 0, 0}));
  world.step(200, 1);
  const exmat_motion a = world.body(0).motion(), b = world.body(1).motion();
  EXPECT_GE(std::abs(a.position[0] - b.position[0]), 0.38);
}

TEST_F(ApiWorldTest, TheLawChangesBetweenSteps) {
  World world(law());
  exmat_contact_law softer = law();
  softer.stiffness = 1e5;
  world.set_contact_law(softer);
  EXPECT_EQ(world.contact_law().stiffness, 1e5);
  const Model model = this->model();
  world.add(body(model, at({0, 0, 0}, {1, 0, 0})));
  world.add(body(model, at({0.42, 0, 0}, {-1, 0, 0})));
  double deepest = 0;
  for (int i = 0; i < 60; ++i) {
    world.step(1, 1);
    for (const exmat_body_contact& contact : world.contacts()) deepest = std::max(deepest, contact.depth);
  }
  EXPECT_GT(deepest, 0.003);  // 1e7 lets in a tenth of that
}

TEST_F(ApiWorldTest, WrongArgumentsAreRefusedInWords) {
  const auto says = [](exmat_status status, const char* words) {
    EXPECT_EQ(status, EXMAT_INVALID_ARGUMENT);
    EXPECT_THAT(exmat_last_error(), HasSubstr(words));
  };
  exmat_contact_law wrong = law();
  exmat_world* none = nullptr;
  for (double exmat_contact_law::*const member :
       {&exmat_contact_law::stiffness, &exmat_contact_law::damping, &exmat_contact_law::friction}) {
    wrong = law();
    wrong.*member = -1;
    says(exmat_world_create(&wrong, &none), "= -1: expected");
    EXPECT_EQ(none, nullptr);
  }
  wrong = law();
  wrong.stiffness = 1e16;
  says(exmat_world_create(&wrong, &none), "law.stiffness = 1e+16: expected a number above 0, of at most 1e+15; steel");
  wrong = law();
  wrong.self = 2;
  says(exmat_world_create(&wrong, &none), "law.self = 2: expected 0 or 1");
  wrong = law();
  wrong.self = wrong.apart = 1;
  says(exmat_world_create(&wrong, &none), "law.self = 1: expected 0 with law.apart = 1");
  const Model model = this->model();
  World world = collision(model);
  std::int64_t id = 0;
  Body alone(Model(files_.folder() / "block.h5", default_settings()));
  says(exmat_world_add_body(world.get(), alone.get(), &id), "use_contact");
  exmat_settings other = settings();
  other.time_step = 0.001;
  Body faster(Model(files_.folder() / "block.h5", other));
  says(exmat_world_add_body(world.get(), faster.get(), &id), "time step is 0.001 s");
  EXPECT_EQ(id, -1);
  says(exmat_world_add_body(world.get(), world.body(0).get(), &id), "in a world already");
  says(exmat_body_step(world.body(0).get(), 1, nullptr), "in a world, whose step() takes it along");
  says(exmat_world_add_body(exmat_body_world(faster.get()), alone.get(), &id), "found a body's own");
  says(exmat_body_set_group(alone.get(), 0, 1), "group = 0");
  exmat_body* body = nullptr;
  says(exmat_world_remove_body(world.get(), 7, &body), "id = 7");
  says(exmat_world_step(world.get(), -1, 1, nullptr), "steps = -1");
  says(exmat_world_step(world.get(), 1, -1, nullptr), "threads = -1");
  says(exmat_world_step(nullptr, 1, 1, nullptr), "world is NULL");
  says(exmat_world_read_body_ids(world.get(), &id, 1), "expected 2");
  EXPECT_EQ(exmat_world_bodies(nullptr), -1);
  EXPECT_EQ(exmat_world_contacts(nullptr), -1);
  EXPECT_EQ(exmat_world_state_size(nullptr), -1);
  EXPECT_EQ(exmat_world_body_name(world.get(), 9), nullptr);
  exmat_world_destroy(nullptr);
}

TEST_F(ApiWorldTest, ABodyThatBreaksIsNamedAndTheOthersGoOn) {
  const Model model = this->model();
  exmat_settings damped = settings();
  damped.stiffness_damping = 1e300;
  World world(law());
  world.add(body(model, at({0, 0, 0}, {1, 0, 0})));
  world.add(body(Model(files_.folder() / "block.h5", damped), at({5, 0, 0}, {1, 0, 0})));
  const std::vector<double> far(static_cast<std::size_t>(model.modes()), 1e30);
  world.body(1).set_reduced(far, far);
  exmat_world_report report{};
  report.size = sizeof report;
  const exmat_status status = exmat_world_step(world.get(), 10, 1, &report);
  EXPECT_EQ(status, EXMAT_NON_FINITE);
  EXPECT_THAT(exmat_last_error(), HasSubstr("body 1"));
  EXPECT_LT(report.steps, 10);
  EXPECT_NEAR(world.body(0).time(), world.body(1).time() + kTimeStep, 1e-12);
}

}  // namespace api_world_test
}  // namespace exmat::test

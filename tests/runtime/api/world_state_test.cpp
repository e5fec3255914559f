#include <array>
#include <cstring>
#include <exmat/exmat.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <memory>

#include "common/bundle/bundle.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;
using Snapshot = std::vector<std::uint64_t>;

constexpr int kFrames = 300;
constexpr double kTimeStep = 0.004;
constexpr double kEverywhere[] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  // a frame that is the world

/// A world and what its host does to it before each frame.
struct Replay {
  const char* name;
  test::BarOptions bar;
  exmat_settings settings;
  int bodies;
  std::array<double, 3> spacing;  ///< [m]
  void (*act)(exmat::World& world, const exmat::Points& points, int frame);
  const char* happened;  ///< what must have come about by the end
  bool (*happens)(exmat::World& world, const exmat_world_report& report);
};

exmat_settings settings() {
  exmat_settings settings = exmat::default_settings();
  settings.time_step = kTimeStep;
  settings.gravity[2] = -9.81;
  settings.stiffness_damping = 0.002;
  settings.use_contact = 1;
  return settings;
}

exmat_settings sleepy() {
  exmat_settings own = settings();
  own.mass_damping = 20;
  own.stiffness_damping = 0.02;
  own.sleep_energy = 0.5;
  own.sleep_time = 0.02;
  return own;
}

exmat_settings of_space(std::int32_t space) {
  exmat_settings own = settings();
  own.space = space;
  own.space_release = 0.1;
  return own;
}

exmat_settings posed() {
  exmat_settings own = settings();
  own.use_examples = 1;
  own.example_stiffness = 400;
  own.example_target = EXMAT_TARGET_SOLVE;
  own.target_iterations = 1;
  return own;
}

exmat_motion moving(double x, double z) { return {0, {x, 0, z}, {1, 0, 0, 0}, {0.2, 0, 0}, {0, 0.3, 0}}; }

void push(exmat::World& world, const exmat::Points& points, int frame) {
  if (frame == 40) world.body(0).apply_forces(points, std::array{0.0, 5.0, 20.0});
  if (frame == 90) world.body(0).clear_forces();
  static std::int64_t wind = -1;
  if (frame == 95) wind = world.body(0).add_forces(points, std::array{0.0, 3.0, 1.0});
  if (frame == 105) world.body(0).apply_forces(points, std::array{0.0, 0.1, 0.0});
  if (frame == 115) world.body(0).set_forces(wind, points, std::array{1.0, 3.0, 0.0});
  if (frame == 135) world.body(0).remove_forces(wind);
  if (frame == 130) world.move_obstacle(0, moving(0, 0.01));
  if (frame == 150) world.move_obstacle(0, {0, {}, {1, 0, 0, 0}, {}, {}});
  if (frame == 160) world.set_obstacle_law(0, 2e6, 1e4, 0.1);
}

void pose(exmat::World& world, const exmat::Points& points, int frame) {
  push(world, points, frame);
  if (frame == 60) world.body(1).set_example_weights(std::array{0.2, 0.8, 0.0});
  if (frame == 110) world.body(2).set_example_stiffness(900);
  if (frame == 120) world.body(3).set_example_bias(0.5);
  if (frame == 180) world.body(1).set_example_weights({});
}

void hold(exmat::World& world, const exmat::Points& points, int frame) {
  push(world, points, frame);
  exmat::BodyRef body = world.body(0);
  static std::int64_t held = -1;
  if (frame == 70) held = body.attach(std::array<std::int64_t, 4>{32, 33, 34, 35}, kEverywhere);
  if (frame > 70 && frame < 200) {
    std::array<double, 12> frame_now{};
    std::ranges::copy(kEverywhere, frame_now.begin());
    frame_now[7] = 0.001 * (frame - 70);
    body.move_attachment(held, frame_now);
  }
  if (frame == 200) body.detach(held);
  if (frame == 210) body.set_gravity(std::array{0.0, 0.0, -5.0});
  if (frame == 220) body.set_damping(1, 0.003);
}

void tie(exmat::World& world, const exmat::Points& points, int frame) {
  push(world, points, frame);
  exmat::BodyRef body = world.body(1);
  const std::array<std::int64_t, 4> own{0, 1, 2, 3}, other{32, 33, 34, 35};
  static std::array<std::int64_t, 2> held{};
  exmat_attachment spring = exmat::default_attachment();
  spring.kind = EXMAT_ATTACHMENT_SPRING;
  spring.damping = 20;
  if (frame == 70)
    held = {body.attach_to(own, world.body(0), other), body.attach_to(own, world.body(2), other, spring)};
  if (frame == 200) body.detach(held[0]);
}

bool sleeps(exmat::World& /*world*/, const exmat_world_report& report) { return report.asleep > 0; }
bool went_full(exmat::World& world, const exmat_world_report& /*report*/) {
  return exmat_body_space(world.body(0).get()) == EXMAT_SPACE_FULL;
}
bool touched(exmat::World& world, const exmat_world_report& /*report*/) {
  return exmat_body_contacts(world.body(0).get()) > 0;
}

std::vector<Replay> replays() {
  const test::BarOptions block{.cells = {3, 2, 2}, .lengths = {0.3, 0.2, 0.2}, .youngs_modulus = 5e5, .free = true};
  test::BarOptions bar{.youngs_modulus = 5e5, .examples = 3};
  return {
      {"pile", block, sleepy(), 4, {0.004, 0.003, 0.2}, push, "sleep", sleeps},
      {"lanes", bar, posed(), 11, {0, 2, 0}, pose, "contact", touched},
      {"tied", block, settings(), 3, {0.3, 0, 0.1}, tie, "contact", touched},
      {"held_in_modes", {.free = true}, settings(), 1, {0, 2, 0}, hold, "contact", touched},
      {"auto", block, of_space(EXMAT_SPACE_AUTO), 3, {0, 0.5, 0.1}, hold, "all vertices", went_full},
      {"full",
       {.youngs_modulus = 5e5, .examples = 2},
       of_space(EXMAT_SPACE_FULL),
       2,
       {0, 2, 0},
       hold,
       "contact",
       touched},
  };
}

class Snapshots : public ::testing::TestWithParam<Replay> {
 protected:
  exmat::Model make(const Replay& test) {
    test::Bar bar = test::make_bar(test.bar);
    bar.model.contact = test::surface_contact(bar.model);
    bar.model.input_sha256 = std::string(64, 'a');
    write_bundle(bar.model, folder_ / "bar.h5");
    return exmat::Model(folder_ / "bar.h5", test.settings);
  }
  static exmat::World make_world(const Replay& test, const exmat::Model& model) {
    exmat_contact_law law = exmat::default_contact_law();
    law.stiffness = 2e6;
    law.damping = 1e4;
    law.friction = 0.4;
    law.apart = test.bodies > 1 && test.bar.free ? 0 : 1;
    exmat::World world(law);
    exmat_obstacle floor = exmat::default_obstacle();
    floor.point[2] = -0.02;
    floor.stiffness = 2e6;
    floor.damping = 1e4;
    floor.friction = 0.5;
    world.add_obstacle(floor);
    for (int i = 0; i < test.bodies; ++i) {
      exmat::Body body(model);
      if (test.bar.free) {
        exmat_motion motion = body.motion();
        for (std::size_t axis = 0; axis < 3; ++axis) motion.position[axis] += i * test.spacing[axis];
        motion.linear_velocity[0] = 0.3;
        body.set_motion(motion);
      }
      world.add(std::move(body));
    }
    return world;
  }
  static std::vector<std::uint64_t> play(const Replay& test, exmat::World& world, const exmat::Points& points, int from,
                                         int to, bool& happened) {
    std::vector<std::uint64_t> hashes;
    for (int frame = from; frame < to; ++frame) {
      test.act(world, points, frame);
      happened |= test.happens(world, world.step(1, 1 + frame % 2));
      hashes.push_back(world.hash());
    }
    return hashes;
  }
  static Snapshot saved(const exmat::World& world) {
    Snapshot snapshot(exmat_world_snapshot_size(world.get()) / sizeof(std::uint64_t));
    EXPECT_EQ(exmat_world_save(world.get(), snapshot.data(), snapshot.size() * sizeof(std::uint64_t)), EXMAT_OK)
        << exmat_last_error();
    return snapshot;
  }

  test::TemporaryFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(Worlds, Snapshots, ::testing::ValuesIn(replays()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(Snapshots, FramesThatAreReplayedHaveTheSameBits) {
  const Replay test = GetParam();
  const exmat::Model model = make(test);
  const exmat::Points points = exmat::Points::vertices(model, std::array<std::int64_t, 1>{35});
  exmat::World world = make_world(test, model);
  bool happened = false;
  std::vector<std::pair<int, Snapshot>> snapshots;
  std::vector<std::uint64_t> hashes;
  for (int frame = 0; frame < kFrames; frame += 25) {
    snapshots.emplace_back(frame, saved(world));
    const auto own = play(test, world, points, frame, frame + 25, happened);
    hashes.insert(hashes.end(), own.begin(), own.end());
  }
  EXPECT_TRUE(happened) << test.happened;
  const Snapshot end = saved(world);

  // The last of them first, and then all 300 frames, so that each undoes what the host did in between.
  for (const int back : {11, 4, 7, 0}) {
    const auto& [frame, snapshot] = snapshots[static_cast<std::size_t>(back)];
    world.restore(snapshot);
    EXPECT_EQ(saved(world), snapshot);
    const auto again = play(test, world, points, frame, kFrames, happened);
    const auto differs = std::ranges::mismatch(again, std::span(hashes).subspan(static_cast<std::size_t>(frame)));
    ASSERT_EQ(differs.in1, again.end()) << "frame " << frame + (differs.in1 - again.begin()) << " from " << frame;
    EXPECT_EQ(saved(world), end);
  }

  // A world that is made the same way goes on as well.
  exmat::World other = make_world(test, model);
  other.restore(snapshots[8].second);
  const auto there = play(test, other, points, 200, kFrames, happened);
  EXPECT_TRUE(std::ranges::equal(there, std::span(hashes).subspan(200)));
}

TEST_P(Snapshots, AreSavedAndRestoredWithoutAllocation) {
  if (!test::AllocationCounter::works()) GTEST_SKIP();
  const Replay test = GetParam();
  const exmat::Model model = make(test);
  const exmat::Points points = exmat::Points::vertices(model, std::array<std::int64_t, 1>{35});
  exmat::World world = make_world(test, model);
  bool happened = false;
  play(test, world, points, 0, 100, happened);  // the host holds what it holds
  Snapshot snapshot = saved(world);
  play(test, world, points, 100, 103, happened);
  const std::size_t now = exmat_world_snapshot_size(world.get());
  snapshot.resize(std::max(snapshot.size(), now / sizeof(std::uint64_t)));
  Snapshot later(snapshot.size());
  std::size_t allocations = 0;
  {
    const test::AllocationCounter counter;
    EXPECT_EQ(exmat_world_save(world.get(), later.data(), now), EXMAT_OK);
    EXPECT_EQ(exmat_world_restore(world.get(), snapshot.data(), snapshot.size() * sizeof(std::uint64_t)), EXMAT_OK);
    allocations = counter.count();
  }
  EXPECT_EQ(allocations, 0U);
}

using BadSnapshots = Snapshots;

TEST_F(BadSnapshots, AreRefusedInWordsAndTheWorldIsAsItWas) {
  const Replay test = replays()[0];
  const exmat::Model model = make(test);
  exmat::World world = make_world(test, model);
  world.step(60);
  const Snapshot good = saved(world);
  const std::size_t bytes = good.size() * sizeof(std::uint64_t);
  world.step(10);
  const Snapshot now = saved(world);
  const auto refuses = [&](const Snapshot& snapshot, std::size_t size, const char* words) {
    EXPECT_EQ(exmat_world_restore(world.get(), snapshot.data(), size), EXMAT_INVALID_ARGUMENT) << words;
    EXPECT_THAT(exmat_last_error(), HasSubstr(words));
    EXPECT_EQ(saved(world), now) << words;
  };
  EXPECT_EQ(exmat_world_snapshot_size(nullptr), 0U);
  EXPECT_EQ(exmat_world_save(world.get(), nullptr, bytes), EXMAT_INVALID_ARGUMENT);
  Snapshot buffer(good.size() + 1);
  EXPECT_EQ(exmat_world_save(world.get(), buffer.data(), 100), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("size = 100: expected at least"));
  EXPECT_EQ(buffer[0], 0U) << "it is no snapshot";
  auto* const odd = reinterpret_cast<char*>(buffer.data()) + 1;
  EXPECT_EQ(exmat_world_save(world.get(), odd, bytes), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("aligned to 8 bytes"));
  EXPECT_EQ(exmat_world_restore(world.get(), odd, bytes), EXMAT_INVALID_ARGUMENT);

  refuses(good, 8, "expected a snapshot, as the world saves it");
  refuses(Snapshot(good.size(), 7), bytes, "expected a snapshot, as the world saves it");
  refuses(good, bytes - 1, "it ends early");
  for (std::size_t word = 0; word < good.size(); word += 1 + good.size() / 200)
    for (const int bit : {0, 30, 63}) {
      Snapshot bad = good;
      bad[word] ^= std::uint64_t{1} << bit;
      refuses(bad, bytes, "buffer: ");
    }
  Snapshot of_later = good;
  of_later[1] = 9;
  refuses(of_later, bytes, "version 9: expected 3");

  exmat::World more = make_world(test, model);
  more.add(exmat::Body(model));
  EXPECT_EQ(exmat_world_restore(more.get(), good.data(), bytes), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("other bodies or obstacles"));
  EXPECT_GT(exmat_world_snapshot_size(more.get()), exmat_world_snapshot_size(make_world(test, model).get()));

  Snapshot longer = good;
  longer.resize(good.size() + 100, 5);
  world.restore(longer);  // as a buffer that serves many snapshots
  EXPECT_EQ(saved(world), good);
}

}  // namespace
}  // namespace exmat::runtime

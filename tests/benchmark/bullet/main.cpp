// The same bodies by exmat and by Bullet's btReducedDeformableBody, in turns: a table for docs/comparison.md.
#include <algorithm>
#include <fmt/format.h>
#include <functional>
#include <vector>

#include "tests/benchmark/bullet/bullet_bodies.h"
#include "tests/benchmark/thread_clock.h"
#include "tests/runtime/sim/world/touching_blocks.h"

namespace exmat::benchmarks {
namespace {

using runtime::World;
using runtime::WorldBodyStart;
using runtime::test::Blocks;

constexpr BulletBodies::Settings kSettings{
    .time_step = 1e-3, .gravity = 9.81, .mass_damping = 1, .stiffness_damping = 1e-4, .friction = 0.5};
constexpr double kStiffness = 1e7, kDamping = 5e4;  // of exmat's contacts [N/m^3], [N s/m^3]
constexpr int kSettle = 500, kRounds = 20, kStepsOfRound = 25;

struct Case {
  const char* name;
  std::vector<Eigen::Vector3d> places;
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();
  bool floor = true;
};

/// Microseconds of one body's step, of each round; all steps are taken in this thread alone.
struct Times {
  std::vector<double> each;
  void add(int bodies, const std::function<void()>& step) {
    const double start = thread_seconds();
    for (int i = 0; i < kStepsOfRound; ++i) step();
    each.push_back(1e6 * (thread_seconds() - start) / (kStepsOfRound * bodies));
  }
  double median() {
    std::nth_element(each.begin(), each.begin() + kRounds / 2, each.end());
    return each[kRounds / 2];
  }
};

/// Modes and mesh of the blocks; exmat takes all elements, so that its force is exact in the space of the modes.
Blocks blocks_of(bool floor) {
  test::BarOptions options = Blocks::free_block();
  options.youngs_modulus = 2e5;
  options.linear_modes = 20;
  Blocks blocks(kSettings.time_step, options);
  blocks.set_gravity(kSettings.gravity);
  if (floor) blocks.add_floor(kStiffness, kSettings.friction, kDamping);
  blocks.scene.mass_damping = kSettings.mass_damping;
  blocks.scene.stiffness_damping = kSettings.stiffness_damping;
  return blocks;
}

void run(const Case& scene) {
  const Blocks blocks = blocks_of(scene.floor);
  std::vector<WorldBodyStart> starts;
  for (const Eigen::Vector3d& place : scene.places)
    starts.push_back(blocks.body(place, Eigen::Vector3d::Zero(), scene.spin));
  World world(starts, {kStiffness, kDamping, kSettings.friction});
  BulletBodies::Settings settings = kSettings;
  settings.floor = scene.floor;
  BulletBodies bullet(blocks.bar, settings);
  for (const Eigen::Vector3d& place : scene.places) bullet.add(place, scene.spin);
  const auto step_exmat = [&] { world.step(1); };
  const auto step_bullet = [&] { bullet.step(); };
  for (int i = 0; i < kSettle; ++i) {
    step_exmat();
    step_bullet();
  }
  const int count = world.count();
  Times exmat, other;
  for (int round = 0; round < kRounds; ++round) {
    exmat.add(count, step_exmat);
    other.add(count, step_bullet);
  }
  const double ours = exmat.median(), theirs = other.median();
  fmt::print("| {} | {} | {:.3g} | {:.3g} | {:.3g} | {:.3f} | {:.3f} | {} |\n", scene.name, count, ours, theirs,
             theirs / ours, blocks.centre(world.state(count - 1)).z(), bullet.centre(count - 1).z(), bullet.touching());
}

}  // namespace
}  // namespace exmat::benchmarks

int main() {
  using namespace exmat::benchmarks;
  fmt::print(
      "| | bodies | exmat [us] | Bullet [us] | Bullet over exmat | top body, exmat [m] | top body, Bullet [m] | "
      "vertices "
      "that Bullet finds on the floor |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  run({.name = "flight", .places = {{0, 0, 0}}, .spin = {0.6, 1.8, 0.4}, .floor = false});
  run({.name = "floor", .places = {{0, 0, 0.001}}});
  std::vector<Eigen::Vector3d> stack;
  for (int level = 0; level < 5; ++level)
    stack.emplace_back(0.01 * (level % 2), 0.007 * (level % 3), 0.001 + 0.2 * level);
  run({.name = "pile", .places = stack});
  const Blocks blocks = blocks_of(false);
  const BulletBodies none(blocks.bar, kSettings);
  fmt::print("\nSteps of {:g} ms; Bullet's, which are explicit, may have {:.2g} ms with these modes.\n",
             1e3 * kSettings.time_step, 2e3 / none.highest_frequency());
  return 0;
}

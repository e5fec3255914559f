#include <omp.h>

#include "tests/benchmark/register.h"
#include "tests/runtime/sim/world/fork.h"

namespace exmat::benchmarks {
namespace {

using runtime::World;
using runtime::WorldBodyStart;
using runtime::test::Blocks;
using runtime::test::Fork;

constexpr double kTimeStep = 2e-3;
constexpr double kStiffness = 1e7, kDamping = 5e4, kFriction = 0.5;

/// Blocks of r = 20 modes and 96 elements, 45 vertices on their surface, in gravity on a floor.
Blocks falling_blocks(bool meets_itself = false) {
  test::BarOptions options = Blocks::free_block();
  options.linear_modes = 20;
  Blocks blocks(kTimeStep, options, meets_itself);
  blocks.set_gravity(9.81);
  blocks.add_floor(kStiffness, kFriction, kDamping);
  blocks.scene.mass_damping = 1;
  blocks.scene.stiffness_damping = 2e-3;
  return blocks;
}

/// Steps of a world after `settle` others. Counters: bodies, and those of the last step.
void time_world(::benchmark::State& state, const std::vector<WorldBodyStart>& bodies, int settle, int threads) {
  World world(bodies, {kStiffness, kDamping, kFriction});
  runtime::WorldReport report;
  for (int i = 0; i < settle; ++i) world.step(threads);
  for (auto _ : state) report = world.step(threads);
  state.counters["bodies"] = static_cast<double>(world.count());
  state.counters["touching_pairs"] = report.touching_pairs;
  state.counters["largest_island"] = report.largest_island;
}

/// A fork whose prongs a steady force brings together, from `gap` [m].
void time_fork(::benchmark::State& state, double gap, double force, bool meets_itself) {
  const Fork fork(kTimeStep, /*free=*/true, meets_itself, 20);
  WorldBodyStart body = fork.closed_to(gap, 0);
  body.state.applied_force[fork.mode] = force * (fork.closing(fork.mode) > 0 ? 1 : -1);
  time_world(state, {body}, 500, 1);
}

/// Piles of five on each other, every one displaced a little; far enough apart to be islands of their own or, close
/// together, to lean on each other.
std::vector<WorldBodyStart> piles(const Blocks& blocks, int count, double spacing) {
  std::vector<WorldBodyStart> bodies;
  const int side = static_cast<int>(std::ceil(std::sqrt(count / 5.0)));
  for (int i = 0; i < count; ++i) {
    const int pile = i / 5, level = i % 5;
    bodies.push_back(blocks.body({(0.4 + spacing) * (pile % side) + 0.01 * (level % 2),
                                  (0.2 + spacing) * (pile / side) + 0.007 * (level % 3), 0.001 + 0.2 * level}));
  }
  return bodies;
}

/// On the floor, out of reach of each other.
std::vector<WorldBodyStart> apart(const Blocks& blocks, int count) {
  std::vector<WorldBodyStart> bodies;
  for (int i = 0; i < count; ++i) bodies.push_back(blocks.body({0.8 * (i % 20), 0.5 * (i / 20), 0.001}));
  return bodies;
}

}  // namespace

void register_worlds() {
  add("world/certificate", [](::benchmark::State& state) {
    const Blocks blocks = falling_blocks(true);
    const WorldBodyStart body = blocks.body(Eigen::Vector3d::Zero());
    Eigen::VectorXd q = Eigen::VectorXd::Constant(body.state.q.size(), 1e-3);
    bool may = false;
    for (auto _ : state) {
      ::benchmark::DoNotOptimize(q.data());
      ::benchmark::DoNotOptimize(may = blocks.surface->may_meet_itself(q, body.state.v, kTimeStep));
    }
  });
  add("world/fork/never", [](::benchmark::State& state) { time_fork(state, 0.08, 0, false); })->Iterations(2000);
  add("world/fork/open", [](::benchmark::State& state) { time_fork(state, 0.08, 0, true); })->Iterations(2000);
  add("world/fork/closed", [](::benchmark::State& state) { time_fork(state, 0.005, 400, true); })->Iterations(2000);
  add("world/alone", [](::benchmark::State& state) {
    const Blocks blocks = falling_blocks();
    time_world(state, {blocks.body({0, 0, 0.001})}, 500, 1);
  })->Iterations(2000);
  add("world/pair", [](::benchmark::State& state) {
    const Blocks blocks = falling_blocks();
    time_world(state, {blocks.body({0, 0, 0.001}), blocks.body({0.02, 0.01, 0.202})}, 500, 1);
  })->Iterations(2000);
  for (const int threads : {1, 2})
    for (const int count : {8, 200})
      add("world/apart/threads" + std::to_string(threads) + "/" + std::to_string(count),
          [=](::benchmark::State& state) {
            omp_set_num_threads(threads);
            const Blocks blocks = falling_blocks();
            time_world(state, apart(blocks, count), 500, threads);
          })
          ->UseRealTime()
          ->Iterations(200);  // settled once
  for (const int threads : {1, 2})
    for (const int count : {5, 100})
      for (const bool close : {false, true}) {
        const std::string name = "world/" + std::string(close ? "heap" : "stacks") + "/threads" +
                                 std::to_string(threads) + "/" + std::to_string(count);
        add(name,
            [=](::benchmark::State& state) {
              omp_set_num_threads(threads);
              const Blocks blocks = falling_blocks();
              time_world(state, piles(blocks, count, close ? -0.002 : 0.3), 300, threads);
            })
            ->UseRealTime()
            ->Iterations(200);  // settled once
      }
}

}  // namespace exmat::benchmarks

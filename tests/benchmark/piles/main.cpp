// Steps a scene of several free bodies and says in JSON how they come to rest. piles.py calls it.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exmat/exmat.hpp>
#include <fmt/format.h>
#include <vector>

namespace {

struct Options {
  const char* scene = nullptr;
  int steps = 0, threads = 1, hashed_step = 0;
};

/// Speed of the fastest centre of mass of all bodies [m/s].
double fastest(const exmat::World& world) {
  double largest = 0;
  for (const std::int64_t id : world.ids()) {
    const exmat_motion motion = world.body(id).motion();
    const double* v = motion.linear_velocity;
    largest = std::max(largest, std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
  }
  return largest;
}

/// Deepest vertices in another body and in an obstacle [m].
struct Depths {
  double bodies = 0, obstacles = 0;
};
Depths depths(const exmat::World& world) {
  Depths deepest;
  for (const exmat_body_contact& contact : world.contacts()) deepest.bodies = std::max(deepest.bodies, contact.depth);
  for (const std::int64_t id : world.ids())
    for (const exmat_contact& contact : world.body(id).contacts())
      deepest.obstacles = std::max(deepest.obstacles, contact.depth);
  return deepest;
}

constexpr double kAtRest = 0.01;  // [m/s]

void run(const Options& options) {
  exmat::World world = exmat::World::from_scene(options.scene);
  const auto total = [&] {
    const exmat_energies energies = world.energies();
    return energies.kinetic + energies.elastic + energies.potential;
  };
  const double start = total();
  // Seconds are of the processor: other work on the machine does not count.
  double lowest = start, highest = start, rise = 0, seconds = 0, last_second = 0, most_kinetic = 0;
  std::uint64_t hash = 0;
  std::int64_t unconverged = 0, largest_island = 0;
  int moving_until = 0;
  exmat_world_report report{};
  const double time_step = [&] {
    world.step(1, options.threads);
    return world.body(world.ids().front()).time();
  }();
  const int last = static_cast<int>(std::lround(1 / time_step));
  for (int i = 2; i <= options.steps; ++i) {
    const std::clock_t before = std::clock();
    report = world.step(1, options.threads);
    const double own = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
    seconds += own;
    if (i > options.steps - last) last_second += own;
    unconverged += report.unconverged_islands;
    largest_island = std::max(largest_island, report.largest_island);
    const double energy = total();
    most_kinetic = std::max(most_kinetic, world.energies().kinetic);
    highest = std::max(highest, energy);
    rise = std::max(rise, energy - lowest);
    lowest = std::min(lowest, energy);
    if (fastest(world) > kAtRest) moving_until = i;
    if (i % 100 == 0)
      fmt::print(stderr, "step {} of {}: {:.0f} s, fastest {:.3g} m/s, {} islands unconverged\n", i, options.steps,
                 seconds, fastest(world), unconverged);
    if (i == options.hashed_step) hash = world.hash();
  }
  const Depths deepest = depths(world);
  const double bodies = static_cast<double>(world.size()), microseconds = 1e6 / bodies;
  fmt::print(
      R"({{"bodies": {}, "steps": {}, "threads": {}, "us": {:.1f}, "us_at_rest": {:.1f}, "rest_after": {}, )"
      R"("fastest_at_end": {:.3g}, "deepest_bodies": {:.5f}, "deepest_obstacles": {:.5f}, "gain": {:.3g}, )"
      R"("largest_rise": {:.3g}, "fallen": {:.4g}, "most_kinetic": {:.4g}, "unconverged": {}, "largest_island": {}, )"
      R"("touching_pairs": {}, "hash": "{:016x}"}})"
      "\n",
      world.size(), options.steps, options.threads, microseconds * seconds / (options.steps - 1),
      microseconds * last_second / last,
      moving_until < options.steps ? fmt::format("{:.3f}", moving_until * time_step) : "null", fastest(world),
      deepest.bodies, deepest.obstacles, highest - start, rise, start - lowest, most_kinetic, unconverged,
      largest_island, report.touching_pairs, hash);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fputs("usage: exmat-pile-benchmark SCENE.json STEPS THREADS HASHED_STEP\n", stderr);
    return 2;
  }
  try {
    run({argv[1], std::atoi(argv[2]), std::atoi(argv[3]), std::atoi(argv[4])});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}

#include <algorithm>
#include <fmt/format.h>

#include "tests/benchmark/many_bodies.h"
#include "tests/benchmark/models.h"
#include "tests/benchmark/register.h"

namespace exmat::benchmarks {
namespace {

constexpr int kCycle = 100;  // steps, then all start anew

/// Each thrown by a speed of its own, and turning where it is free.
void start_apart(const runtime::Model& model, ManyBodies& bodies) {
  bodies.restart();
  for (int body = 0; body < bodies.world().count(); ++body) {
    runtime::State& state = bodies.world().state(body);
    const double own = static_cast<double>(body % 97) / 97;
    for (Eigen::Index c = 0; c < std::min<Eigen::Index>(4, model.modes()); ++c) state.v[c] = 0.3 * own - 0.1;
    state.begins_anew = true;
    runtime::FrameMotion motion;
    motion.angular_velocity = Eigen::Vector3d(0, 2 - own, own);
    runtime::set_motion(model, motion, state);
  }
}

/// Flops of a body's step, the mean of a few bodies.
double flops_of_a_step(const runtime::Model& model, const runtime::StepScene& scene, int count) {
  ManyBodies bodies(model, scene, make_state(model), count);
  start_apart(model, bodies);
  return bodies.work_of(kCycle).flops;
}

void time_crowd(::benchmark::State& state, int modes, int elements, bool free, int threads, int count,
                Precision precision) {
  const auto model = prepare(bar_model(modes, elements, free), Target::kTable, false);
  runtime::StepScene scene = swing(*model, Target::kTable);
  scene.precision = precision;
  const double flops = flops_of_a_step(*model, scene, std::min(count, 96));
  ManyBodies bodies(*model, scene, make_state(*model), count);
  std::int64_t steps = 0;
  for (auto _ : state) {
    if (steps++ % kCycle == 0) {
      state.PauseTiming();
      start_apart(*model, bodies);
      state.ResumeTiming();
    }
    bodies.world().step(threads);
  }
  state.counters["bodies"] = count;
  compare_with_dgemm(state, flops * count);
}

}  // namespace

void register_crowds() {
  const auto add_crowd = [](const char* kind, int modes, int elements, bool free, int threads, int count,
                            Precision precision) {
    add(fmt::format("crowd/{}/r{}/s{}/threads{}/{}", kind, modes, elements, threads, count),
        [=](::benchmark::State& state) { time_crowd(state, modes, elements, free, threads, count, precision); })
        ->UseRealTime();
  };
  for (const bool free : {false, true})
    for (const auto& [modes, elements] : {std::pair{20, 23}, {20, 60}, {30, 60}})
      for (const int threads : {1, 2}) {
        for (const int count : {1, 8, 100, 1000, 10000, 100000})
          if (threads <= count)
            add_crowd(free ? "free" : "clamped", modes, elements, free, threads, count, Precision::kDouble);
        add_crowd(free ? "free_mixed" : "clamped_mixed", modes, elements, free, threads, 1000, Precision::kMixed);
      }
}

}  // namespace exmat::benchmarks

#include <numeric>

#include "runtime/scene/bodies.h"
#include "tests/benchmark/models.h"
#include "tests/benchmark/steps.h"

namespace exmat::benchmarks {
namespace {

constexpr int kCycle = 500;

struct MeanWork {
  double flops = 0, newton_iterations = 0;
};

/// Of one step of one body, over the cycle.
MeanWork mean_work(const runtime::Model& model, const runtime::StepScene& scene, const runtime::State& start) {
  runtime::Bodies body(model, scene, start, 1);
  body.set_profiled(true);
  MeanWork mean;
  for (int i = 0; i < kCycle; ++i) mean.newton_iterations += body.step().front().newton_iterations / double{kCycle};
  const auto [seconds, profile, work] = body.take_measured();
  const double counted = std::accumulate(profile.flops.begin(), profile.flops.end(), 0.0);
  mean.flops = (counted + work.weights_flops + work.target_flops + work.other_flops) / kCycle;
  return mean;
}

std::string step_name(int modes, const std::string& force, Target target) {
  return "step/r" + std::to_string(modes) + "/" + force + "/" + name_of(target);
}

void add_step(int modes, int elements, bool polynomial, Target target) {
  const std::string force = polynomial ? "polynomial" : "s" + std::to_string(elements);
  add(step_name(modes, force, target), [=](::benchmark::State& state) {
    const auto model = prepare(bar_model(modes, elements), target, polynomial);
    time_steps(state, *model, swing(*model, target), make_state(*model));
  });
}

}  // namespace

void time_steps(::benchmark::State& state, const runtime::Model& model, const runtime::StepScene& scene,
                const runtime::State& start, int count) {
  const MeanWork mean = mean_work(model, scene, start);
  runtime::Bodies bodies(model, scene, start, count);
  int steps = 0;
  for (auto _ : state) {
    if (steps++ == kCycle) {
      bodies.restart();
      steps = 1;
    }
    bodies.step();
  }
  state.SetItemsProcessed(count * state.iterations());
  state.counters["newton_iterations"] = mean.newton_iterations;
  state.counters["bodies"] = count;
  compare_with_dgemm(state, mean.flops * count);
}

void register_steps() {
  for (const int modes : kModes)
    for (const Target target : kTargets) {
      for (const int elements : kElements) add_step(modes, elements, false, target);
      add_step(modes, 60, true, target);
    }
}

}  // namespace exmat::benchmarks

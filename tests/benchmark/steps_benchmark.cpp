#include <algorithm>
#include <omp.h>

#include "tests/benchmark/many_bodies.h"
#include "tests/benchmark/models.h"
#include "tests/benchmark/steps.h"

namespace exmat::benchmarks {
namespace {

constexpr int kCycle = 500;

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
  const ManyBodies::Work mean = ManyBodies(model, scene, start, 1).work_of(kCycle);
  ManyBodies bodies(model, scene, start, count);
  const int threads = std::min(count, omp_get_max_threads());
  int steps = 0;
  for (auto _ : state) {
    if (steps++ == kCycle) {
      bodies.restart();
      steps = 1;
    }
    bodies.world().step(threads);
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

#pragma once

#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "tests/benchmark/register.h"

namespace exmat::benchmarks {

/// Times steps of `count` bodies from `start`, again and again over the same 500 steps. Counters: those of
/// compare_with_dgemm, of one body's step where there are several; newton_iterations; bodies.
void time_steps(::benchmark::State& state, const runtime::Model& model, const runtime::StepScene& scene,
                const runtime::State& start, int count = 1);

}  // namespace exmat::benchmarks

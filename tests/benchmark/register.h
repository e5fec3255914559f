#pragma once

#include <benchmark/benchmark.h>
#include <functional>
#include <string>

namespace exmat::benchmarks {

/// One family of benchmarks each, named FAMILY/...; called by main before they run.
void register_kernels();
void register_steps();
void register_free_bodies();
void register_sizes();
void register_crowds();
void register_worlds();
void register_engines();
void register_full_space();

/// A benchmark whose inputs are made when it runs, not when it is registered.
::benchmark::internal::Benchmark* add(const std::string& name, std::function<void(::benchmark::State&)> body);

/// Sets the counters that every benchmark has: flops of one iteration, the best DGEMM rate of one thread so far
/// [GFLOP/s], measured here once more, and how many times as long as its flops at that rate an iteration takes.
void compare_with_dgemm(::benchmark::State& state, double flops);

}  // namespace exmat::benchmarks

#include "runtime/bench/dgemm_rate.h"
#include "tests/benchmark/register.h"

namespace exmat::benchmarks {

::benchmark::internal::Benchmark* add(const std::string& name, std::function<void(::benchmark::State&)> body) {
  return ::benchmark::RegisterBenchmark(name.c_str(), std::move(body));
}

void compare_with_dgemm(::benchmark::State& state, double flops) {
  static runtime::DgemmRate dgemm;
  dgemm.measure(8);
  using Counter = ::benchmark::Counter;
  state.counters["flops"] = flops;
  state.counters["dgemm_gflops"] = 1e-9 * dgemm.best();
  state.counters["limit_ratio"] =
      Counter(flops / dgemm.best(), static_cast<Counter::Flags>(Counter::kIsIterationInvariantRate | Counter::kInvert));
}

}  // namespace exmat::benchmarks

int main(int argc, char** argv) {
  using namespace exmat;
  ::benchmark::Initialize(&argc, argv);
  if (::benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  ::benchmark::AddCustomContext("instruction_set", runtime::kernels().name);
  benchmarks::register_kernels();
  benchmarks::register_steps();
  benchmarks::register_free_bodies();
  benchmarks::register_sizes();
  benchmarks::register_crowds();
  benchmarks::register_worlds();
  benchmarks::register_engines();
#ifdef EXMAT_SOURCE_DIR
  benchmarks::register_full_space();
#endif
  ::benchmark::RunSpecifiedBenchmarks();
  ::benchmark::Shutdown();
  return 0;
}

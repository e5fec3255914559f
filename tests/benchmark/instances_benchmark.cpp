#include <omp.h>

#include "tests/benchmark/models.h"
#include "tests/benchmark/register.h"
#include "tests/benchmark/steps.h"

namespace exmat::benchmarks {

void register_instances() {
  for (const int threads : {1, 2})
    for (const int count : {1, 10, 100, 1000, 10000}) {
      if (threads > count) continue;
      const std::string name = "instances/threads" + std::to_string(threads) + "/" + std::to_string(count);
      add(name, [=](::benchmark::State& state) {
        omp_set_num_threads(threads);
        const auto model = prepare(bar_model(20, 60), Target::kTable, false);
        time_steps(state, *model, swing(*model, Target::kTable), make_state(*model), count);
      })->UseRealTime();
    }
}

}  // namespace exmat::benchmarks

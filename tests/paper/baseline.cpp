#include "tests/paper/baseline.h"

#include "tests/paper/surface_targets.h"

namespace exmat::precompute {

void make_baseline(const ReducedModel& data, FullSpaceRun& run) {
  use_surface_targets(*data.object, run.model);
  for (runtime::ExampleSettings& examples : run.scene.examples)
    if (!examples.elastic) examples = {.stiffness = 1, .bias = examples.bias, .elastic = true};
}

}  // namespace exmat::precompute

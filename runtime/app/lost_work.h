#pragma once

#include "runtime/scene/scene_run.h"

namespace exmat::runtime {

// Lines of a run's summary that say what the bases lose of the work of loads: of forces that the scene names, and of
// contacts. Nothing where there are none. A mesh of many vertices is measured only where that is `asked` for: it takes
// longer than most runs.

void print_lost_work(const RunSummary& summary, const LoadedWorld& loaded, const WorldConfig& config, bool asked);

}  // namespace exmat::runtime

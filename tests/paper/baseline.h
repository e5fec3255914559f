#pragma once

#include "precompute/study/measure/runs.h"

namespace exmat::precompute {

/// Makes a run in full space that of the method which the paper's Table 2 compares with: targets by the energy of the
/// surface, elastic example forces, those that the scene has as linear ones with the factor 1 and without damping.
void make_baseline(const ReducedModel& data, FullSpaceRun& run);

}  // namespace exmat::precompute

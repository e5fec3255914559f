#pragma once

#include "precompute/cache/stage_cache.h"
#include "precompute/cubature/cubature.h"
#include "precompute/pipeline/basis_stage.h"

namespace exmat::precompute {

/// build_cubature() by way of the cache, for a model that has its basis. With motions, of a number of elements that is
/// given, the best of several selections, which differ in their seed: that whose body is nearest to the full space in
/// the held-out runs. Held-out errors of forces do not tell them apart.
CubatureData choose_cubature(const BodyStages& stages, const PoseSource& source, const CubatureOptions& options,
                             const ReducedModel& model, const Motions* motions, StageCache& cache);

}  // namespace exmat::precompute

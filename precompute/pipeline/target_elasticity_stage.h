#pragma once

#include <functional>
#include <string>
#include <vector>

#include "precompute/cache/stage_cache.h"
#include "precompute/pipeline/basis_stage.h"
#include "precompute/targets/target_elasticity.h"

namespace exmat::precompute {

/// Puts what elastic example forces take into a model that has its basis, with elements by `choose`.
using TargetElementChoice = std::function<TargetElasticityData(const TargetElasticityInput&)>;
void put_target_elasticity(const BodyStages& stages, const TargetElementChoice& choose, ReducedModel& model);

/// target_elasticity() by way of the cache, which says how far its elements are off, and those of the internal force.
TargetElasticityData choose_target_elements(const TargetElasticityInput& input, const PoseSource& source,
                                            const CubatureOptions& options, const CubatureData& cubature,
                                            StageCache& cache, std::vector<std::string>& warnings);

}  // namespace exmat::precompute

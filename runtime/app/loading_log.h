#pragma once

#include "runtime/scene/world_loader.h"

namespace exmat::runtime {

/// Messages: what was read of each bundle, what was left out and the plan of the step.
void log_loaded(const LoadedWorld& loaded, const WorldConfig& config);

}  // namespace exmat::runtime

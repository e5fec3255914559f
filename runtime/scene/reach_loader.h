#pragma once

#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

/// What the bodies of a scene reach for, if they do. Reads the bundle for places, masses and rows of the basis. Throws
/// InputError: no such example force, one that has weights already, a body that steps in all vertices, no such vertex,
/// vertices that are all fixed, limits between which no weights add up to 1.
std::optional<LoadedReach> load_reach(const SceneConfig& config, LoadedScene& loaded);

/// Sets the places of a body's targets to those at the end of its next step, and wakes it where they move.
void move_targets(const LoadedReach& reach, const StepScene& scene, State& state, Reach& own);

}  // namespace exmat::runtime

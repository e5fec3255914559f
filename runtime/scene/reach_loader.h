#pragma once

#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

/// The places that a scene with `reach` names for its bodies, of this object. Reads the rows of the basis from the
/// bundle. Throws InputError: no such example force, one that has weights already, a body that steps in all vertices,
/// no such vertex, vertices that are all fixed, limits between which no weights add up to 1.
LoadedReach load_reach(const SceneConfig& config, const ObjectData& object, LoadedScene& loaded);

/// Sets the places of a body's targets to those at the end of its next step, and wakes it where they move.
void move_targets(const LoadedReach& reach, const StepScene& scene, State& state, Reach& own);

}  // namespace exmat::runtime

#pragma once

#include <filesystem>

#include "runtime/scene/bodies.h"
#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

// States of bodies as files (schemas/state.json), so that a run can be taken up elsewhere, to the last bit.

/// Appears whole or not at all. Throws WorkError. The states are finite, as those that a step leaves are.
void write_states(const Bodies& bodies, const LoadedScene& loaded, const std::filesystem::path& file);

/// Puts the bodies into the states of a file. Throws InputError, and leaves the bodies as they were, unless it is of
/// the same bundle, time step, number of bodies, example forces and obstacles as the scene.
void read_states(const std::filesystem::path& file, const LoadedScene& loaded, Bodies& bodies);

}  // namespace exmat::runtime

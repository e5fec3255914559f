#pragma once

#include <filesystem>

#include "runtime/scene/world_bodies.h"

namespace exmat::runtime {

// States of several bodies and what they remember of their contacts as files, as state_file.h has them of one kind.

/// Appears whole or not at all. Throws WorkError. The states are finite.
void write_world_state(const WorldMemory& memory, const LoadedWorld& loaded, const WorldConfig& config,
                       const std::filesystem::path& file);

/// What the bodies go on from by take_up(). Throws InputError unless the file is of the same bodies, bundles, time
/// step, example forces and obstacles as the scene.
WorldMemory read_world_state(const std::filesystem::path& file, const LoadedWorld& loaded, const WorldConfig& config);

}  // namespace exmat::runtime

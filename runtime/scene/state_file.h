#pragma once

#include <filesystem>
#include <string_view>

#include "runtime/scene/bodies.h"

namespace exmat::runtime {

// States of bodies as files (schemas/state.json), so that a run can be taken up elsewhere, to the last bit.

/// The bytes that each begins with.
inline constexpr std::string_view kStateBeginning = "{\n \"format\": \"exmat-state\"";

/// Appears whole or not at all. Throws WorkError. The states are finite, as those that a step leaves are.
void write_state(const BodiesMemory& memory, const LoadedWorld& loaded, const WorldConfig& config,
                 const std::filesystem::path& file);

/// Memory that bodies of the scene go on from. Throws InputError unless it is of the same bundles, bodies, time step,
/// example forces and obstacles as the scene.
BodiesMemory read_state(const std::filesystem::path& file, const LoadedWorld& loaded, const WorldConfig& config);

}  // namespace exmat::runtime

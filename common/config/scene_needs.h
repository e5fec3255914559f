#pragma once

#include <filesystem>
#include <optional>

#include "common/config/scene_config.h"
#include "common/model/needs.h"

namespace exmat {

/// A scene of that body alone, in `instances` places.
WorldConfig world_of(SceneConfig scene);

/// The file that a run writes in place of the scene's, or none.
void set_trajectory(const std::optional<std::filesystem::path>& file, WorldConfig& world);

/// Throws InputError that names the scene's member where the bundle is not there.
void require_bundle(const SceneConfig& scene);

/// Needs of a scene from its bundle.
Needs needs_of(const SceneConfig& scene);

}  // namespace exmat

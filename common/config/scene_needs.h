#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "common/config/named_file.h"
#include "common/config/scene_config.h"
#include "common/model/needs.h"

namespace exmat {

/// A scene of that body alone, in `instances` places.
WorldConfig world_of(SceneConfig scene);

/// The file that a run writes in place of the scene's, or none.
void set_trajectory(const std::optional<std::filesystem::path>& file, WorldConfig& world);

/// Throws InputError that names the scene's member where the bundle is not there, or a file of an obstacle.
void require_files(const SceneConfig& scene);

/// The files that obstacles are made of.
std::vector<NamedFile> obstacle_files(const SceneConfig& scene);

/// require_files() of the obstacles alone.
void require_obstacle_files(const SceneConfig& scene);

/// Throws InputError where an example force of the scene is given weights, but not one for each of its examples:
/// `examples` has their numbers, of the whole body's force, if there is one, then of the regions'.
void require_weights(const SceneConfig& scene, const std::vector<Eigen::Index>& examples);

/// Throws InputError where the scene, of a body on bones, has examples.compensate.
void require_uncompensated(const SceneConfig& scene);

/// Needs of a scene from its bundle.
Needs needs_of(const SceneConfig& scene);

}  // namespace exmat

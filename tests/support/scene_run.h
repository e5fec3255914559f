#pragma once

#include "common/config/config.h"
#include "runtime/scene/bodies.h"
#include "runtime/scene/scene_run.h"

namespace exmat::test {

/// A scene with a single bundle, loaded.
struct LoadedRun {
  explicit LoadedRun(const SceneConfig& scene) : config(world_of(scene)), world(runtime::load_world_run(config)) {}

  const runtime::LoadedScene& kind() const { return world.kinds.front().loaded; }
  runtime::Bodies bodies() const { return {world, config}; }
  runtime::RunSummary run(const runtime::RunOptions& options = {}) const {
    return runtime::run(world, config, options);
  }

  WorldConfig config;
  runtime::LoadedWorld world;
};

inline runtime::RunSummary run(const SceneConfig& scene, const runtime::RunOptions& options = {}) {
  return LoadedRun(scene).run(options);
}

}  // namespace exmat::test

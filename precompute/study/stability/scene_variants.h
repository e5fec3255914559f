#pragma once

#include <string>
#include <vector>

#include "precompute/study/stability/scene_bodies.h"

namespace exmat::precompute {

/// A scene with one thing changed.
struct SceneVariant {
  std::string name;   ///< "16 x", "flat"
  double factor = 0;  ///< place along an ordered dimension; the scene itself has 1
  WorldConfig scene;
};

/// A dimension that a scene is pushed along.
struct SceneDimension {
  std::string name;                      ///< "time step"
  std::string own{};                     ///< the scene's value, with its unit
  std::string left_out{};                ///< why there are no variants
  std::vector<SceneVariant> variants{};  ///< by ascending factors

  bool is_ordered() const { return !variants.empty() && variants.front().factor > 0; }
};

/// Time step, load, speed, kappa, contact stiffness, start. `bodies` are the scene's.
std::vector<SceneDimension> scene_dimensions(const WorldConfig& scene, const SceneBodies& bodies);

}  // namespace exmat::precompute

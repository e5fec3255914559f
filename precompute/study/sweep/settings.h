#pragma once

#include <compare>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"
#include "precompute/study/sweep/study_config.h"

namespace exmat::precompute {

inline constexpr const char* kAllElements = "all_elements";
inline constexpr const char* kNoTarget = "none";

/// All that the points of a study differ in.
struct PointSettings {
  int eigenfunctions = 0;                ///< m
  int basis_size = 0;                    ///< r
  int linear_modes = 0;                  ///< whose derivatives are added
  std::string training;                  ///< "auto", "none", "scene" or "loads": what the basis learns from
  std::optional<int> cubature_elements;  ///< s; absent: by the asset's tolerance, or all of them
  std::string material;
  double time_step = 0;  ///< [s]
  std::string integrator;
  std::string internal_force;                 ///< "auto", "cubature", "polynomial" or "all_elements"
  std::string target;                         ///< "auto", "table" or "solve"; "none" without examples
  std::string precision = "double";           ///< or "mixed", as in the scene
  std::string space = "reduced";              ///< or "full", "auto", as in the scene
  std::optional<double> elastic_stiffness{};  ///< e of elastic example forces; absent: forces as the scene has them

  auto operator<=>(const PointSettings&) const = default;
};

/// Those of the files themselves.
PointSettings own_settings(const AssetConfig& asset, const SceneConfig& scene);

/// The points of a study in the order of its sweeps, each once; settings without effect are the files' own. Throws
/// InputError: a polynomial of a material that has none, more elements than there are, too many points.
std::vector<PointSettings> expand(const StudyConfig& study, const AssetConfig& asset, const SceneConfig& scene);

/// The same with repeated ones: as many, and in the same order, for every asset and scene.
std::vector<PointSettings> expand_all(const StudyConfig& study, const AssetConfig& asset, const SceneConfig& scene);

/// The files' own with the settings of a point; the scene writes positions and nothing else.
AssetConfig with_settings(AssetConfig asset, const PointSettings& settings);
SceneConfig with_settings(SceneConfig scene, const PointSettings& settings);

/// The scene with the example forces of a point: what its basis learns from.
SceneConfig with_force(SceneConfig scene, const PointSettings& settings);

nlohmann::ordered_json to_json(const PointSettings& settings);
PointSettings settings_from_json(const nlohmann::ordered_json& json);

/// "m 20, r 30 of 15 linear modes, s 60, stvk, 1 ms, bdf2, cubature, table".
std::string describe(const PointSettings& settings);

}  // namespace exmat::precompute

#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"
#include "common/model/needs.h"
#include "precompute/study/sweep/settings.h"
#include "precompute/study/sweep/study.h"

namespace exmat::precompute {

/// A bundle that some points share.
struct BundlePlan {
  std::string key;
  AssetConfig asset;
  SceneConfig scene;  ///< whose loads its basis learns from
  Needs needs;
  std::string failure;
};

/// A full-space run that some points share.
struct ReferencePlan {
  std::string key, bundle;
  SceneConfig scene;
  int eigenfunctions = 0;
  std::string material, failure;
};

/// A point, which may share its bundle and its full-space run with others.
struct PointPlan {
  PointSettings settings;
  std::string key;
  std::size_t bundle = 0, reference = 0;
  std::optional<std::size_t> all_elements;  ///< the point with all elements to compare with
};

/// Bundles, references and runs that the points of a study need, each once. Keys name the files of its folder.
struct StudyPlan {
  std::string inputs;  ///< hash of all files and of what is the same for all points
  TetMesh mesh;        ///< the object's
  std::vector<BundlePlan> bundles;
  std::vector<ReferencePlan> references;
  std::vector<PointPlan> points;
};

/// Name of what these settings make of the plan's inputs: hexadecimal digits.
std::string key_of(const StudyPlan& plan, const nlohmann::ordered_json& settings);

/// Reads the files of the asset and plans the points. Sets in `result` what they say of the body, and the times of the
/// frames. Throws InputError for what is wrong with them.
StudyPlan plan_study(const StudyConfig& config, const AssetConfig& asset, const SceneConfig& scene,
                     StudyResult& result);

/// Computes a planned bundle, and writes how long each stage took, what its cubature is worth and what it warns of.
void build_bundle(const BundlePlan& plan, const std::filesystem::path& bundle, const std::filesystem::path& stages);

/// Throws WorkError.
void make_folder(const std::filesystem::path& folder);

}  // namespace exmat::precompute

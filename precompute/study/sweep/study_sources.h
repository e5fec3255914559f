#pragma once

#include <cstddef>
#include <filesystem>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"
#include "precompute/study/sources/error_split.h"
#include "precompute/study/sweep/study.h"
#include "precompute/study/sweep/study_plan.h"

namespace exmat::precompute {

/// Inputs of the split of a study's point.
struct SourcesInput {
  const StudyConfig& config;  ///< with `sources`
  const AssetConfig& asset;
  const SceneConfig& scene;
  const StudyPlan& plan;
  const StudyResult& result;  ///< results of all points
  std::filesystem::path folder;
  int jobs = 1;  ///< processes
};

/// Refuses what cannot be measured before anything is. Throws InputError with the member of the study's file.
void require_sources(const SourcesInput& input);

/// The error of one sound point of the study by source: runs the motions that are not in the folder's `sources` yet.
/// docs/error_metrics.md, "Errors by source". What fails is told in the result.
ErrorSplit measure_sources(const SourcesInput& input, std::size_t point);

}  // namespace exmat::precompute

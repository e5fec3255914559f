#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"
#include "common/model/needs.h"
#include "common/model/reduced_model.h"
#include "precompute/examples/alignment_verdict.h"
#include "precompute/pipeline/asset_needs.h"
#include "precompute/pipeline/build_report.h"

namespace exmat::precompute {

/// Options of a build beside the asset.
struct BuildOptions {
  std::filesystem::path alignment_report{}, cache{};  ///< folders that it writes into; empty: none
  const SceneConfig* scene = nullptr;                 ///< whose loads basis and cubature may learn from
  double training_budget = 0;                         ///< most time for training [s]; 0: no limit
};

/// The offline stage from files to model. Logs each stage and its time. Takes stages from the cache that it has, and
/// keeps those that it computes there. Throws InputError for bad input, WorkError for failures, alignments that are
/// refused among them.
ReducedModel build_reduced_model(const AssetConfig& asset, const Needs& needs, BuildReport& report,
                                 const BuildOptions& options = {});

/// Reads and checks what the bundle is computed from, and sets the report's inputs, ledger and input_sha256 as
/// build_reduced_model does. Throws as it does.
void read_inputs(const AssetConfig& asset, const Needs& needs, BuildReport& report, const BuildOptions& options = {});

/// Reads and checks the inputs of an asset and aligns its examples, computes nothing more. Returns what came of the
/// examples, refusals among them. Throws as build_reduced_model.
std::vector<AlignmentOutcome> check_inputs(const AssetConfig& asset, const std::filesystem::path& alignment_folder,
                                           BuildReport& report);

}  // namespace exmat::precompute

#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/model/needs.h"
#include "common/model/reduced_model.h"
#include "precompute/examples/alignment_verdict.h"
#include "precompute/pipeline/build_report.h"

namespace exmat::precompute {

/// What the bundle is to hold: of the scene if there is one, else of the asset's `needs`, else all that applies.
Needs resolve_needs(const AssetConfig& asset, const std::optional<Needs>& scene_needs);

/// Folders that a build writes into beside the bundle; empty: none.
struct BuildFolders {
  std::filesystem::path alignment_report{}, cache{};
};

/// The offline stage from files to model. Logs each stage and its time. Takes stages from the cache that it has, and
/// keeps those that it computes there. Throws InputError for bad input, WorkError for failures, alignments that are
/// refused among them.
ReducedModel build_reduced_model(const AssetConfig& asset, const Needs& needs, BuildReport& report,
                                 const BuildFolders& folders = {});

/// Reads and checks what the bundle is computed from, and sets the report's inputs, ledger and input_sha256 as
/// build_reduced_model does. Throws as it does.
void read_inputs(const AssetConfig& asset, const Needs& needs, BuildReport& report);

/// Reads and checks the inputs of an asset and aligns its examples, computes nothing more. Returns what came of the
/// examples, refusals among them. Throws as build_reduced_model.
std::vector<AlignmentOutcome> check_inputs(const AssetConfig& asset, const std::filesystem::path& alignment_folder,
                                           BuildReport& report);

}  // namespace exmat::precompute

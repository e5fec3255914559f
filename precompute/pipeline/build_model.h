#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/model/needs.h"
#include "common/model/reduced_model.h"
#include "precompute/pipeline/alignment_verdict.h"
#include "precompute/pipeline/inputs.h"

namespace exmat::precompute {

struct StageTime {
  std::string stage;
  double seconds = 0;
};

/// What came of a run beside the model.
struct BuildReport {
  std::vector<StageTime> stages;    ///< in order
  std::vector<LedgerEntry> ledger;  ///< groups in and out, and why; bytes are the writer's to fill in
  InputFiles inputs;
  std::vector<std::string> warnings;  ///< also in the log
};

/// What the bundle is to hold: of the scene if there is one, else of the asset's `needs`, else all that applies.
Needs resolve_needs(const AssetConfig& asset, const std::optional<Needs>& scene_needs);

/// The offline stage from files to model. Logs each stage and its time. Writes an alignment report into a folder where
/// one is named. Throws InputError for bad input, WorkError for failures, alignments that are refused among them.
ReducedModel build_model(const AssetConfig& asset, const Needs& needs, BuildReport& report,
                         const std::filesystem::path& alignment_folder = {});

/// Reads and checks the inputs of an asset and aligns its examples, computes nothing more. Returns what came of the
/// examples, refusals among them. Throws as build_model.
std::vector<AlignmentOutcome> check_inputs(const AssetConfig& asset, const std::filesystem::path& alignment_folder,
                                           BuildReport& report);

}  // namespace exmat::precompute

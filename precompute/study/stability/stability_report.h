#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/study/stability/stability.h"

namespace exmat::precompute {

/// Tables of a suite: runs and verdicts by group and integrator with what they took, known limits, failures one by one.
std::string stability_markdown(const std::vector<StabilityRun>& runs);

/// The same as part of a page, and every known limit run by run.
std::string stability_html(const std::vector<StabilityRun>& runs);

/// A line for each run, after a line of names.
std::string stability_csv(const std::vector<StabilityRun>& runs);

/// All of it.
std::string stability_json(const std::vector<StabilityRun>& runs);

/// Writes stability.html, .md, .csv and .json into a folder, which is made. Each appears whole or not at all. Throws
/// WorkError.
void write_stability_report(const std::vector<StabilityRun>& runs, const std::filesystem::path& folder);

}  // namespace exmat::precompute

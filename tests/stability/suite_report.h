#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/stability/suite.h"

namespace exmat::precompute {

/// Tables of a suite: runs and verdicts by group and integrator with what they took, known limits, failures one by one.
std::string suite_markdown(const std::vector<StabilityRun>& runs);

/// The same as part of a page, and every known limit run by run.
std::string suite_html(const std::vector<StabilityRun>& runs);

/// A line for each run, after a line of names.
std::string suite_csv(const std::vector<StabilityRun>& runs);

/// All of it.
std::string suite_json(const std::vector<StabilityRun>& runs);

/// Writes stability.html, .md, .csv and .json into a folder, which is made. Each appears whole or not at all. Throws
/// WorkError.
void write_suite_report(const std::vector<StabilityRun>& runs, const std::filesystem::path& folder);

}  // namespace exmat::precompute

#pragma once

#include <string>
#include <vector>

#include "tests/stability/body_run.h"

namespace exmat::precompute {

/// One run of the suite and what came of it.
struct StabilityRun {
  StabilityCase test;
  StabilityResult result;
  std::string refusal{};  ///< why the offline stage made no body of it, a failure; empty where it did

  Verdict verdict() const { return refusal.empty() ? result.verdict() : Verdict::kFail; }
};

struct StabilityOptions {
  int most_steps = 600;  ///< limit for a run
  int jobs = 0;          ///< runs at a time; 0: as many as there are threads
  runtime::NewtonPolicy policy{};
};

inline constexpr int kShortSteps = 600, kLongSteps = 2000;

/// Builds the bodies of the cases, then runs these; results do not depend on `jobs`. Reports progress.
std::vector<StabilityRun> run_stability(std::vector<StabilityCase> cases, const StabilityOptions& options = {});

/// Runs with that verdict.
std::vector<const StabilityRun*> runs_with(const std::vector<StabilityRun>& runs, Verdict verdict);

/// Failures of a run, and by how much; empty where there are none.
std::string describe_failures(const StabilityRun& run);

}  // namespace exmat::precompute

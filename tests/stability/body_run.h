#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "tests/stability/suite_case.h"

namespace exmat::precompute {

/// Results of a run. Energies in J.
struct StabilityResult {
  CheckResults checks{};
  std::array<std::string_view, kCheckNames.size()> limit_ids{};  ///< limits of the checks that end at a known one
  std::int64_t steps = 0;                                        ///< taken
  double largest_displacement = 0;  ///< a vertex's, without the rigid motion of a free body, over L
  double linear_displacement = 0;   ///< bound of linear elasticity for it, over L
  double start_determinant = 1;     ///< least det F of the cubature elements at the start
  double start_inverted = 0;        ///< share of them with det F <= 0
  std::int64_t newton_iterations = 0, factorisations = 0, line_search_evaluations = 0, projections = 0;
  int most_iterations = 0;         ///< in one step
  std::int64_t limited_steps = 0;  ///< with kStepIterationLimit
  std::int64_t stagnated_steps = 0, target_steps = 0, non_finite_steps = 0;
  double seconds = 0;

  const CheckResult& operator[](Check check) const { return checks[static_cast<std::size_t>(check)]; }
  std::string_view limit_id(Check check) const { return limit_ids[static_cast<std::size_t>(check)]; }
  Verdict verdict() const { return gravest(checks); }
};

/// Judges a run; what fails as a known limit says becomes that.
void judge(const StabilityCase& test, const StudyBody& body, const RunRecord& run, const Expectation& expected,
           StabilityResult& result);

/// Steps a case until it is to be at rest, at most `most_steps` steps; what is not at rest then is not judged. Bounds
/// and their reasons: docs/stability.md. Thread-safe.
/// `policy` plants a fault, which the suite has to notice.
StabilityResult run_case(const StabilityCase& test, const StudyBody& body, int most_steps,
                         const runtime::NewtonPolicy& policy = {});

}  // namespace exmat::precompute

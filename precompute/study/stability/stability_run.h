#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "precompute/study/stability/stability_case.h"

namespace exmat::precompute {

/// One check of a run: `value` against `limit`.
struct CheckResult {
  Verdict verdict = Verdict::kNotApplicable;
  double value = 0, limit = 0;
  std::string_view limit_id{};  ///< of a known limit
};

/// What a run did. Energies in J.
struct StabilityResult {
  std::array<CheckResult, kCheckNames.size()> checks{};
  std::int64_t steps = 0;           ///< taken
  double largest_displacement = 0;  ///< of a vertex, without the rigid motion of a free body, over L
  double linear_displacement = 0;   ///< bound of linear elasticity for it, over L
  double start_determinant = 1;     ///< least det F of the cubature elements at the start
  double start_inverted = 0;        ///< share of them with det F <= 0
  std::int64_t newton_iterations = 0, factorisations = 0, line_search_evaluations = 0, projections = 0;
  int most_iterations = 0;         ///< in one step
  std::int64_t limited_steps = 0;  ///< with kStepIterationLimit
  std::int64_t stagnated_steps = 0, target_steps = 0, non_finite_steps = 0;
  double seconds = 0;

  const CheckResult& operator[](Check check) const { return checks[static_cast<std::size_t>(check)]; }
  CheckResult& operator[](Check check) { return checks[static_cast<std::size_t>(check)]; }
  /// The gravest of the checks.
  Verdict verdict() const;
};

/// A check of a run as a verdict: passed, failed, or failed as a known limit says.
void judge(const StabilityCase& test, const StudyBody& body, Check check, double value, double limit,
           StabilityResult& result);

/// Steps a case until it is to be at rest, at most `most_steps` steps; what is not at rest then is not judged. Bounds
/// and their reasons: docs/stability.md. Thread-safe.
/// `policy` plants a fault, which the suite has to notice.
StabilityResult run_case(const StabilityCase& test, const StudyBody& body, int most_steps,
                         const runtime::NewtonPolicy& policy = {});

}  // namespace exmat::precompute

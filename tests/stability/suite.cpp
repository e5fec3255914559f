#include "tests/stability/suite.h"

#include <fmt/format.h>
#include <omp.h>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "tests/stability/world_run.h"

namespace exmat::precompute {
namespace {

/// Builds the body of each run, or says why there is none.
void build_bodies(BodyStore& bodies, std::vector<StabilityRun>& runs) {
  Progress progress("stability: bodies", std::ssize(runs));
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);  // so small a body takes longer with more
  for (StabilityRun& run : runs) {
    try {
      bodies.get(run.test.body);
      if (run.test.company == Company::kCarried) bodies.get(carried_spec(run.test));
    } catch (const InputError& error) {
      run.refusal = error.what();
    } catch (const WorkError& error) {
      run.refusal = error.what();
    }
    progress.advance();
  }
  omp_set_num_threads(threads);
}

StabilityResult result_of(const StabilityCase& test, const BodyStore& bodies, const StabilityOptions& options) {
  const StudyBody& body = bodies.at(test.body);
  if (test.company == Company::kNone) return run_case(test, body, options.most_steps, options.policy);
  const StudyBody* const carried = test.company == Company::kCarried ? &bodies.at(carried_spec(test)) : nullptr;
  return run_world_case(test, body, carried, options.most_steps);
}

}  // namespace

std::vector<StabilityRun> run_stability(std::vector<StabilityCase> cases, const StabilityOptions& options) {
  std::vector<StabilityRun> runs;
  for (StabilityCase& test : cases) runs.push_back({std::move(test), {}});
  BodyStore bodies;
  build_bodies(bodies, runs);
  Progress progress("stability: runs", std::ssize(runs));
  const int jobs = options.jobs > 0 ? options.jobs : omp_get_max_threads();
#pragma omp parallel for schedule(dynamic) num_threads(jobs)
  for (std::size_t i = 0; i < runs.size(); ++i) {
    StabilityRun& run = runs[i];
    if (run.refusal.empty()) run.result = result_of(run.test, bodies, options);
#pragma omp critical
    progress.advance();
  }
  return runs;
}

std::vector<const StabilityRun*> runs_with(const std::vector<StabilityRun>& runs, Verdict verdict) {
  std::vector<const StabilityRun*> found;
  for (const StabilityRun& run : runs)
    if (run.verdict() == verdict) found.push_back(&run);
  return found;
}

std::string describe_failures(const StabilityRun& run) {
  if (!run.refusal.empty()) return "refused: " + run.refusal;
  std::string text;
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    const CheckResult& check = run.result.checks[i];
    if (check.verdict != Verdict::kFail && check.verdict != Verdict::kKnownLimit) continue;
    text +=
        fmt::format("{}{} {:.3g}, limit {:.3g}", text.empty() ? "" : "; ", kCheckNames[i], check.value, check.limit);
    if (check.verdict == Verdict::kKnownLimit) text += fmt::format(" ({})", run.result.limit_ids[i]);
  }
  return text;
}

}  // namespace exmat::precompute

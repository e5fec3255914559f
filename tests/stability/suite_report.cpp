#include "tests/stability/suite_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/markup.h"
#include "precompute/drawing/table.h"

namespace exmat::precompute {
namespace {

using Row = std::vector<std::string>;
using Json = nlohmann::ordered_json;

/// The row that all runs of the kind of this one are added up in.
const char* total_of(const StabilityCase& test) {
  if (test.precision == Precision::kMixed) return "all, mixed";
  if (test.space == Space::kReduced) return "all";
  return test.space == Space::kFull ? "all, full" : "all, auto";
}

// Sums over the runs of one group and integrator.
struct Sum {
  int runs = 0, passed = 0, limited = 0, failed = 0;
  std::int64_t steps = 0, newton = 0, search = 0, projections = 0, unsolved = 0, non_finite = 0;
  int most_iterations = 0;
  double displacement = 0;  // largest share of the bound

  void add(const StabilityRun& run);
};

void Sum::add(const StabilityRun& run) {
  const StabilityResult& result = run.result;
  ++runs;
  const Verdict verdict = run.verdict();
  ++(verdict == Verdict::kFail ? failed : verdict == Verdict::kKnownLimit ? limited : passed);
  steps += result.steps;
  newton += result.newton_iterations;
  search += result.line_search_evaluations;
  projections += result.projections;
  unsolved += result.limited_steps + result.stagnated_steps;
  non_finite += result.non_finite_steps;
  most_iterations = std::max(most_iterations, result.most_iterations);
  const CheckResult& bounded = result[Check::kBounded];
  if (bounded.limit > 0) displacement = std::max(displacement, bounded.value / bounded.limit);
}

Row row_of(const std::string& group, const std::string& integrator, const Sum& sum) {
  const double steps = std::max<double>(1, static_cast<double>(sum.steps));
  return {group,
          integrator,
          fmt::format("{}", sum.runs),
          fmt::format("{}", sum.passed),
          fmt::format("{}", sum.limited),
          fmt::format("{}", sum.failed),
          fmt::format("{:.3g}", sum.displacement),
          fmt::format("{}", sum.steps),
          fmt::format("{:.2f}, {}", static_cast<double>(sum.newton) / steps, sum.most_iterations),
          fmt::format("{:.3f}", static_cast<double>(sum.search) / steps),
          fmt::format("{:.3f}", static_cast<double>(sum.projections) / steps),
          fmt::format("{}", sum.unsolved),
          fmt::format("{}", sum.non_finite)};
}

Table summary(const std::vector<StabilityRun>& runs) {
  Table table{
      text_columns({"group", "integrator", "runs", "passed", "known limit", "FAILED",
                    "largest displacement over its bound", "steps", "Newton iterations a step: mean, most",
                    "line search evaluations a step", "projections a step", "unconverged steps", "non-finite runs"}),
      {}};
  Row groups;
  std::map<std::string, std::map<std::string, Sum>> sums;
  std::map<std::string, std::map<std::string, Sum>> totals;
  for (const StabilityRun& run : runs) {
    if (!sums.contains(run.test.group)) groups.push_back(run.test.group);
    const std::string integrator(name_of(run.test.integrator));
    sums[run.test.group][integrator].add(run);
    totals[total_of(run.test)][integrator].add(run);
  }
  for (const std::string& group : groups)
    for (const auto& [integrator, sum] : sums[group]) table.add(row_of(group, integrator, sum));
  for (const auto& [name, total] : totals)
    for (const auto& [integrator, sum] : total) table.add(row_of(name, integrator, sum));
  return table;
}

Table limits(const std::vector<StabilityRun>& runs) {
  Table table{text_columns({"known limit", "check", "runs", "of these bdf2", "of these mixed", "which", "why",
                            "what the user is told"}),
              {}};
  for (const KnownLimit& limit : known_limits()) {
    int count = 0, default_count = 0, mixed_count = 0;
    for (const StabilityRun& run : runs) {
      if (run.result.limit_id(limit.check) != limit.id) continue;
      ++count;
      default_count += run.test.integrator == Integrator::kBdf2 ? 1 : 0;
      mixed_count += run.test.precision == Precision::kMixed ? 1 : 0;
    }
    table.add({std::string(limit.id), std::string(kCheckNames[static_cast<std::size_t>(limit.check)]),
               std::to_string(count), std::to_string(default_count), std::to_string(mixed_count),
               std::string(limit.what), std::string(limit.reason), std::string(limit.message)});
  }
  return table;
}

Table details(const std::vector<StabilityRun>& runs, Verdict verdict) {
  Table table{text_columns({"run", "checks that failed"}), {}};
  for (const StabilityRun* run : runs_with(runs, verdict)) table.add({describe(run->test), describe_failures(*run)});
  return table;
}

std::string headline(const std::vector<StabilityRun>& runs) {
  const auto failed = runs_with(runs, Verdict::kFail).size(), limited = runs_with(runs, Verdict::kKnownLimit).size();
  const auto non_finite = std::ranges::count_if(runs, [](const StabilityRun& run) {
    return run.test.integrator == Integrator::kBdf2 && run.result.non_finite_steps > 0;
  });
  return fmt::format("{} runs: {} passed, {} ended at a known limit, {} FAILED. Non-finite runs of bdf2: {}.",
                     runs.size(), runs.size() - failed - limited, limited, failed, non_finite);
}

// One name and text for each thing that is recorded of a run, for both machine-readable forms.
Json record(const StabilityRun& run) {
  constexpr std::array<const char*, 4> kVerdicts{"pass", "FAIL", "known limit", "not applicable"};
  const auto verdict = [&](Verdict value) { return kVerdicts[static_cast<std::size_t>(value)]; };
  const auto& [test, result, refusal] = run;
  Json members{
      {"group", test.group},
      {"extreme", test.extreme},
      {"material", exmat::name_of(test.body.material)},
      {"body", test.body.free ? "free" : "clamped"},
      {"integrator", name_of(test.integrator)},
      {"precision", exmat::name_of(test.precision)},
      {"time_step_s", test.time_step},
      {"youngs_modulus_Pa", test.body.youngs_modulus},
      {"poisson_ratio", test.body.poisson_ratio},
      {"density_kg_m3", test.body.density},
      {"verdict", verdict(run.verdict())},
      {"failures", describe_failures(run)},
      {"steps", result.steps},
      {"largest_displacement_L", result.largest_displacement},
      {"linear_displacement_L", result.linear_displacement},
      {"start_least_determinant", result.start_determinant},
      {"start_inverted_share", result.start_inverted},
      {"newton_iterations", result.newton_iterations},
      {"most_newton_iterations", result.most_iterations},
      {"factorisations", result.factorisations},
      {"line_search_evaluations", result.line_search_evaluations},
      {"projections", result.projections},
      {"iteration_limit_steps", result.limited_steps},
      {"stagnated_steps", result.stagnated_steps},
      {"target_not_converged_steps", result.target_steps},
      {"non_finite_steps", result.non_finite_steps},
  };
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    const std::string name(kCheckNames[i]);
    members[name] = verdict(result.checks[i].verdict);
    members[name + "_value"] = result.checks[i].value;
    members[name + "_limit"] = result.checks[i].limit;
  }
  return members;
}

}  // namespace

std::string suite_markdown(const std::vector<StabilityRun>& runs) {
  std::string text = headline(runs) + "\n\n" + to_markdown(summary(runs)) + "\n" + to_markdown(limits(runs));
  if (const Table failures = details(runs, Verdict::kFail); !failures.rows.empty())
    text.append("\n").append(to_markdown(failures));
  return text;
}

std::string suite_html(const std::vector<StabilityRun>& runs) {
  return "<h2>Stability</h2>\n<p>" + escaped(headline(runs)) + "</p>\n" + to_html(summary(runs)) +
         "<h3>Known limits</h3>\n" + to_html(limits(runs)) + "<h3>Failures</h3>\n" +
         to_html(details(runs, Verdict::kFail)) +
         "<h3>Runs that end at a known limit</h3>\n<details><summary>all of them</summary>\n" +
         to_html(details(runs, Verdict::kKnownLimit)) + "</details>\n";
}

std::string suite_csv(const std::vector<StabilityRun>& runs) {
  std::vector<Json> records;
  for (const StabilityRun& run : runs) records.push_back(record(run));
  return to_csv(records);
}

std::string suite_json(const std::vector<StabilityRun>& runs) {
  Json json{{"summary", headline(runs)}, {"failed", runs_with(runs, Verdict::kFail).size()}};
  for (const KnownLimit& limit : known_limits())
    json["known_limits"].push_back({{"id", limit.id},
                                    {"check", kCheckNames[static_cast<std::size_t>(limit.check)]},
                                    {"which", limit.what},
                                    {"reason", limit.reason},
                                    {"message", limit.message}});
  for (const StabilityRun& run : runs) json["runs"].push_back(record(run));
  return json.dump(1) + '\n';
}

void write_suite_report(const std::vector<StabilityRun>& runs, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw WorkError(folder.string() + ": cannot make this folder: " + error.message());
  write_file_atomically(folder / "stability.html", html_page("exmat: stability", suite_html(runs)));
  write_file_atomically(folder / "stability.md", suite_markdown(runs));
  write_file_atomically(folder / "stability.csv", suite_csv(runs));
  write_file_atomically(folder / "stability.json", suite_json(runs));
}

}  // namespace exmat::precompute

#include "precompute/study/stability/stability_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>

#include "common/core/atomic_file.h"
#include "common/core/error.h"

namespace exmat::precompute {
namespace {

using Row = std::vector<std::string>;
using Json = nlohmann::ordered_json;

struct Table {
  Row names;
  std::vector<Row> rows;
};

// What the runs of one group and integrator add up to.
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
  Table table{{"group", "integrator", "runs", "passed", "known limit", "FAILED", "largest displacement over its bound",
               "steps", "Newton iterations a step: mean, most", "line search evaluations a step", "projections a step",
               "unconverged steps", "non-finite runs"},
              {}};
  Row groups;
  std::map<std::string, std::map<std::string, Sum>> sums;
  std::map<std::string, std::map<std::string, Sum>> totals;
  for (const StabilityRun& run : runs) {
    if (!sums.contains(run.test.group)) groups.push_back(run.test.group);
    const std::string integrator(name_of(run.test.integrator));
    sums[run.test.group][integrator].add(run);
    totals[run.test.precision == Precision::kMixed ? "all, mixed" : "all"][integrator].add(run);
  }
  for (const std::string& group : groups)
    for (const auto& [integrator, sum] : sums[group]) table.rows.push_back(row_of(group, integrator, sum));
  for (const auto& [name, total] : totals)
    for (const auto& [integrator, sum] : total) table.rows.push_back(row_of(name, integrator, sum));
  return table;
}

Table limits(const std::vector<StabilityRun>& runs) {
  Table table{
      {"known limit", "check", "runs", "of these bdf2", "of these mixed", "which", "why", "what the user is told"}, {}};
  for (const KnownLimit& limit : known_limits()) {
    int count = 0, default_count = 0, mixed_count = 0;
    for (const StabilityRun& run : runs) {
      if (run.result[limit.check].limit_id != limit.id) continue;
      ++count;
      default_count += run.test.integrator == Integrator::kBdf2 ? 1 : 0;
      mixed_count += run.test.precision == Precision::kMixed ? 1 : 0;
    }
    table.rows.push_back({std::string(limit.id), std::string(kCheckNames[static_cast<std::size_t>(limit.check)]),
                          std::to_string(count), std::to_string(default_count), std::to_string(mixed_count),
                          std::string(limit.what), std::string(limit.reason), std::string(limit.message)});
  }
  return table;
}

Table details(const std::vector<StabilityRun>& runs, Verdict verdict) {
  Table table{{"run", "checks that failed"}, {}};
  for (const StabilityRun* run : runs_with(runs, verdict))
    table.rows.push_back({describe(run->test), describe_failures(*run)});
  return table;
}

std::string markdown(const Table& table) {
  std::string text = "|";
  for (const std::string& name : table.names) text += " " + name + " |";
  text += "\n|";
  for (std::size_t i = 0; i < table.names.size(); ++i) text += " --- |";
  text += '\n';
  for (const Row& row : table.rows) {
    text += '|';
    for (const std::string& cell : row) text += " " + cell + " |";
    text += '\n';
  }
  return text;
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) result += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return result;
}

std::string html(const Table& table) {
  std::string text = "<table>\n<tr>";
  for (const std::string& name : table.names) text += "<th>" + escaped(name) + "</th>";
  text += "</tr>\n";
  for (const Row& row : table.rows) {
    text += "<tr>";
    for (const std::string& cell : row) text += "<td>" + escaped(cell) + "</td>";
    text += "</tr>\n";
  }
  return text + "</table>\n";
}

std::string headline(const std::vector<StabilityRun>& runs) {
  const auto failed = runs_with(runs, Verdict::kFail).size(), limited = runs_with(runs, Verdict::kKnownLimit).size();
  const auto non_finite = std::ranges::count_if(runs, [](const StabilityRun& run) {
    return run.test.integrator == Integrator::kBdf2 && run.result.non_finite_steps > 0;
  });
  return fmt::format("{} runs: {} passed, {} ended at a known limit, {} FAILED. Non-finite runs of bdf2: {}.",
                     runs.size(), runs.size() - failed - limited, limited, failed, non_finite);
}

std::string csv_quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + '"';
}

// One name and text for each thing that is recorded of a run, for both machine-readable forms.
std::vector<std::pair<std::string, Json>> record(const StabilityRun& run) {
  constexpr std::array<const char*, 4> kVerdicts{"pass", "FAIL", "known limit", "not applicable"};
  const auto verdict = [&](Verdict value) { return kVerdicts[static_cast<std::size_t>(value)]; };
  const auto& [test, result, refusal] = run;
  std::vector<std::pair<std::string, Json>> members{
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
    members.emplace_back(name, verdict(result.checks[i].verdict));
    members.emplace_back(name + "_value", result.checks[i].value);
    members.emplace_back(name + "_limit", result.checks[i].limit);
  }
  return members;
}

}  // namespace

std::string stability_markdown(const std::vector<StabilityRun>& runs) {
  std::string text = headline(runs) + "\n\n" + markdown(summary(runs)) + "\n" + markdown(limits(runs));
  if (const Table failures = details(runs, Verdict::kFail); !failures.rows.empty())
    text.append("\n").append(markdown(failures));
  return text;
}

std::string stability_html(const std::vector<StabilityRun>& runs) {
  return "<h2>Stability</h2>\n<p>" + escaped(headline(runs)) + "</p>\n" + html(summary(runs)) +
         "<h3>Known limits</h3>\n" + html(limits(runs)) + "<h3>Failures</h3>\n" + html(details(runs, Verdict::kFail)) +
         "<h3>Runs that end at a known limit</h3>\n<details><summary>all of them</summary>\n" +
         html(details(runs, Verdict::kKnownLimit)) + "</details>\n";
}

std::string stability_csv(const std::vector<StabilityRun>& runs) {
  std::string text;
  for (const StabilityRun& run : runs) {
    const auto members = record(run);
    std::string names, line;
    for (const auto& [name, value] : members) {
      const char* const between = names.empty() ? "" : ",";
      names.append(between).append(name);
      line.append(between).append(value.is_string() ? csv_quoted(value.get<std::string>()) : value.dump());
    }
    if (text.empty()) text = names + '\n';
    text += line + '\n';
  }
  return text;
}

std::string stability_json(const std::vector<StabilityRun>& runs) {
  Json json{{"summary", headline(runs)}, {"failed", runs_with(runs, Verdict::kFail).size()}};
  for (const KnownLimit& limit : known_limits())
    json["known_limits"].push_back({{"id", limit.id},
                                    {"check", kCheckNames[static_cast<std::size_t>(limit.check)]},
                                    {"which", limit.what},
                                    {"reason", limit.reason},
                                    {"message", limit.message}});
  for (const StabilityRun& run : runs) {
    Json one;
    for (auto& [name, value] : record(run)) one[name] = value;
    json["runs"].push_back(std::move(one));
  }
  return json.dump(1) + '\n';
}

void write_stability_report(const std::vector<StabilityRun>& runs, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw WorkError(folder.string() + ": cannot make this folder: " + error.message());
  constexpr const char* kPage =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><title>exmat: stability</title>\n"
      "<style>:root{color-scheme:light dark}body{font-family:sans-serif;margin:2em}table{border-collapse:collapse}"
      "td,th{border:1px solid #888;padding:0.2em 0.5em;text-align:left;vertical-align:top}</style></head>\n<body>\n";
  write_file_atomically(folder / "stability.html", kPage + stability_html(runs) + "</body>\n</html>\n");
  write_file_atomically(folder / "stability.md", stability_markdown(runs));
  write_file_atomically(folder / "stability.csv", stability_csv(runs));
  write_file_atomically(folder / "stability.json", stability_json(runs));
}

}  // namespace exmat::precompute

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <system_error>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/markup.h"
#include "precompute/drawing/table.h"
#include "precompute/study/stability/scene_study.h"

// The study of a scene's stability as text and files.

namespace exmat::precompute {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kPage = "stability.html", *kText = "stability.md", *kTable = "stability.csv",
                     *kRecord = "stability.json";

Table ranges_table(const SceneStudy& study) {
  Table table{text_columns({"dimension", "in the scene", "safe up to", "fails"}), {}};
  for (const SafeRange& range : study.ranges) table.add({range.dimension, range.own, range.safe, range.fails});
  return table;
}

Table runs_table(const SceneStudy& study) {
  Table table{{{"run", true}, {"time step [s]"}, {"steps"}, {"verdict", true}}, {}};
  for (const std::string_view name : kCheckNames) table.columns.push_back({std::string(name)});
  for (const SceneRun& run : study.runs) {
    std::vector<std::string> cells{run.dimension.empty() ? "the scene" : run.dimension + ": " + run.variant,
                                   fmt::format("{:.4g}", run.time_step), std::to_string(run.record.steps),
                                   run.passes() ? "pass" : "FAIL"};
    for (const CheckResult& check : run.checks)
      cells.push_back(
          check.verdict == Verdict::kNotApplicable ? "-" : fmt::format("{:.3g} / {:.3g}", check.value, check.limit));
    table.add(std::move(cells));
  }
  return table;
}

Json to_json(const SceneRun& run) {
  Json json{{"dimension", run.dimension},
            {"variant", run.variant},
            {"time_step_s", run.time_step},
            {"steps", run.record.steps},
            {"passes", run.passes()}};
  for (std::size_t i = 0; i < kCheckNames.size(); ++i)
    if (const CheckResult& check = run.checks[i]; check.verdict != Verdict::kNotApplicable)
      json[std::string(kCheckNames[i])] = {{"value", check.value}, {"limit", check.limit}};
  return json;
}

Json to_json(const SceneStudy& study, const std::vector<Json>& runs) {
  Json json{{"scene", study.scene}, {"duration_s", study.duration}, {"sound", study.runs.front().passes()}};
  for (const SafeRange& range : study.ranges)
    json["safe_up_to"].push_back(
        {{"dimension", range.dimension}, {"own", range.own}, {"safe", range.safe}, {"fails", range.fails}});
  json["not_tested"] = study.not_tested;
  json["runs"] = runs;
  return json;
}

constexpr const char* kLegend =
    "Each check, value / limit: finite: states that are not; bounded: largest displacement over the body's size; "
    "solved: share of steps above the tolerance; rest: kinetic energy at the end over its peak; energy: gain over the "
    "energies "
    "exchanged; momentum: relative error; return: distance from where the scene ends, over the size.";

}  // namespace

std::string SceneStudy::headline() const {
  const SceneRun& own = runs.front();
  return own.passes() ? fmt::format("{}, {:g} s: passes every check that applies.", scene, duration)
                      : fmt::format("{}, {:g} s: FAILS as it is: {}.", scene, duration, own.failures());
}

std::string scene_study_markdown(const SceneStudy& study) {
  std::string text = study.headline() + "\n\n" + to_markdown(ranges_table(study)) + "\nNot tested:\n\n";
  for (const std::string& reason : study.not_tested) text += "- " + reason + "\n";
  return text + "\n" + kLegend + "\n";
}

void claim_scene_study(const std::filesystem::path& folder) {
  for (const char* name : {kPage, kText, kTable, kRecord}) claim_output(folder / name, "-o");
}

void write_scene_study(const SceneStudy& study, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw WorkError(folder.string() + ": cannot make this folder: " + error.message());
  std::string body = "<p>" + escaped(study.headline()) + "</p>\n<h2>Safe up to</h2>\n" + to_html(ranges_table(study)) +
                     "<h2>Not tested</h2>\n<ul>\n";
  for (const std::string& reason : study.not_tested) body += "<li>" + escaped(reason) + "</li>\n";
  body += fmt::format("</ul>\n<h2>Runs</h2>\n<p class=\"note\">{}</p>\n{}", kLegend, to_html(runs_table(study)));
  write_file_atomically(folder / kPage, html_page("Stability of " + study.scene, body));
  write_file_atomically(folder / kText, scene_study_markdown(study) + "\n" + to_markdown(runs_table(study)));
  std::vector<Json> runs;
  for (const SceneRun& run : study.runs) runs.push_back(to_json(run));
  write_file_atomically(folder / kTable, to_csv(runs));
  write_file_atomically(folder / kRecord, to_json(study, runs).dump(1) + '\n');
}

}  // namespace exmat::precompute

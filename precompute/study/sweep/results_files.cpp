#include "precompute/study/sweep/results_files.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "common/core/atomic_file.h"
#include "precompute/study/sources/split_text.h"
#include "precompute/study/sweep/report.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? "\"\"" : std::string(1, c);
  return result + '"';
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : "inf"; }

struct Column {
  std::string name;
  std::function<std::string(const PointResult&)> text;
  bool of_failed = false;  // is there without a result
};

// The numbers of an error.
void add_error(std::vector<Column>& columns, const std::string& name,
               std::function<const RelativeError*(const PointResult&)> error) {
  constexpr std::array<std::pair<const char*, double RelativeError::*>, 4> kMembers{
      {{"_mean", &RelativeError::mean},
       {"_max", &RelativeError::max},
       {"_end", &RelativeError::end},
       {"_settled", &RelativeError::settled}}};
  for (const auto& [suffix, member] : kMembers)
    columns.push_back({name + suffix, [error, member = member](const PointResult& point) {
                         const RelativeError* found = error(point);
                         return found == nullptr ? "" : number(found->*member);
                       }});
}

void add_time(std::vector<Column>& columns, const char* name, double StepTimes::*member) {
  columns.push_back(
      {name, [member](const PointResult& p) { return p.times ? number(1e6 * ((*p.times).*member)) : ""; }});
}

void add_inverted(std::vector<Column>& columns, const char* name, Eigen::Index InvertedTets::*member,
                  const StudyResult& result) {
  columns.push_back({name, [&result, member](const PointResult& point) {
                       const ReferenceResult* reference = result.reference_of(point);
                       return reference == nullptr ? "" : std::to_string(reference->inverted.*member);
                     }});
}

std::vector<Column> settings_columns() {
  return {
      {"key", [](const PointResult& p) { return p.key; }, true},
      {"eigenfunctions", [](const PointResult& p) { return std::to_string(p.settings.eigenfunctions); }, true},
      {"basis_size", [](const PointResult& p) { return std::to_string(p.settings.basis_size); }, true},
      {"linear_modes", [](const PointResult& p) { return std::to_string(p.settings.linear_modes); }, true},
      {"training", [](const PointResult& p) { return p.settings.training; }, true},
      {"cubature_elements", [](const PointResult& p) { return std::to_string(p.elements); }},
      {"material", [](const PointResult& p) { return p.settings.material; }, true},
      {"time_step_s", [](const PointResult& p) { return number(p.settings.time_step); }, true},
      {"integrator", [](const PointResult& p) { return p.settings.integrator; }, true},
      {"internal_force", [](const PointResult& p) { return p.settings.internal_force; }, true},
      {"target", [](const PointResult& p) { return p.settings.target; }, true},
      {"precision", [](const PointResult& p) { return p.settings.precision; }, true},
      {"elastic_stiffness",
       [](const PointResult& p) { return p.settings.elastic_stiffness ? number(*p.settings.elastic_stiffness) : ""; },
       true},
  };
}

std::vector<Column> columns(const StudyResult& result) {
  std::vector<Column> columns = settings_columns();
  add_error(columns, "position_error", [](const PointResult& p) { return &p.errors.position; });
  add_error(columns, "velocity_error", [](const PointResult& p) { return &p.errors.velocity; });
  columns.push_back({"energy_error_max", [](const PointResult& p) { return number(p.errors.energy); }});
  add_error(columns, "shape_error", [](const PointResult& p) { return p.errors.shape ? &*p.errors.shape : nullptr; });
  add_error(columns, "nearest_phase_error", [](const PointResult& p) { return &p.errors.nearest_phase; });
  columns.push_back(
      {"rebound_error", [](const PointResult& p) { return p.errors.rebound ? number(*p.errors.rebound) : ""; }});
  add_error(columns, "from_all_elements_error",
            [](const PointResult& p) { return p.from_all_elements ? &*p.from_all_elements : nullptr; });
  add_error(columns, "from_double_error",
            [](const PointResult& p) { return p.from_double ? &*p.from_double : nullptr; });
  columns.push_back({"cubature_heldout_error", [](const PointResult& p) { return number(p.heldout_error); }});
  add_time(columns, "step_median_us", &StepTimes::median);
  add_time(columns, "step_p95_us", &StepTimes::p95);
  add_time(columns, "interp_median_us", &StepTimes::interpolation);
  columns.push_back({"precompute_s", [](const PointResult& p) { return number(p.precompute_seconds); }});
  columns.push_back({"newton_iterations_mean", [](const PointResult& p) { return number(p.newton_iterations); }});
  columns.push_back({"factorisations_mean", [](const PointResult& p) { return number(p.factorisations); }});
  columns.push_back({"steps", [](const PointResult& p) { return std::to_string(p.steps); }});
  columns.push_back({"unconverged_steps", [](const PointResult& p) { return std::to_string(p.unconverged_steps); }});
  add_inverted(columns, "reference_inverted_tets_most", &InvertedTets::most, result);
  add_inverted(columns, "reference_inverted_tets_last", &InvertedTets::last, result);
  columns.push_back({"no_truth", [&](const PointResult& p) { return result.has_truth(p) ? "0" : "1"; }});
  columns.push_back({"failure", [](const PointResult& p) { return p.failure; }, true});
  return columns;
}

Ordered to_json(const ReferenceResult& reference) {
  return {{"key", reference.key},
          {"eigenfunctions", reference.eigenfunctions},
          {"material", reference.material},
          {"time_step", reference.time_step},
          {"integrator", reference.integrator},
          {"failure", reference.failure},
          {"steps", reference.steps},
          {"unconverged_steps", reference.unconverged_steps},
          {"newton_iterations", reference.newton_iterations},
          {"factorisations", reference.factorisations},
          {"inverted_tets", {{"most", reference.inverted.most}, {"last", reference.inverted.last}}},
          {"no_truth", reference.inverted.any()},
          {"step_median_ms", 1e3 * reference.step_seconds}};
}

Ordered limit(std::optional<double> value) { return value ? Ordered(*value) : Ordered(nullptr); }

void write_or_remove(const std::filesystem::path& file, const std::optional<std::string>& content) {
  if (content) return write_file_atomically(file, *content);
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
}

}  // namespace

std::string results_csv(const StudyResult& result) {
  const auto all = columns(result);
  std::string text;
  for (const Column& column : all) text += column.name + ",";
  text += "on_front\n";
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const PointResult& point = result.points[i];
    for (const Column& column : all)
      text += (column.of_failed || point.failure.empty() ? quoted(column.text(point)) : "") + ",";
    text += std::ranges::find(result.front, i) == result.front.end() ? "0\n" : "1\n";
  }
  return text;
}

Ordered results_json(const StudyResult& result) {
  Ordered json{{"name", result.config.name},
               {"asset", result.asset_name},
               {"vertices", result.vertices},
               {"tets", result.tets},
               {"free_body", result.free_body},
               {"processor", result.processor},
               {"instruction_set", result.instruction_set}};
  json["frames"] = result.times.size();
  json["duration"] = result.times.back();
  json["headline"] = result.headline();
  json["no_truth"] = result.truth_warning();
  json["points"] = Ordered::array();
  for (const PointResult& point : result.points) json["points"].push_back(to_json(point));
  json["references"] = Ordered::array();
  for (const ReferenceResult& reference : result.references) json["references"].push_back(to_json(reference));
  json["front"] = result.front;
  json["own"] = result.own;
  json["baseline"] = result.baseline ? to_json(*result.baseline) : Ordered(nullptr);
  json["baseline_failure"] = result.baseline_failure;
  json["paper"] = nullptr;
  if (const auto& paper = result.config.paper)
    json["paper"] = {{"interp_ms", paper->interp},
                     {"total_ms", paper->total},
                     {"zhu_interp_ms", paper->zhu_interp},
                     {"zhu_total_ms", paper->zhu_total}};
  json["budget"] = {{"seconds", limit(result.budget.seconds)}, {"error", limit(result.budget.error)}};
  json["sources"] = result.sources ? to_json(*result.sources) : Ordered(nullptr);
  json["recommended"] = result.recommended ? Ordered(*result.recommended) : Ordered(nullptr);
  json["nearest"] = result.nearest ? Ordered(*result.nearest) : Ordered(nullptr);
  return json;
}

Ordered asset_fragment(const StudyResult& result, const PointResult& point) {
  const bool all = point.settings.internal_force == kAllElements;
  Ordered json = Ordered::object();
  if (result.has_examples) json["shape_space"] = {{"eigenfunctions", point.settings.eigenfunctions}};
  json["basis"] = {{"size", point.settings.basis_size},
                   {"linear_modes", point.settings.linear_modes},
                   {"training", point.settings.training}};
  json["cubature"] = all ? Ordered{{"method", kAllElements}} : Ordered{{"elements", point.elements}};
  json["internal_force"] = point.internal_force;
  const auto differs = [&](const PointResult& other) { return other.settings.material != point.settings.material; };
  if (std::ranges::any_of(result.points, differs))
    json["object"] = {{"material", {{"model", point.settings.material}}}};
  return json;
}

Ordered scene_fragment(const StudyResult& result, const PointResult& point) {
  Ordered json{{"time_step", point.settings.time_step}, {"integrator", point.settings.integrator}};
  const auto differs = [&](const PointResult& other) { return other.settings.precision != point.settings.precision; };
  if (std::ranges::any_of(result.points, differs)) json["precision"] = point.settings.precision;
  if (point.target == kNoTarget) return json;
  Ordered force{{"target", point.target}};
  if (const auto& stiffness = point.settings.elastic_stiffness)
    force.update({{"force", "elastic"}, {"stiffness", *stiffness}});
  for (const std::string& region : result.regions) {
    json["regions"].push_back({{"name", region}});
    json["regions"].back().update(force);
  }
  if (result.regions.empty()) json["examples"] = force;
  return json;
}

void write_results(const StudyResult& result, const std::filesystem::path& folder) {
  write_file_atomically(folder / "results.csv", results_csv(result));
  write_file_atomically(folder / "results.json", results_json(result).dump(2) + "\n");
  write_file_atomically(folder / "report.html", report_html(result));
  std::optional<std::string> asset, scene, markdown, csv, svg;
  if (result.recommended) {
    asset = asset_fragment(result, result.points[*result.recommended]).dump(2) + "\n";
    scene = scene_fragment(result, result.points[*result.recommended]).dump(2) + "\n";
  }
  if (const auto& sources = result.sources) {
    markdown = split_markdown(*sources, result.config.name, sources_point(result), result.headline());
    csv = split_csv(*sources);
    if (sources->failure.empty()) svg = split_svg(*sources, result.headline());
  }
  write_or_remove(folder / "sources.md", markdown);
  write_or_remove(folder / "sources.csv", csv);
  write_or_remove(folder / "sources.svg", svg);
  write_or_remove(folder / "recommended_asset.json", asset);
  write_or_remove(folder / "recommended_scene.json", scene);
}

}  // namespace exmat::precompute

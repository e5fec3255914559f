#include "precompute/study/sweep/results_files.h"

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "common/core/atomic_file.h"
#include "precompute/drawing/table.h"
#include "precompute/study/sources/split_text.h"
#include "precompute/study/sweep/report.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

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
  std::vector<Ordered> records;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const PointResult& point = result.points[i];
    Ordered record = to_json(point.settings);
    record["on_front"] = std::ranges::find(result.front, i) == result.front.end() ? 0 : 1;
    if (point.failure.empty()) {
      Ordered json = to_json(point);
      json.erase("settings");
      record.update(json);
      record["no_truth"] = result.has_truth(point) ? 0 : 1;
      if (const ReferenceResult* reference = result.reference_of(point))
        record["reference_inverted_tets"] = {{"most", reference->inverted.most}, {"last", reference->inverted.last}};
    }
    record["failure"] = point.failure;
    records.push_back(std::move(record));
  }
  return to_csv(records);
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
  if (point.settings.space != name_of(Space::kReduced)) json["space"] = point.settings.space;
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

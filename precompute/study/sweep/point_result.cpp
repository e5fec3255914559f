#include "precompute/study/sweep/point_result.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "common/core/atomic_file.h"
#include "precompute/inputs/inputs.h"
#include "precompute/study/measure/error_json.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

TrajectoryErrors errors_from(const Ordered& json) {
  TrajectoryErrors errors;
  errors.position = relative_error_from(json.at("position")).value();
  errors.velocity = relative_error_from(json.at("velocity")).value();
  errors.energy = number_from(json.at("energy"));
  errors.shape = relative_error_from(json.at("shape"));
  errors.nearest_phase = relative_error_from(json.at("nearest_phase")).value();
  if (json.contains("rebound")) errors.rebound = number_from(json.at("rebound"));
  errors.worst_frame = json.at("worst_frame").get<std::size_t>();
  return errors;
}

PointResult point_from(const Ordered& json) {
  PointResult result;
  result.settings = settings_from_json(json.at("settings"));
  json.at("key").get_to(result.key);
  json.at("bundle").get_to(result.bundle);
  json.at("reference").get_to(result.reference);
  json.at("failure").get_to(result.failure);
  result.errors = errors_from(json.at("errors"));
  json.at("errors").at("worst_time").get_to(result.worst_time);
  result.from_all_elements = relative_error_from(json.at("errors").at("from_all_elements"));
  result.from_double = relative_error_from(json.at("errors").at("from_double"));
  json.at("modes").get_to(result.modes);
  json.at("elements").get_to(result.elements);
  json.at("internal_force").get_to(result.internal_force);
  json.at("target").get_to(result.target);
  json.at("heldout_error").get_to(result.heldout_error);
  json.at("precompute_seconds").get_to(result.precompute_seconds);
  json.at("newton_iterations").get_to(result.newton_iterations);
  json.at("factorisations").get_to(result.factorisations);
  json.at("steps").get_to(result.steps);
  json.at("unconverged_steps").get_to(result.unconverged_steps);
  json.at("warnings").get_to(result.warnings);
  return result;
}

std::string checksum(const Ordered& content) { return hash_inputs({}, content.dump()); }

// Clocks count nanoseconds: written as such, times are read as they were.
double microseconds(double seconds) { return static_cast<double>(std::llround(1e9 * seconds)) / 1e3; }
double seconds(const Ordered& microseconds) {
  return static_cast<double>(std::llround(1e3 * microseconds.get<double>())) / 1e9;
}

}  // namespace

Ordered to_json(const StepTimes& times) {
  Ordered stages = Ordered::object();
  for (std::size_t i = 0; i < kTimedStages.size(); ++i)
    stages[std::string(kTimedStages[i])] = microseconds(times.stages[i]);
  return {{"median_us", microseconds(times.median)},
          {"p95_us", microseconds(times.p95)},
          {"interp_us", microseconds(times.interpolation)},
          {"stages_median_us", stages},
          {"steps", times.steps}};
}

StepTimes times_from_json(const Ordered& json) {
  StepTimes times;
  times.median = seconds(json.at("median_us"));
  times.p95 = seconds(json.at("p95_us"));
  times.interpolation = seconds(json.at("interp_us"));
  for (std::size_t i = 0; i < kTimedStages.size(); ++i)
    times.stages[i] = seconds(json.at("stages_median_us").at(std::string(kTimedStages[i])));
  times.steps = json.at("steps").get<std::int64_t>();
  return times;
}

Ordered to_json(const PointResult& result) {
  const TrajectoryErrors& errors = result.errors;
  Ordered json{{"settings", to_json(result.settings)},
               {"key", result.key},
               {"bundle", result.bundle},
               {"reference", result.reference},
               {"failure", result.failure}};
  json["errors"] = {{"position", to_json(errors.position)},
                    {"velocity", to_json(errors.velocity)},
                    {"energy", json_number(errors.energy)},
                    {"shape", to_json(errors.shape)},
                    {"nearest_phase", to_json(errors.nearest_phase)},
                    {"from_all_elements", to_json(result.from_all_elements)},
                    {"from_double", to_json(result.from_double)},
                    {"worst_frame", errors.worst_frame},
                    {"worst_time", result.worst_time}};
  if (errors.rebound) json["errors"]["rebound"] = json_number(*errors.rebound);  // else there was none
  json["modes"] = result.modes;
  json["elements"] = result.elements;
  json["internal_force"] = result.internal_force;
  json["target"] = result.target;
  json["heldout_error"] = result.heldout_error;
  json["precompute_seconds"] = result.precompute_seconds;
  json["newton_iterations"] = result.newton_iterations;
  json["factorisations"] = result.factorisations;
  json["steps"] = result.steps;
  json["unconverged_steps"] = result.unconverged_steps;
  json["warnings"] = result.warnings;
  if (result.times) json["times"] = to_json(*result.times);
  return json;
}

void write_sealed(const std::filesystem::path& file, const Ordered& content) {
  write_file_atomically(file, Ordered{{"sha256", checksum(content)}, {"content", content}}.dump(2) + "\n");
}

std::optional<Ordered> read_sealed(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const Ordered json = Ordered::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("content") || json.value("sha256", "") != checksum(json["content"]))
    return std::nullopt;
  return json["content"];
}

void write_point(const std::filesystem::path& file, const PointResult& result) { write_sealed(file, to_json(result)); }

std::optional<PointResult> read_point(const std::filesystem::path& file) {
  const auto content = read_sealed(file);
  if (!content) return std::nullopt;
  try {
    return point_from(*content);
  } catch (const Ordered::exception&) {  // another version's
    return std::nullopt;
  }
}

}  // namespace exmat::precompute

#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "precompute/drawing/table.h"
#include "precompute/study/measure/error_json.h"
#include "precompute/study/worlds/world_study.h"

// Files and texts of a study of several bodies.

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

double microseconds(double seconds) { return static_cast<double>(std::llround(1e9 * seconds)) / 1e3; }

Ordered point_json(const WorldPointResult& point, const WorldStudyResult& result) {
  Ordered json{{"failure", point.failure}};
  for (std::size_t k = 0; k < point.settings.size(); ++k) {
    Ordered& kind = json["kinds"][result.kinds[k]];
    kind["settings"] = to_json(point.settings[k]);
    if (!point.failure.empty()) continue;
    kind["modes"] = point.modes[k];
    kind["elements"] = point.elements[k];
  }
  if (!point.failure.empty()) return json;
  for (const WorldError& error : point.errors)
    json["errors"][error.name] = {{"position", to_json(error.position)},
                                  {"velocity", to_json(error.velocity)},
                                  {"shape", to_json(error.shape)},
                                  {"energy", json_number(error.energy)}};
  json["newton_iterations"] = point.newton_iterations;
  json["steps"] = point.steps;
  json["unconverged_steps"] = point.unconverged_steps;
  json["precompute_seconds"] = point.precompute_seconds;
  if (point.times)
    json["times"] = {{"body_step_us", microseconds(point.times->median)},
                     {"body_step_p95_us", microseconds(point.times->p95)},
                     {"steps", point.times->steps}};
  return json;
}

}  // namespace

Ordered to_json(const WorldStudyResult& result) {
  Ordered json{{"name", result.name},         {"kinds", result.kinds},      {"bodies", result.bodies},
               {"frame_times", result.times}, {"points", Ordered::array()}, {"references", Ordered::array()},
               {"front", Ordered::array()},   {"recommended", nullptr}};
  for (const WorldPointResult& point : result.points) json["points"].push_back(point_json(point, result));
  for (const WorldReferenceResult& reference : result.references)
    json["references"].push_back({{"time_step", reference.time_step},
                                  {"integrator", reference.integrator},
                                  {"failure", reference.failure},
                                  {"steps", reference.steps},
                                  {"unconverged_steps", reference.unconverged_steps},
                                  {"newton_iterations", reference.newton_iterations},
                                  {"step_us", microseconds(reference.step_seconds)}});
  for (const std::size_t i : result.front) json["front"].push_back(i + 1);
  if (result.recommended) json["recommended"] = *result.recommended + 1;
  return json;
}

std::string world_results_csv(const WorldStudyResult& result) {
  std::vector<Ordered> records;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const Ordered point = point_json(result.points[i], result);
    const Ordered errors = point.value("errors", Ordered{{"all", Ordered::object()}});
    for (const auto& [body, error] : errors.items()) {
      Ordered& record = records.emplace_back(Ordered{{"point", i + 1}, {"body", body}});
      record.update(error);
      for (const char* member : {"times", "unconverged_steps", "failure"})
        if (point.contains(member)) record[member] = point[member];
    }
  }
  return to_csv(records);
}

}  // namespace exmat::precompute

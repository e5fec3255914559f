#include "precompute/study/sweep/study_config.h"

#include "common/config/json_file.h"
#include "common/config/json_values.h"
#include "common/core/error.h"

namespace exmat::precompute {
namespace {

template <typename T>
std::vector<T> list(const Json& json, const char* name) {
  return optional_member<std::vector<T>>(json, name).value_or(std::vector<T>{});
}

SweepConfig read_sweep(const Json& json) {
  return {.eigenfunctions = list<int>(json, "eigenfunctions"),
          .basis_size = list<int>(json, "basis_size"),
          .linear_modes = list<int>(json, "linear_modes"),
          .training = list<std::string>(json, "training"),
          .cubature_elements = list<int>(json, "cubature_elements"),
          .material = list<std::string>(json, "material"),
          .time_step = list<double>(json, "time_step"),
          .integrator = list<std::string>(json, "integrator"),
          .internal_force = list<std::string>(json, "internal_force"),
          .target = list<std::string>(json, "target"),
          .precision = list<std::string>(json, "precision"),
          .space = list<std::string>(json, "space"),
          .elastic_stiffness = list<double>(json, "elastic_stiffness")};
}

}  // namespace

StudyConfig load_study(const std::filesystem::path& file) {
  const Json json = read_json(file);
  check_against_schema(json, "study", file);
  check_numbers(json, file);
  StudyConfig study;
  study.file = file;
  study.name = json["name"];
  if (json.contains("asset") == json.contains("assets"))
    throw InputError({file.string(), "/", "asset or assets", json.contains("asset") ? "both" : "neither",
                      "a scene of several bodies takes \"assets\", one for each"});
  if (json.contains("asset")) study.asset = resolve_path(file, json["asset"]);
  for (const Json& entry : member_or(json, "assets", Json::array()))
    study.assets.push_back({entry["body"], resolve_path(file, entry["asset"])});
  study.scene = resolve_path(file, json["scene"]);
  study.steps = optional_member<std::int64_t>(json, "steps");
  study.frames = json.value("frames", study.frames);
  for (const Json& sweep : member_or(json, "sweeps", Json::array({Json::object()})))
    study.sweeps.push_back(read_sweep(sweep));
  const Json reference = member_or(json, "reference", Json::object());
  study.reference = {optional_member<double>(reference, "time_step"),
                     optional_member<std::string>(reference, "integrator")};
  if (json.contains("sources")) {
    const Json& sources = json["sources"];
    study.sources.emplace();
    study.sources->eigenfunctions = optional_member<int>(sources, "eigenfunctions");
    study.sources->time_steps = sources.value("time_steps", study.sources->time_steps);
    if (sources.contains("exact_examples"))
      study.sources->exact_examples = resolve_path(file, sources["exact_examples"]);
  }
  const Json timing = member_or(json, "timing", Json::object());
  study.timing.rounds = timing.value("rounds", study.timing.rounds);
  study.timing.steps = timing.value("steps", study.timing.steps);
  return study;
}

}  // namespace exmat::precompute

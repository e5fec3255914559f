#include "precompute/pipeline/run_report.h"

#include <set>

#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "common/core/version.h"
#include "common/hdf5/schema.h"
#include "precompute/cache/sha256.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {
namespace {

using Json = nlohmann::ordered_json;

std::string hash_of(const std::filesystem::path& file) {
  try {
    return sha256_of_file(file);
  } catch (const InputError&) {
    return "";
  }
}

Json inputs_of(const BuildReport& build) {
  Json inputs = Json::array();
  std::set<std::filesystem::path> seen;
  for (const auto& file : build.inputs)
    if (seen.insert(file).second) inputs.push_back({{"file", file.string()}, {"sha256", hash_of(file)}});
  return inputs;
}

Json bundle_of(const RunReport& report, const std::string& input_sha256) {
  Json bundle{{"file", report.bundle}};
  if (report.status == "failed") return bundle;
  bundle["sha256"] = hash_of(report.bundle);
  std::error_code ignored;
  bundle["bytes"] = std::filesystem::file_size(report.bundle, ignored);
  bundle["format_version"] = bundle_schema().format_version;
  bundle["input_sha256"] = input_sha256;
  return bundle;
}

Json stages_of(const BuildReport& build) {
  Json stages = Json::array();
  for (const StageTime& stage : build.stages)
    stages.push_back(
        {{"stage", stage.stage}, {"seconds", stage.seconds}, {"peak_memory_bytes", stage.peak_memory_bytes}});
  return stages;
}

Json cache_of(const BuildReport& build) {
  Json uses = Json::array();
  for (const CacheUse& use : build.cache) uses.push_back({{"stage", use.stage}, {"found", use.found}});
  return uses;
}

Json groups_of(const BuildReport& build) {
  Json groups = Json::array();
  for (const LedgerEntry& entry : build.ledger)
    groups.push_back(
        {{"group", entry.group}, {"included", entry.included}, {"bytes", entry.bytes}, {"reason", entry.reason}});
  return groups;
}

void add_examples(const std::string& region, const ExampleSet& set, Json& examples) {
  for (const ExampleData& example : set.examples)
    examples.push_back({{"name", example.name},
                        {"region", region},
                        {"method", example.method},
                        {"doubt", example.doubt},
                        {"alignment_residual", example.alignment_residual},
                        {"inverted_fraction", example.inverted_fraction},
                        {"competing_maps", example.competing_maps},
                        {"shape_space_error", example.shape_space_error},
                        {"basis_error", example.basis_error},
                        {"best_error", example.best_error},
                        {"settled_error", example.settled_error},
                        {"settled_distance", example.settled_distance},
                        {"settled_vertex", example.settled_vertex}});
}

Json examples_of(const ReducedModel& model) {
  Json examples = Json::array();
  if (model.examples) add_examples("", *model.examples, examples);
  for (const RegionData& region : model.regions) add_examples(region.name, region.examples, examples);
  return examples;
}

Json targets_of(const ReducedModel& model) {
  Json targets = Json::array();
  const auto add = [&](const std::string& region, const std::optional<TargetTableData>& table) {
    if (table) targets.push_back({{"region", region}, {"degree", table->degree}, {"error", table->error}});
  };
  add("", model.targets);
  for (const RegionData& region : model.regions) add(region.name, region.targets);
  return targets;
}

void add_model(const ReducedModel& model, Json& json) {
  json["sizes"] = {{"vertices", model.object->mesh.vertex_count()},
                   {"tets", model.object->mesh.tet_count()},
                   {"modes", model.modal->basis.cols()},
                   {"cubature_elements", model.cubature->elements.size()},
                   {"eigenfunctions", model.shape_space ? model.shape_space->eigenvalues.size() : 0}};
  if (model.object->stiffness_ratio > 0)
    json["mesh_stiffness"] = {{"formulation", name_of(model.object->materials.formulation)},
                              {"ratio", model.object->stiffness_ratio},
                              {"worst", model.object->worst_stiffness},
                              {"thin_share", model.object->thin_share}};
  json["examples"] = examples_of(model);
  json["cubature"] = {{"method", name_of(model.cubature->method)},
                      {"internal_force", name_of(model.cubature->internal_force)},
                      {"training_error", model.cubature->training_error},
                      {"heldout_error", model.cubature->heldout_error},
                      {"heldout_energy_error", model.cubature->heldout_energy_error},
                      {"heldout_stiffness_error", model.cubature->heldout_stiffness_error}};
  json["targets"] = targets_of(model);
  if (model.fidelity)
    json["fidelity"] = {{"loads", model.fidelity->loads},
                        {"basis", model.fidelity->basis},
                        {"position_error", model.fidelity->position_error},
                        {"shape_error", model.fidelity->shape_error},
                        {"end_error", model.fidelity->end_error},
                        {"settled_error", model.fidelity->settled_error},
                        {"all_elements_error", model.fidelity->all_elements_error},
                        {"modal_error", model.fidelity->modal_error},
                        {"captured_energy", model.fidelity->captured_energy},
                        {"advice", model.fidelity->advice}};
  if (model.render)
    json["render"] = {{"vertices", model.render->vertices.rows()},
                      {"triangles", model.render->triangles.rows()},
                      {"outside", model.render->outside},
                      {"farthest", model.render->farthest}};
}

}  // namespace

nlohmann::ordered_json to_json(const RunReport& report, const ReducedModel* model) {
  Json json{{"format", "exmat-report"},
            {"format_version", 2},
            {"program", "exmat-precompute " + std::string(version())},
            {"solvers", solver_versions()},
            {"status", report.status},
            {"exit_status", report.exit_status},
            {"message", report.message},
            {"asset", report.asset},
            {"bundle", bundle_of(report, report.build.input_sha256)},
            {"inputs", inputs_of(report.build)},
            {"warnings", report.warnings},
            {"stages", stages_of(report.build)},
            {"cache", cache_of(report.build)},
            {"groups", groups_of(report.build)}};
  if (model != nullptr) add_model(*model, json);
  return json;
}

}  // namespace exmat::precompute

#include "precompute/study/sweep/study_plan.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "common/core/version.h"
#include "common/mesh/geometry.h"
#include "precompute/pipeline/build_reduced_model.h"
#include "precompute/study/measure/frames.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr std::size_t kKeyLength = 16;  // hexadecimal digits

class Planner {
 public:
  Planner(const StudyConfig& config, const AssetConfig& asset, const SceneConfig& scene, StudyResult& result)
      : config_(config), asset_(asset), scene_(scene), result_(result) {}

  StudyPlan plan();

 private:
  void read_inputs();
  std::size_t plan_bundle(const PointSettings& settings, const std::vector<PointSettings>& all);
  std::size_t plan_reference(const PointSettings& settings, std::size_t bundle);
  void plan_comparisons();

  const StudyConfig& config_;
  const AssetConfig& asset_;
  const SceneConfig& scene_;
  StudyResult& result_;
  StudyPlan plan_;
};

void Planner::read_inputs() {
  InputFiles files{asset_.file};
  const ObjectInput object = read_object(asset_, files);
  if (!asset_.examples.empty()) read_examples(asset_, object, files);
  result_.vertices = object.mesh.vertex_count();
  result_.tets = object.mesh.tet_count();
  result_.free_body = !object.fixed.any();
  result_.surface = surface_triangles(object.mesh.tets);
  plan_.mesh = object.mesh;
  if (!scene_.gravity.isZero()) result_.up = -scene_.gravity.normalized();
  result_.has_examples = scene_.examples || !scene_.regions.empty();
  for (const RegionForceConfig& region : scene_.regions) result_.regions.push_back(region.name);
  files.push_back(scene_.file);
  std::string salt = fmt::format("{}\n{}\n{}\n", version(), scene_.steps, config_.frames);
  for (const VertexForceConfig& force : scene_.forces) salt += fmt::format("{}\n", fmt::join(force.vertices, " "));
  plan_.inputs = hash_inputs(files, salt);
}

// Settings that make a bundle; the run time chooses between cubature and polynomial.
Ordered bundle_settings(const PointSettings& settings) {
  Ordered json = to_json(settings);
  for (const char* name : {"time_step", "integrator", "target", "precision", "space"}) json.erase(name);
  if (settings.internal_force == "polynomial") json["internal_force"] = "cubature";
  return json;
}

std::size_t Planner::plan_bundle(const PointSettings& settings, const std::vector<PointSettings>& all) {
  const Ordered own = bundle_settings(settings);
  SceneConfig scene = with_settings(scene_, settings);
  Needs needs = needs_of(scene);
  for (const PointSettings& other : all) {
    if (bundle_settings(other) != own) continue;
    const Needs more = needs_of(with_settings(scene_, other));
    if (other.internal_force == "polynomial") needs.internal_force = ForceMethod::kPolynomial;
    if (more.targets) needs.targets = true;
    if (more.full_space) needs.full_space = true;
    if (other.target != "solve") needs.regions = more.regions;
  }
  BundlePlan plan;
  plan.key = key_of(plan_, {{"bundle", own},
                            {"targets", needs.targets},
                            {"full_space", needs.full_space},
                            {"internal_force", name_of(needs.internal_force)},
                            {"tables", needs.regions && !needs.regions->empty() && needs.regions->front().targets}});
  const auto found = std::ranges::find(plan_.bundles, plan.key, &BundlePlan::key);
  if (found != plan_.bundles.end()) return static_cast<std::size_t>(found - plan_.bundles.begin());
  plan.asset = with_settings(asset_, settings);
  plan.scene = with_force(scene_, settings);
  plan.needs = needs;
  plan_.bundles.push_back(std::move(plan));
  return plan_.bundles.size() - 1;
}

std::size_t Planner::plan_reference(const PointSettings& settings, std::size_t bundle) {
  PointSettings own = settings;
  own.time_step = config_.reference.time_step.value_or(settings.time_step);
  own.integrator = config_.reference.integrator.value_or(settings.integrator);
  own.space = name_of(Space::kReduced);  // the reference is of code of its own
  Ordered identity{{"reference", own.material}, {"time_step", own.time_step}, {"integrator", own.integrator}};
  if (result_.has_examples) identity["eigenfunctions"] = own.eigenfunctions;
  if (own.elastic_stiffness) identity["elastic_stiffness"] = *own.elastic_stiffness;
  // A start in reduced coordinates is another one in each basis.
  if (scene_.body.reduced || scene_.body.pose) identity["bundle"] = plan_.bundles[bundle].key;
  identity["times"] = result_.times;
  const std::string key = key_of(plan_, identity);
  const auto found = std::ranges::find(plan_.references, key, &ReferencePlan::key);
  if (found != plan_.references.end()) return static_cast<std::size_t>(found - plan_.references.begin());
  plan_.references.push_back({key, plan_.bundles[bundle].key, with_settings(scene_, own),
                              result_.has_examples ? own.eigenfunctions : 0, own.material, ""});
  return plan_.references.size() - 1;
}

// A point with all elements serves those that differ in the internal force alone, best with the same target.
void Planner::plan_comparisons() {
  for (PointPlan& point : plan_.points) {
    if (point.settings.internal_force == kAllElements) continue;
    for (std::size_t i = 0; i < plan_.points.size(); ++i) {
      PointSettings other = plan_.points[i].settings;
      if (other.internal_force != kAllElements) continue;
      const bool same_target = other.target == point.settings.target;
      other.internal_force = point.settings.internal_force;
      other.cubature_elements = point.settings.cubature_elements;
      other.target = point.settings.target;
      if (other == point.settings && (same_target || !point.all_elements)) point.all_elements = i;
    }
  }
}

StudyPlan Planner::plan() {
  read_inputs();
  const auto all = expand(config_, asset_, scene_);
  std::vector<double> time_steps;
  for (const PointSettings& settings : all) time_steps.push_back(settings.time_step);
  if (config_.reference.time_step) time_steps.push_back(*config_.reference.time_step);
  try {
    result_.times = frame_times(static_cast<double>(scene_.steps) * scene_.time_step, time_steps, config_.frames);
  } catch (const InputError& error) {
    Complaint complaint = error.complaint();
    complaint.file = config_.file.string();
    throw InputError(std::move(complaint));
  }
  for (const PointSettings& settings : all) {
    PointPlan point{settings, "", plan_bundle(settings, all), 0, std::nullopt};
    point.reference = plan_reference(settings, point.bundle);
    plan_.points.push_back(std::move(point));
  }
  plan_comparisons();
  for (PointPlan& point : plan_.points) {
    Ordered identity{{"point", to_json(point.settings)}, {"reference", plan_.references[point.reference].key}};
    identity["compared"] = nullptr;
    if (point.all_elements) identity["compared"] = to_json(plan_.points[*point.all_elements].settings);
    point.key = key_of(plan_, identity);
  }
  return std::move(plan_);
}

}  // namespace

std::string key_of(const StudyPlan& plan, const nlohmann::ordered_json& settings) {
  return hash_inputs({}, plan.inputs + settings.dump()).substr(0, kKeyLength);
}

StudyPlan plan_study(const StudyConfig& config, const AssetConfig& asset, const SceneConfig& scene,
                     StudyResult& result) {
  return Planner(config, asset, scene, result).plan();
}

void build_bundle(const BundlePlan& plan, const std::filesystem::path& bundle, const std::filesystem::path& stages) {
  BuildReport report;
  const ReducedModel model = build_reduced_model(plan.asset, plan.needs, report, {.scene = &plan.scene});
  Ordered seconds = Ordered::object();
  double total = 0;
  for (const StageTime& stage : report.stages) {
    seconds[stage.stage] = stage.seconds;
    total += stage.seconds;
  }
  write_bundle(model, bundle);
  write_sealed(stages, {{"stage_seconds", seconds},
                        {"seconds", total},
                        {"heldout_error", model.cubature->heldout_error},
                        {"warnings", report.warnings}});
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw WorkError(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
}

}  // namespace exmat::precompute

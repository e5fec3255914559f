#include "precompute/study/sweep/study.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/config/json_file.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/version.h"
#include "common/mesh/geometry.h"
#include "precompute/pipeline/build_model.h"
#include "precompute/study/sweep/results_files.h"
#include "precompute/study/sweep/workers.h"
#include "runtime/kernels/kernels.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr std::size_t kKeyLength = 16;  // hexadecimal digits

// A bundle that some points share.
struct BundlePlan {
  std::string key;
  AssetConfig asset;
  Needs needs;
  std::string failure;
};

// A full-space run that some points share.
struct ReferencePlan {
  std::string key, bundle;
  SceneConfig scene;
  int eigenfunctions = 0;
  std::string material, failure;
};

struct PointPlan {
  PointSettings settings;
  std::string key;
  std::size_t bundle = 0, reference = 0;
  std::optional<std::size_t> all_elements;  ///< the point with all elements to compare with
};

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw WorkError(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
}

std::string processor_name() {
  std::ifstream stream("/proc/cpuinfo");
  for (std::string line; std::getline(stream, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.find(':') + 2, line.size()));
  return "unknown processor";
}

class Study {
 public:
  Study(const StudyConfig& config, const StudyOptions& options)
      : config_(config), options_(options), asset_(load_asset(config.asset)), scene_(load_scene(config.scene)) {
    if (config.steps) scene_.steps = *config.steps;
  }

  StudyResult run();

 private:
  void read_inputs();
  void plan();
  std::size_t plan_bundle(const PointSettings& settings, const std::vector<PointSettings>& all);
  std::size_t plan_reference(const PointSettings& settings, std::size_t bundle);
  void plan_comparisons();
  bool is_finished(const PointPlan& point) const;

  void build_bundles(int jobs);
  void run_references(int jobs);
  void run_points(int jobs, bool all_elements);
  void build_bundle(const BundlePlan& plan) const;
  void run_reference(const ReferencePlan& plan) const;
  void run_point(const PointPlan& plan) const;

  PointResult result_of(const PointPlan& plan) const;
  ReferenceResult result_of(const ReferencePlan& plan) const;
  void collect();
  void measure_times();
  void measure_times(const std::vector<std::size_t>& sound, const std::filesystem::path& file);
  std::unique_ptr<FullSpaceRun> baseline();
  void decide();
  void add_worst_frame(std::size_t point);
  void add_worst_frames();

  std::string key_of(const Ordered& settings) const {
    return hash_inputs({}, inputs_ + settings.dump()).substr(0, kKeyLength);
  }
  SceneConfig scene_of(const PointPlan& point, const std::string& bundle) const {
    SceneConfig scene = with_settings(scene_, point.settings);
    scene.bundle = bundle_file(bundle);
    return scene;
  }
  std::filesystem::path bundle_file(const std::string& key) const {
    return options_.folder / "bundles" / (key + ".h5");
  }
  std::filesystem::path stages_file(const std::string& key) const {
    return options_.folder / "bundles" / (key + ".json");
  }
  std::filesystem::path frames_file(const std::string& key) const {
    return options_.folder / "references" / (key + ".frames");
  }
  std::filesystem::path worst_file(const std::string& key) const {
    return options_.folder / "points" / (key + ".frames");
  }
  std::filesystem::path point_file(const std::string& key) const {
    return options_.folder / "points" / (key + ".json");
  }

  const StudyConfig& config_;
  const StudyOptions& options_;
  AssetConfig asset_;
  SceneConfig scene_;
  std::string inputs_;  // hash of all files and of what is the same for all points
  std::vector<BundlePlan> bundles_;
  std::vector<ReferencePlan> references_;
  std::vector<PointPlan> points_;
  std::vector<std::string> failures_;  // of each point
  StudyResult result_;
};

void Study::read_inputs() {
  InputFiles files{asset_.file};
  const ObjectInput object = read_object(asset_, files);
  if (!asset_.examples.empty()) read_examples(asset_, object, files);
  result_.vertices = object.mesh.vertex_count();
  result_.tets = object.mesh.tet_count();
  result_.free_body = !object.fixed.any();
  result_.surface = surface_triangles(object.mesh.tets);
  if (!scene_.gravity.isZero()) result_.up = -scene_.gravity.normalized();
  result_.has_examples = scene_.examples || !scene_.regions.empty();
  for (const RegionForceConfig& region : scene_.regions) result_.regions.push_back(region.name);
  files.push_back(scene_.file);
  std::string salt = fmt::format("{}\n{}\n{}\n", version(), scene_.steps, config_.frames);
  for (const VertexForceConfig& force : scene_.forces) salt += fmt::format("{}\n", fmt::join(force.vertices, " "));
  inputs_ = hash_inputs(files, salt);
}

// Settings that make a bundle; the run time chooses between cubature and polynomial.
Ordered bundle_settings(const PointSettings& settings) {
  Ordered json = to_json(settings);
  for (const char* name : {"time_step", "integrator", "target"}) json.erase(name);
  if (settings.internal_force == "polynomial") json["internal_force"] = "cubature";
  return json;
}

std::size_t Study::plan_bundle(const PointSettings& settings, const std::vector<PointSettings>& all) {
  const Ordered own = bundle_settings(settings);
  SceneConfig scene = with_settings(scene_, settings);
  Needs needs = needs_of(scene);
  for (const PointSettings& other : all) {
    if (bundle_settings(other) != own) continue;
    const Needs more = needs_of(with_settings(scene_, other));
    if (other.internal_force == "polynomial") needs.internal_force = "polynomial";
    if (more.targets) needs.targets = true;
    if (other.target != "solve") needs.regions = more.regions;
  }
  BundlePlan plan;
  plan.key = key_of({{"bundle", own},
                     {"targets", needs.targets},
                     {"internal_force", needs.internal_force},
                     {"tables", needs.regions && !needs.regions->empty() && needs.regions->front().targets}});
  const auto found = std::ranges::find(bundles_, plan.key, &BundlePlan::key);
  if (found != bundles_.end()) return static_cast<std::size_t>(found - bundles_.begin());
  plan.asset = with_settings(asset_, settings);
  plan.needs = needs;
  bundles_.push_back(std::move(plan));
  return bundles_.size() - 1;
}

std::size_t Study::plan_reference(const PointSettings& settings, std::size_t bundle) {
  PointSettings own = settings;
  own.time_step = config_.reference.time_step.value_or(settings.time_step);
  own.integrator = config_.reference.integrator.value_or(settings.integrator);
  Ordered identity{{"reference", own.material}, {"time_step", own.time_step}, {"integrator", own.integrator}};
  if (result_.has_examples) identity["eigenfunctions"] = own.eigenfunctions;
  // A start in reduced coordinates is another one in each basis.
  if (scene_.body.reduced || scene_.body.pose) identity["bundle"] = bundles_[bundle].key;
  identity["times"] = result_.times;
  const std::string key = key_of(identity);
  const auto found = std::ranges::find(references_, key, &ReferencePlan::key);
  if (found != references_.end()) return static_cast<std::size_t>(found - references_.begin());
  references_.push_back({key, bundles_[bundle].key, with_settings(scene_, own),
                         result_.has_examples ? own.eigenfunctions : 0, own.material, ""});
  return references_.size() - 1;
}

// A point with all elements serves those that differ in the internal force alone, best with the same target.
void Study::plan_comparisons() {
  for (PointPlan& point : points_) {
    if (point.settings.internal_force == kAllElements) continue;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      PointSettings other = points_[i].settings;
      if (other.internal_force != kAllElements) continue;
      const bool same_target = other.target == point.settings.target;
      other.internal_force = point.settings.internal_force;
      other.cubature_elements = point.settings.cubature_elements;
      other.target = point.settings.target;
      if (other == point.settings && (same_target || !point.all_elements)) point.all_elements = i;
    }
  }
}

void Study::plan() {
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
    points_.push_back(std::move(point));
  }
  plan_comparisons();
  for (PointPlan& point : points_) {
    Ordered identity{{"point", to_json(point.settings)}, {"reference", references_[point.reference].key}};
    identity["compared"] = nullptr;
    if (point.all_elements) identity["compared"] = to_json(points_[*point.all_elements].settings);
    point.key = key_of(identity);
  }
  failures_.resize(points_.size());
}

bool Study::is_finished(const PointPlan& point) const {
  const auto result = read_point(point_file(point.key));
  if (!result || !std::filesystem::exists(bundle_file(result->bundle))) return false;
  return point.settings.internal_force != kAllElements || read_frames(frames_file(point.key)).has_value();
}

void Study::build_bundle(const BundlePlan& plan) const {
  BuildReport report;
  const ReducedModel model = build_model(plan.asset, plan.needs, report);
  Ordered stages = Ordered::object();
  double total = 0;
  for (const StageTime& stage : report.stages) {
    stages[stage.stage] = stage.seconds;
    total += stage.seconds;
  }
  write_bundle(model, bundle_file(plan.key));
  write_sealed(stages_file(plan.key), {{"stage_seconds", stages},
                                       {"seconds", total},
                                       {"heldout_error", model.cubature->heldout_error},
                                       {"warnings", report.warnings}});
}

void Study::run_reference(const ReferencePlan& plan) const {
  SceneConfig scene = plan.scene;
  scene.bundle = bundle_file(plan.bundle);
  write_frames(frames_file(plan.key), run_full_space(scene, read_bundle(scene.bundle), result_.times));
}

BodyFrames read_or_fail(const std::filesystem::path& file) {
  auto frames = read_frames(file);
  if (!frames) throw WorkError(fmt::format("{}: no sound frames", file.string()));
  return std::move(*frames);
}

// One frame alone.
BodyFrames only(const BodyFrames& frames, std::size_t i) {
  BodyFrames one;
  one.times = {frames.times[i]};
  one.positions = {frames.positions[i]};
  one.velocities = {frames.velocities[i]};
  one.kinetic = {frames.kinetic[i]};
  one.elastic = {frames.elastic[i]};
  one.potential = {frames.potential[i]};
  return one;
}

void Study::run_point(const PointPlan& plan) const {
  const SceneConfig scene = scene_of(plan, bundles_[plan.bundle].key);
  const ReducedModel data = read_bundle(scene.bundle);
  const SparseMatrix mass = scalar_mass(data.object->mesh, data.object->materials.density);
  const auto& rest = data.object->mesh.vertices;
  const ReducedRun run = run_reduced(scene, result_.times);
  PointResult result;
  result.settings = plan.settings;
  result.key = plan.key;
  result.bundle = bundles_[plan.bundle].key;
  result.reference = references_[plan.reference].key;
  result.errors =
      trajectory_errors(run.frames, read_or_fail(frames_file(result.reference)), rest, mass, result_.free_body);
  result.worst_time = result_.times[result.errors.worst_frame];
  if (plan.all_elements)
    result.from_all_elements =
        trajectory_errors(run.frames, read_or_fail(frames_file(points_[*plan.all_elements].key)), rest, mass, false)
            .position;
  result.modes = run.modes;
  result.elements = run.elements;
  result.internal_force = run.internal_force;
  result.target = run.target;
  result.newton_iterations = run.frames.newton_iterations;
  result.factorisations = run.frames.factorisations;
  result.steps = run.frames.steps;
  result.unconverged_steps = run.frames.unconverged;
  const auto stages = read_sealed(stages_file(result.bundle));
  if (!stages) throw WorkError(fmt::format("{}: no sound file", stages_file(result.bundle).string()));
  result.heldout_error = stages->at("heldout_error").get<double>();
  result.precompute_seconds = stages->at("seconds").get<double>();
  result.warnings = stages->at("warnings").get<std::vector<std::string>>();
  if (plan.settings.internal_force == kAllElements) write_frames(frames_file(plan.key), run.frames);
  write_frames(worst_file(plan.key), only(run.frames, result.errors.worst_frame));
  write_point(point_file(plan.key), result);
}

void Study::build_bundles(int jobs) {
  std::set<std::size_t> needed;
  for (const PointPlan& point : points_)
    if (!is_finished(point)) needed.insert(point.bundle);
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (const std::size_t i : needed) {
    if (std::filesystem::exists(bundle_file(bundles_[i].key)) && read_sealed(stages_file(bundles_[i].key))) continue;
    work.push_back({"bundle " + bundles_[i].key, [this, i] { build_bundle(bundles_[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("bundles", work, jobs);
  for (std::size_t k = 0; k < which.size(); ++k) bundles_[which[k]].failure = failures[k].value_or("");
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (!is_finished(points_[i])) failures_[i] = bundles_[points_[i].bundle].failure;
}

void Study::run_references(int jobs) {
  std::set<std::size_t> needed;
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (failures_[i].empty() && !is_finished(points_[i])) {
      needed.insert(points_[i].reference);
      references_[points_[i].reference].bundle = bundles_[points_[i].bundle].key;  // one that is there
    }
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (const std::size_t i : needed) {
    if (read_frames(frames_file(references_[i].key))) continue;
    work.push_back({"full space " + references_[i].key, [this, i] { run_reference(references_[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("full space", work, jobs);
  for (std::size_t k = 0; k < which.size(); ++k) references_[which[k]].failure = failures[k].value_or("");
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (failures_[i].empty() && !references_[points_[i].reference].failure.empty())
      failures_[i] = "full space: " + references_[points_[i].reference].failure;
}

void Study::run_points(int jobs, bool all_elements) {
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const bool now = (points_[i].settings.internal_force == kAllElements) == all_elements;
    if (!now || !failures_[i].empty() || is_finished(points_[i])) continue;
    const auto compared = points_[i].all_elements;
    if (compared && !failures_[*compared].empty()) failures_[i] = "all elements: " + failures_[*compared];
    if (!failures_[i].empty()) continue;
    work.push_back({describe(points_[i].settings), [this, i] { run_point(points_[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes(all_elements ? "points with all elements" : "points", work, jobs);
  for (std::size_t k = 0; k < which.size(); ++k) failures_[which[k]] = failures[k].value_or("");
}

PointResult Study::result_of(const PointPlan& plan) const {
  const auto i = static_cast<std::size_t>(&plan - points_.data());
  PointResult failed;
  failed.settings = plan.settings;
  failed.key = plan.key;
  failed.failure = failures_[i];
  if (!failed.failure.empty()) return failed;
  const auto result = read_point(point_file(plan.key));
  if (result) return *result;
  failed.failure = fmt::format("{}: no sound file", point_file(plan.key).string());
  return failed;
}

ReferenceResult Study::result_of(const ReferencePlan& plan) const {
  ReferenceResult result;
  result.key = plan.key;
  result.eigenfunctions = plan.eigenfunctions;
  result.time_step = plan.scene.time_step;
  result.integrator = plan.scene.integrator;
  result.material = plan.material;
  result.failure = plan.failure;
  const auto frames = read_frames(frames_file(plan.key));
  if (!frames) return result;
  result.steps = frames->steps;
  result.unconverged_steps = frames->unconverged;
  result.newton_iterations = frames->newton_iterations;
  result.factorisations = frames->factorisations;
  result.step_seconds = frames->step_seconds;
  return result;
}

void Study::collect() {
  result_.config = config_;
  result_.asset_name = asset_.name;
  result_.budget = options_.budget;
  result_.processor = processor_name();
  result_.instruction_set = runtime::kernels().name;
  for (const PointPlan& point : points_) result_.points.push_back(result_of(point));
  for (const ReferencePlan& reference : references_) result_.references.push_back(result_of(reference));
  const PointSettings own = own_settings(asset_, scene_);
  const auto found = std::ranges::find(points_, own, &PointPlan::settings);
  result_.own = found == points_.end() ? 0 : static_cast<std::size_t>(found - points_.begin());
}

std::unique_ptr<FullSpaceRun> Study::baseline() {
  const PointPlan& own = points_[result_.own];
  if (!config_.baseline || !result_.points[result_.own].failure.empty()) return nullptr;
  try {
    const SceneConfig scene = scene_of(own, result_.points[result_.own].bundle);
    return std::make_unique<FullSpaceRun>(scene, read_bundle(scene.bundle), true);
  } catch (const std::exception& error) {
    result_.baseline_failure = error.what();
    log::error(fmt::format("baseline: {}", error.what()));
    return nullptr;
  }
}

void Study::measure_times(const std::vector<std::size_t>& sound, const std::filesystem::path& file) {
  std::vector<SceneConfig> scenes;
  for (const std::size_t i : sound) scenes.push_back(scene_of(points_[i], result_.points[i].bundle));
  const auto body = baseline();
  const Timings timings = time_steps(scenes, config_.timing, body.get());
  Ordered json = Ordered::object();
  Ordered& points = json["points"] = Ordered::object();
  for (std::size_t k = 0; k < sound.size(); ++k) {
    result_.points[sound[k]].times = timings.points[k];
    points[points_[sound[k]].key] = to_json(timings.points[k]);
  }
  if (body) result_.baseline = timings.baseline;
  if (body) json["baseline"] = to_json(timings.baseline);
  json["baseline_failure"] = result_.baseline_failure;
  write_sealed(file, json);
}

// Times compare only with those of the same run, so that all are measured again where one is new.
void Study::measure_times() {
  std::vector<std::size_t> sound;
  Ordered identity{{"processor", result_.processor},  {"instructions", result_.instruction_set},
                   {"rounds", config_.timing.rounds}, {"steps", config_.timing.steps},
                   {"baseline", config_.baseline},    {"baseline_steps", config_.timing.baseline_steps}};
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!result_.points[i].failure.empty()) continue;
    sound.push_back(i);
    identity["points"].push_back(points_[i].key);
  }
  if (sound.empty()) return;
  const auto file = options_.folder / "timing" / (key_of(identity) + ".json");
  const auto measured = read_sealed(file);
  if (!measured) return measure_times(sound, file);
  for (const std::size_t i : sound)
    result_.points[i].times = times_from_json(measured->at("points").at(points_[i].key));
  if (measured->contains("baseline")) result_.baseline = times_from_json(measured->at("baseline"));
  result_.baseline_failure = measured->at("baseline_failure").get<std::string>();
}

void Study::decide() {
  const auto all = outcomes(result_.points);
  result_.front = pareto_front(all);
  if (!options_.budget.seconds && !options_.budget.error) return;
  result_.recommended = choose(all, options_.budget);
  result_.nearest = nearest(all, options_.budget);
}

void Study::add_worst_frame(std::size_t point) {
  const PointResult& result = result_.points[point];
  if (!result.failure.empty() ||
      std::ranges::find(result_.worst_frames, point, &WorstFrame::point) != result_.worst_frames.end())
    return;
  const auto reduced = read_frames(worst_file(result.key)), full = read_frames(frames_file(result.reference));
  if (!reduced || !full || result.errors.worst_frame >= full->positions.size()) return;
  result_.worst_frames.push_back({point, reduced->positions[0], full->positions[result.errors.worst_frame]});
}

void Study::add_worst_frames() {
  const auto all = outcomes(result_.points);
  if (result_.recommended) add_worst_frame(*result_.recommended);
  add_worst_frame(result_.own);
  if (!result_.front.empty())
    add_worst_frame(static_cast<std::size_t>(
        std::ranges::max_element(all, {}, [](const Outcome& o) { return std::isfinite(o.error) ? o.error : -1; }) -
        all.begin()));
}

StudyResult Study::run() {
  read_inputs();
  plan();
  for (const char* folder : {"bundles", "references", "points", "timing"}) make_folder(options_.folder / folder);
  log::info(fmt::format("{}: {} points, {} bundles, {} full-space runs, {} frames", config_.name, points_.size(),
                        bundles_.size(), references_.size(), result_.times.size()));
  build_bundles(options_.jobs);
  run_references(options_.jobs);
  run_points(options_.jobs, true);
  run_points(options_.jobs, false);
  collect();
  measure_times();
  decide();
  add_worst_frames();
  return std::move(result_);
}

}  // namespace

std::size_t StudyResult::failures() const {
  const auto failed = [](const auto& item) { return !item.failure.empty(); };
  return static_cast<std::size_t>(std::ranges::count_if(points, failed) + !baseline_failure.empty());
}

std::vector<Outcome> outcomes(const std::vector<PointResult>& points) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<Outcome> result;
  for (const PointResult& point : points)
    result.push_back(point.times ? Outcome{point.errors.position.mean, point.times->median} : Outcome{kNone, kNone});
  return result;
}

StudyResult run_study(const StudyConfig& config, const StudyOptions& options) {
  StudyResult result = Study(config, options).run();
  write_results(result, options.folder);
  return result;
}

}  // namespace exmat::precompute

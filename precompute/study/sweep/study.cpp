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
#include "precompute/study/measure/runs.h"
#include "precompute/study/sweep/results_files.h"
#include "precompute/study/sweep/study_plan.h"
#include "precompute/study/sweep/study_sources.h"
#include "precompute/study/sweep/workers.h"
#include "runtime/kernels/kernels.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

std::string processor_name() {
  std::ifstream stream("/proc/cpuinfo");
  for (std::string line; std::getline(stream, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.find(':') + 2, line.size()));
  return "unknown processor";
}

const std::filesystem::path& asset_of(const StudyConfig& config) {
  if (config.asset.empty())
    throw InputError({config.file.string(), "/assets", "\"asset\", since the scene is of one body", "assets", ""});
  return config.asset;
}

class Study {
 public:
  Study(const StudyConfig& config, const StudyOptions& options)
      : config_(config), options_(options), asset_(load_asset(asset_of(config))), scene_(load_scene(config.scene)) {
    if (config.steps) scene_.steps = *config.steps;
  }

  StudyResult run();

 private:
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
  void decide();
  void add_worst_frame(std::size_t point);
  void add_worst_frames();

  SourcesInput sources_input() const {
    return {config_, asset_, scene_, plan_, result_, options_.folder, options_.jobs};
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
  StudyPlan plan_;
  std::vector<std::string> failures_;  // of each point
  StudyResult result_;
};

bool Study::is_finished(const PointPlan& point) const {
  const auto result = read_point(point_file(point.key));
  if (!result || !std::filesystem::exists(bundle_file(result->bundle))) return false;
  return point.settings.internal_force != kAllElements || read_frames(frames_file(point.key)).has_value();
}

void Study::build_bundle(const BundlePlan& plan) const {
  precompute::build_bundle(plan, bundle_file(plan.key), stages_file(plan.key));
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
  const SceneConfig scene = scene_of(plan, plan_.bundles[plan.bundle].key);
  const ReducedModel data = read_bundle(scene.bundle);
  const SparseMatrix mass = scalar_mass(data.object->mesh, data.object->materials.density);
  const auto& rest = data.object->mesh.vertices;
  const ReducedRun run = run_reduced(scene, result_.times);
  PointResult result;
  result.settings = plan.settings;
  result.key = plan.key;
  result.bundle = plan_.bundles[plan.bundle].key;
  result.reference = plan_.references[plan.reference].key;
  const BodyFrames full = read_or_fail(frames_file(result.reference));
  result.errors = trajectory_errors(run.frames, full, rest, mass, result_.free_body);
  result.worst_time = result_.times[result.errors.worst_frame];
  if (plan.all_elements)
    result.from_all_elements =
        trajectory_errors(run.frames, read_or_fail(frames_file(plan_.points[*plan.all_elements].key)), rest, mass,
                          result_.free_body)
            .headline();
  if (scene.precision == Precision::kMixed) {
    SceneConfig exact = scene;
    exact.precision = Precision::kDouble;
    result.from_double =
        trajectory_errors(run.frames, run_reduced(exact, result_.times).frames, rest, mass, result_.free_body)
            .headline();
  }
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
  BodyFrames worst = only(run.frames, result.errors.worst_frame);
  if (result_.free_body)
    worst.positions[0] = fitted(mass, worst.positions[0], full.positions[result.errors.worst_frame]);
  write_frames(worst_file(plan.key), worst);
  write_point(point_file(plan.key), result);
}

void Study::build_bundles(int jobs) {
  std::set<std::size_t> needed;
  for (const PointPlan& point : plan_.points)
    if (!is_finished(point)) needed.insert(point.bundle);
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (const std::size_t i : needed) {
    if (std::filesystem::exists(bundle_file(plan_.bundles[i].key)) && read_sealed(stages_file(plan_.bundles[i].key)))
      continue;
    work.push_back({"bundle " + plan_.bundles[i].key, [this, i] { build_bundle(plan_.bundles[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("bundles", work, jobs);
  for (std::size_t k = 0; k < which.size(); ++k) plan_.bundles[which[k]].failure = failures[k].value_or("");
  for (std::size_t i = 0; i < plan_.points.size(); ++i)
    if (!is_finished(plan_.points[i])) failures_[i] = plan_.bundles[plan_.points[i].bundle].failure;
}

void Study::run_references(int jobs) {
  std::set<std::size_t> needed;
  for (std::size_t i = 0; i < plan_.points.size(); ++i)
    if (failures_[i].empty() && !is_finished(plan_.points[i])) {
      needed.insert(plan_.points[i].reference);
      plan_.references[plan_.points[i].reference].bundle =
          plan_.bundles[plan_.points[i].bundle].key;  // one that is there
    }
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (const std::size_t i : needed) {
    if (read_frames(frames_file(plan_.references[i].key))) continue;
    work.push_back({"full space " + plan_.references[i].key, [this, i] { run_reference(plan_.references[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("full space", work, jobs);
  for (std::size_t k = 0; k < which.size(); ++k) plan_.references[which[k]].failure = failures[k].value_or("");
  for (std::size_t i = 0; i < plan_.points.size(); ++i)
    if (failures_[i].empty() && !plan_.references[plan_.points[i].reference].failure.empty())
      failures_[i] = "full space: " + plan_.references[plan_.points[i].reference].failure;
}

void Study::run_points(int jobs, bool all_elements) {
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < plan_.points.size(); ++i) {
    const bool now = (plan_.points[i].settings.internal_force == kAllElements) == all_elements;
    if (!now || !failures_[i].empty() || is_finished(plan_.points[i])) continue;
    const auto compared = plan_.points[i].all_elements;
    if (compared && !failures_[*compared].empty()) failures_[i] = "all elements: " + failures_[*compared];
    if (!failures_[i].empty()) continue;
    work.push_back({describe(plan_.points[i].settings), [this, i] { run_point(plan_.points[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes(all_elements ? "points with all elements" : "points", work, jobs);
  for (std::size_t k = 0; k < which.size(); ++k) failures_[which[k]] = failures[k].value_or("");
}

PointResult Study::result_of(const PointPlan& plan) const {
  const auto i = static_cast<std::size_t>(&plan - plan_.points.data());
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
  result.integrator = name_of(plan.scene.integrator);
  result.material = plan.material;
  result.failure = plan.failure;
  const auto frames = read_frames(frames_file(plan.key));
  if (!frames) return result;
  result.steps = frames->steps;
  result.unconverged_steps = frames->unconverged;
  result.newton_iterations = frames->newton_iterations;
  result.factorisations = frames->factorisations;
  result.step_seconds = frames->step_seconds;
  result.inverted = inverted_tets(plan_.mesh, frames->positions);
  return result;
}

void Study::collect() {
  result_.config = config_;
  result_.asset_name = asset_.name;
  result_.budget = options_.budget;
  result_.processor = processor_name();
  result_.instruction_set = runtime::kernels().name;
  for (const PointPlan& point : plan_.points) result_.points.push_back(result_of(point));
  for (const ReferencePlan& reference : plan_.references) result_.references.push_back(result_of(reference));
  const PointSettings own = own_settings(asset_, scene_);
  const auto found = std::ranges::find(plan_.points, own, &PointPlan::settings);
  result_.own = found == plan_.points.end() ? 0 : static_cast<std::size_t>(found - plan_.points.begin());
}

void Study::measure_times(const std::vector<std::size_t>& sound, const std::filesystem::path& file) {
  std::vector<SceneConfig> scenes;
  for (const std::size_t i : sound) scenes.push_back(scene_of(plan_.points[i], result_.points[i].bundle));
  const std::vector<StepTimes> times = time_steps(scenes, config_.timing);
  Ordered json = Ordered::object();
  Ordered& points = json["points"] = Ordered::object();
  for (std::size_t k = 0; k < sound.size(); ++k) {
    result_.points[sound[k]].times = times[k];
    points[plan_.points[sound[k]].key] = to_json(times[k]);
  }
  write_sealed(file, json);
}

// Times compare only with those of the same run, so that all are measured again where one is new.
void Study::measure_times() {
  std::vector<std::size_t> sound;
  Ordered identity{{"processor", result_.processor},
                   {"instructions", result_.instruction_set},
                   {"rounds", config_.timing.rounds},
                   {"steps", config_.timing.steps}};
  for (std::size_t i = 0; i < plan_.points.size(); ++i) {
    if (!result_.points[i].failure.empty()) continue;
    sound.push_back(i);
    identity["points"].push_back(plan_.points[i].key);
  }
  if (sound.empty()) return;
  const auto file = options_.folder / "timing" / (key_of(plan_, identity) + ".json");
  const auto measured = read_sealed(file);
  if (!measured) return measure_times(sound, file);
  for (const std::size_t i : sound)
    result_.points[i].times = times_from_json(measured->at("points").at(plan_.points[i].key));
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
  plan_ = plan_study(config_, asset_, scene_, result_);
  failures_.resize(plan_.points.size());
  if (config_.sources) require_sources(sources_input());
  std::vector<const char*> folders{"bundles", "references", "points", "timing"};
  if (config_.sources) folders.push_back("sources");
  for (const char* folder : folders) make_folder(options_.folder / folder);
  log::info(fmt::format("{}: {} points, {} bundles, {} full-space runs, {} frames", config_.name, plan_.points.size(),
                        plan_.bundles.size(), plan_.references.size(), result_.times.size()));
  build_bundles(options_.jobs);
  run_references(options_.jobs);
  run_points(options_.jobs, true);
  run_points(options_.jobs, false);
  collect();
  measure_times();
  decide();
  if (config_.sources) result_.sources = measure_sources(sources_input(), result_.recommended.value_or(result_.own));
  add_worst_frames();
  return std::move(result_);
}

}  // namespace

std::size_t StudyResult::failures() const {
  const auto failed = [](const auto& item) { return !item.failure.empty(); };
  return static_cast<std::size_t>(std::ranges::count_if(points, failed) + (sources && !sources->failure.empty()));
}

const ReferenceResult* StudyResult::reference_of(const PointResult& point) const {
  const auto found = std::ranges::find(references, point.reference, &ReferenceResult::key);
  return found == references.end() ? nullptr : &*found;
}

bool StudyResult::has_truth(const PointResult& point) const {
  const ReferenceResult* reference = reference_of(point);
  return reference == nullptr || !reference->inverted.any();
}

std::string StudyResult::truth_warning() const {
  const auto worst = std::ranges::max_element(references, {}, [](const auto& r) { return r.inverted.most; });
  if (worst == references.end() || !worst->inverted.any()) return "";
  const bool resists = worst->material == name_of(MaterialModel::kStableNeoHookean);
  return fmt::format(
      "No truth: the full space ({}) has up to {} inverted tets in a frame, so that errors against it "
      "say nothing; {}",
      worst->material, worst->inverted.most,
      resists ? "use smaller loads or a finer mesh." : "use the material stable_neo_hookean.");
}

std::vector<Outcome> outcomes(const std::vector<PointResult>& points) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<Outcome> result;
  for (const PointResult& point : points)
    result.push_back(point.times ? Outcome{point.errors.headline().mean, point.times->median} : Outcome{kNone, kNone});
  return result;
}

StudyResult run_study(const StudyConfig& config, const StudyOptions& options) {
  StudyResult result = Study(config, options).run();
  write_results(result, options.folder);
  return result;
}

}  // namespace exmat::precompute

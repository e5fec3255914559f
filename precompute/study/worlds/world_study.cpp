#include "precompute/study/worlds/world_study.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/version.h"
#include "common/mesh/assembly.h"
#include "precompute/inputs/inputs.h"
#include "precompute/study/measure/error_json.h"
#include "precompute/study/measure/runs.h"
#include "precompute/study/sweep/pareto.h"
#include "precompute/study/sweep/point_result.h"
#include "precompute/study/sweep/study_plan.h"
#include "precompute/study/sweep/workers.h"
#include "precompute/study/worlds/world_runs.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr std::size_t kKeyLength = 16;  // hexadecimal digits

struct WorldReferencePlan {
  std::string key;
  std::vector<PointSettings> settings;  // of each kind
  std::vector<std::size_t> bundles;     // likewise, of which the objects are taken
  std::string failure{};
};

struct WorldPointPlan {
  std::string key;
  std::vector<PointSettings> settings;
  std::vector<std::size_t> bundles;
  std::size_t reference = 0;
  std::string failure{};
};

class WorldStudy {
 public:
  WorldStudy(const StudyConfig& config, const StudyOptions& options);
  WorldStudyResult run();

 private:
  [[noreturn]] void refuse(const std::filesystem::path& file, const std::string& place, const std::string& expected,
                           const std::string& found, const std::string& advice) const {
    throw InputError({file.string(), place, expected, found, advice});
  }
  void require_measurable() const;
  void read_assets();
  void read_inputs();
  void plan();
  std::size_t plan_bundle(std::size_t kind, const PointSettings& settings);
  std::size_t plan_reference(std::vector<PointSettings> settings, const std::vector<std::size_t>& bundles);
  std::string key_of(const Ordered& settings) const {
    return hash_inputs({}, inputs_ + settings.dump()).substr(0, kKeyLength);
  }

  WorldConfig config_of(const std::vector<PointSettings>& settings, const std::vector<std::size_t>& bundles) const;
  bool is_finished(const WorldPointPlan& point) const {
    return read_sealed(file("points", point.key, "json")).has_value();
  }
  bool is_finished(const WorldReferencePlan& reference) const;
  void build_bundles();
  void run_references();
  void run_points();
  void run_point(const WorldPointPlan& plan) const;
  WorldRun read_reference(const WorldReferencePlan& plan) const;
  void collect();
  void measure_times();
  void decide();

  std::filesystem::path file(const char* folder, const std::string& key, const char* extension) const {
    return options_.folder / folder / (key + '.' + extension);
  }
  std::filesystem::path frames_file(const WorldReferencePlan& plan, std::size_t body) const {
    return file("references", fmt::format("{}_{}", plan.key, body), "frames");
  }

  const StudyConfig& config_;
  const StudyOptions& options_;
  WorldConfig world_;
  std::vector<AssetConfig> assets_;  // of the kinds
  std::string inputs_;
  std::vector<BundlePlan> bundles_;
  std::vector<WorldReferencePlan> references_;
  std::vector<WorldPointPlan> points_;
  WorldStudyResult result_;
};

WorldStudy::WorldStudy(const StudyConfig& config, const StudyOptions& options)
    : config_(config), options_(options), world_(load_world(config.scene)) {
  if (config.steps) world_.steps = *config.steps;
  for (BodiesConfig& bodies : world_.bodies) bodies.scene.steps = world_.steps;
  require_measurable();
  read_assets();
}

void WorldStudy::require_measurable() const {
  for (const BodiesConfig& bodies : world_.bodies) {
    require_no_keys(bodies.scene);
    if (!bodies.scene.body.motion.empty())
      refuse(world_.file, bodies.scene.place + "/body/motion", "no motion: the full space carries no bodies", "one",
             "");
  }
  const auto refuse_member = [&](bool there, const char* member) {
    if (there)
      refuse(config_.file, member, "no such member with a scene of several bodies", "one",
             "measure each body in a scene of its own for it");
  };
  refuse_member(config_.sources.has_value(), "/sources");
  refuse_member(std::ranges::any_of(config_.sweeps, [](const SweepConfig& sweep) { return !sweep.precision.empty(); }),
                "/sweeps/precision");
  refuse_member(std::ranges::any_of(config_.sweeps, [](const SweepConfig& sweep) { return !sweep.space.empty(); }),
                "/sweeps/space");
}

void WorldStudy::read_assets() {
  for (const BodiesConfig& bodies : world_.bodies) {
    const auto found = std::ranges::find(config_.assets, bodies.name, &BodyAsset::body);
    if (found == config_.assets.end())
      refuse(config_.file, "/assets", fmt::format("the asset of \"{}\"", bodies.name),
             config_.assets.empty() ? "none" : "others", "name the asset of each entry of the scene's bodies");
    assets_.push_back(load_asset(found->asset));
  }
  for (std::size_t i = 0; i < config_.assets.size(); ++i)
    if (std::ranges::find(world_.bodies, config_.assets[i].body, &BodiesConfig::name) == world_.bodies.end())
      refuse(config_.file, fmt::format("/assets/{}/body", i), "the name of one of the scene's bodies",
             '"' + config_.assets[i].body + '"', "");
}

// Reads all that the folder's files are made from: the assets, the scene, and all that is the same for all points.
void WorldStudy::read_inputs() {
  InputFiles files{world_.file};
  std::string salt = fmt::format("{}\nworld\n{}\n{}\n", version(), world_.steps, config_.frames);
  for (std::size_t k = 0; k < assets_.size(); ++k) {
    files.push_back(assets_[k].file);
    const ObjectInput object = read_object(assets_[k], files);
    if (!assets_[k].examples.empty()) read_examples(assets_[k], object, files);
    for (const VertexForceConfig& force : world_.bodies[k].scene.forces)
      salt += fmt::format("{}\n", fmt::join(force.vertices, " "));
    for (const BodyPlace& place : world_.bodies[k].places)
      salt += fmt::format("{} {}\n", fmt::join(place.position, " "), fmt::join(place.orientation.coeffs(), " "));
  }
  inputs_ = hash_inputs(files, salt);
}

Ordered json_of(const std::vector<PointSettings>& settings) {
  Ordered json = Ordered::array();
  for (const PointSettings& kind : settings) json.push_back(to_json(kind));
  return json;
}

std::size_t WorldStudy::plan_bundle(std::size_t kind, const PointSettings& settings) {
  Ordered own = to_json(settings);
  for (const char* name : {"time_step", "integrator"}) own.erase(name);
  BundlePlan plan;
  plan.key = key_of({{"bundle", own}, {"kind", world_.bodies[kind].name}});
  const auto found = std::ranges::find(bundles_, plan.key, &BundlePlan::key);
  if (found != bundles_.end()) return static_cast<std::size_t>(found - bundles_.begin());
  plan.asset = with_settings(assets_[kind], settings);
  plan.needs = needs_of(with_settings(world_.bodies[kind].scene, settings));
  plan.needs.full_space = true;  // the reference's
  // Bases learn from the body alone.
  plan.scene = with_force(world_.bodies[kind].scene, settings);
  plan.scene.meets_others = plan.scene.meets_bodies = false;
  bundles_.push_back(std::move(plan));
  return bundles_.size() - 1;
}

std::size_t WorldStudy::plan_reference(std::vector<PointSettings> settings, const std::vector<std::size_t>& bundles) {
  Ordered identity{{"times", result_.times}};
  for (std::size_t k = 0; k < settings.size(); ++k) {
    PointSettings& own = settings[k];
    const SceneConfig& scene = world_.bodies[k].scene;
    own.time_step = config_.reference.time_step.value_or(own.time_step);
    own.integrator = config_.reference.integrator.value_or(own.integrator);
    Ordered kind{{"material", own.material}, {"time_step", own.time_step}, {"integrator", own.integrator}};
    if (scene.examples || !scene.regions.empty()) kind["eigenfunctions"] = own.eigenfunctions;
    if (own.elastic_stiffness) kind["elastic_stiffness"] = *own.elastic_stiffness;
    // A start in reduced coordinates is another one in each basis.
    if (scene.body.reduced || scene.body.pose) kind["bundle"] = bundles_[bundles[k]].key;
    identity["kinds"].push_back(kind);
  }
  const std::string key = key_of({{"reference", identity}});
  const auto found = std::ranges::find(references_, key, &WorldReferencePlan::key);
  if (found != references_.end()) return static_cast<std::size_t>(found - references_.begin());
  references_.push_back({key, std::move(settings), bundles});
  return references_.size() - 1;
}

void WorldStudy::plan() {
  std::vector<std::vector<PointSettings>> all;  // of each point, of each kind
  for (std::size_t k = 0; k < assets_.size(); ++k) {
    const auto kind = expand_all(config_, assets_[k], world_.bodies[k].scene);
    all.resize(kind.size());
    for (std::size_t i = 0; i < kind.size(); ++i) all[i].push_back(kind[i]);
  }
  std::vector<double> time_steps;
  for (const auto& settings : all) time_steps.push_back(settings.front().time_step);
  if (config_.reference.time_step) time_steps.push_back(*config_.reference.time_step);
  try {
    result_.times = frame_times(static_cast<double>(world_.steps) * world_.time_step, time_steps, config_.frames);
  } catch (const InputError& error) {
    Complaint complaint = error.complaint();
    complaint.file = config_.file.string();
    throw InputError(std::move(complaint));
  }
  for (const auto& settings : all) {
    if (std::ranges::find(points_, settings, &WorldPointPlan::settings) != points_.end()) continue;
    WorldPointPlan point{"", settings, {}};
    for (std::size_t k = 0; k < settings.size(); ++k) point.bundles.push_back(plan_bundle(k, settings[k]));
    point.reference = plan_reference(settings, point.bundles);
    point.key = key_of({{"point", json_of(settings)}, {"reference", references_[point.reference].key}});
    points_.push_back(std::move(point));
  }
}

WorldConfig WorldStudy::config_of(const std::vector<PointSettings>& settings,
                                  const std::vector<std::size_t>& bundles) const {
  WorldConfig config = world_;
  config.time_step = settings.front().time_step;
  for (std::size_t k = 0; k < settings.size(); ++k) {
    config.bodies[k].scene = with_settings(world_.bodies[k].scene, settings[k]);
    config.bodies[k].scene.bundle = file("bundles", bundles_[bundles[k]].key, "h5");
  }
  return config;
}

// ---- what is run

void WorldStudy::build_bundles() {
  std::set<std::size_t> needed;
  for (const WorldPointPlan& point : points_) needed.insert(point.bundles.begin(), point.bundles.end());
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (const std::size_t i : needed) {
    const auto bundle = file("bundles", bundles_[i].key, "h5"), stages = file("bundles", bundles_[i].key, "json");
    if (std::filesystem::exists(bundle) && read_sealed(stages)) continue;
    work.push_back(
        {"bundle " + bundles_[i].key, [this, i, bundle, stages] { build_bundle(bundles_[i], bundle, stages); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("bundles", work, options_.jobs);
  for (std::size_t k = 0; k < which.size(); ++k) bundles_[which[k]].failure = failures[k].value_or("");
  for (WorldPointPlan& point : points_)
    for (const std::size_t i : point.bundles)
      if (point.failure.empty()) point.failure = bundles_[i].failure;
}

bool WorldStudy::is_finished(const WorldReferencePlan& reference) const {
  for (std::size_t i = 0; i < result_.bodies.size(); ++i)
    if (!read_frames(frames_file(reference, i))) return false;
  return true;
}

void WorldStudy::run_references() {
  std::set<std::size_t> needed;
  for (const WorldPointPlan& point : points_)
    if (point.failure.empty()) {
      needed.insert(point.reference);
      references_[point.reference].bundles = point.bundles;  // that are there
    }
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (const std::size_t i : needed) {
    if (is_finished(references_[i])) continue;
    work.push_back({"full space " + references_[i].key, [this, i] {
                      const WorldReferencePlan& plan = references_[i];
                      const WorldRun run = run_full_space_world(config_of(plan.settings, plan.bundles), result_.times);
                      for (std::size_t body = 0; body < run.bodies.size(); ++body)
                        write_frames(frames_file(plan, body), run.bodies[body]);
                    }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("full space", work, options_.jobs);
  for (std::size_t k = 0; k < which.size(); ++k) references_[which[k]].failure = failures[k].value_or("");
  for (WorldPointPlan& point : points_)
    if (point.failure.empty() && !references_[point.reference].failure.empty())
      point.failure = "full space: " + references_[point.reference].failure;
}

void WorldStudy::run_points() {
  std::vector<Job> work;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!points_[i].failure.empty() || is_finished(points_[i])) continue;
    work.push_back({describe(points_[i].settings.front()), [this, i] { run_point(points_[i]); }});
    which.push_back(i);
  }
  const auto failures = run_in_processes("points", work, options_.jobs);
  for (std::size_t k = 0; k < which.size(); ++k) points_[which[k]].failure = failures[k].value_or("");
}

WorldRun WorldStudy::read_reference(const WorldReferencePlan& plan) const {
  WorldRun run;
  for (std::size_t i = 0; i < result_.bodies.size(); ++i) {
    auto frames = read_frames(frames_file(plan, i));
    if (!frames) throw WorkError(fmt::format("{}: no sound frames", frames_file(plan, i).string()));
    run.bodies.push_back(std::move(*frames));
  }
  return run;
}

/// Rest positions and mass of a kind, or of all bodies, those of one below those of the other.
struct Weighed {
  VertexArray rest;
  SparseMatrix mass;
};

Weighed all_of(const std::vector<const Weighed*>& bodies) {
  Eigen::Index rows = 0;
  for (const Weighed* body : bodies) rows += body->rest.rows();
  Weighed all{VertexArray(rows, 3), SparseMatrix(rows, rows)};
  std::vector<Eigen::Triplet<double>> entries;
  rows = 0;
  for (const Weighed* body : bodies) {
    all.rest.middleRows(rows, body->rest.rows()) = body->rest;
    for (Eigen::Index row = 0; row < body->mass.outerSize(); ++row)
      for (SparseMatrix::InnerIterator entry(body->mass, row); entry; ++entry)
        entries.emplace_back(rows + entry.row(), rows + entry.col(), entry.value());
    rows += body->rest.rows();
  }
  all.mass.setFromTriplets(entries.begin(), entries.end());
  return all;
}

Ordered error_json(const std::string& name, const TrajectoryErrors& errors) {
  return {{"name", name},
          {"position", to_json(errors.position)},
          {"velocity", to_json(errors.velocity)},
          {"shape", to_json(errors.shape)},
          {"energy", json_number(errors.energy)}};
}

void WorldStudy::run_point(const WorldPointPlan& plan) const {
  const WorldRun run = run_world(config_of(plan.settings, plan.bundles), result_.times);
  const WorldRun full = read_reference(references_[plan.reference]);
  std::vector<Weighed> kinds;
  std::vector<bool> free;
  double seconds = 0;
  for (const std::size_t i : plan.bundles) {
    const ReducedModel data = read_bundle(file("bundles", bundles_[i].key, "h5"));
    kinds.push_back({data.object->mesh.vertices, scalar_mass(data.object->mesh, data.object->materials.density)});
    free.push_back(!data.object->fixed.any());
    seconds += read_sealed(file("bundles", bundles_[i].key, "json")).value().at("seconds").get<double>();
  }
  std::vector<const Weighed*> bodies;
  for (const std::size_t kind : run.kinds) bodies.push_back(&kinds[kind]);
  const Weighed all = all_of(bodies);
  Ordered json{{"key", plan.key}, {"errors", Ordered::array()}};
  json["errors"].push_back(error_json(
      "all", trajectory_errors(precompute::all_of(run), precompute::all_of(full), all.rest, all.mass, false)));
  for (std::size_t i = 0; i < bodies.size(); ++i)
    json["errors"].push_back(error_json(run.names[i], trajectory_errors(run.bodies[i], full.bodies[i], bodies[i]->rest,
                                                                        bodies[i]->mass, free[run.kinds[i]])));
  json["modes"] = run.modes;
  json["elements"] = run.elements;
  json["newton_iterations"] = run.bodies.front().newton_iterations;
  json["steps"] = run.bodies.front().steps;
  json["unconverged_steps"] = run.bodies.front().unconverged;
  json["precompute_seconds"] = seconds;
  write_sealed(file("points", plan.key, "json"), json);
}

// ---- what came of it

WorldPointResult point_from(const Ordered& json) {
  WorldPointResult point;
  for (const Ordered& error : json.at("errors"))
    point.errors.push_back({error.at("name").get<std::string>(), relative_error_from(error.at("position")).value(),
                            relative_error_from(error.at("velocity")).value(), relative_error_from(error.at("shape")),
                            number_from(error.at("energy"))});
  json.at("modes").get_to(point.modes);
  json.at("elements").get_to(point.elements);
  json.at("newton_iterations").get_to(point.newton_iterations);
  json.at("steps").get_to(point.steps);
  json.at("unconverged_steps").get_to(point.unconverged_steps);
  json.at("precompute_seconds").get_to(point.precompute_seconds);
  return point;
}

void WorldStudy::collect() {
  for (WorldPointPlan& plan : points_) {
    WorldPointResult point;
    const auto json = read_sealed(file("points", plan.key, "json"));
    if (plan.failure.empty() && !json) plan.failure = "no sound file of the point";
    if (plan.failure.empty()) point = point_from(*json);
    point.settings = plan.settings;
    point.key = plan.key;
    point.failure = plan.failure;
    result_.points.push_back(std::move(point));
  }
  for (const WorldReferencePlan& plan : references_) {
    WorldReferenceResult reference{plan.key, plan.failure, plan.settings.front().time_step,
                                   plan.settings.front().integrator};
    if (const auto frames = read_frames(frames_file(plan, 0))) {
      reference.steps = frames->steps;
      reference.unconverged_steps = frames->unconverged;
      reference.newton_iterations = frames->newton_iterations;
      reference.step_seconds = frames->step_seconds;
    }
    result_.references.push_back(std::move(reference));
  }
}

void WorldStudy::measure_times() {
  std::vector<std::size_t> sound;
  std::vector<WorldConfig> scenes;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!result_.points[i].failure.empty()) continue;
    sound.push_back(i);
    scenes.push_back(config_of(points_[i].settings, points_[i].bundles));
  }
  const auto times = time_worlds(scenes, config_.timing);
  for (std::size_t k = 0; k < sound.size(); ++k) result_.points[sound[k]].times = times[k];
}

void WorldStudy::decide() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<Outcome> all;
  for (const WorldPointResult& point : result_.points)
    all.push_back(point.times ? Outcome{point.errors.front().position.mean, point.times->median}
                              : Outcome{kInfinity, kInfinity});
  result_.front = pareto_front(all);
  if (options_.budget.seconds || options_.budget.error) result_.recommended = choose(all, options_.budget);
}

WorldStudyResult WorldStudy::run() {
  result_.name = config_.name;
  for (const BodiesConfig& bodies : world_.bodies) {
    result_.kinds.push_back(bodies.name);
    for (std::size_t i = 0; i < bodies.places.size(); ++i)
      result_.bodies.push_back(bodies.places.size() == 1 ? bodies.name : fmt::format("{}_{}", bodies.name, i));
  }
  read_inputs();
  plan();
  for (const char* folder : {"bundles", "references", "points"}) make_folder(options_.folder / folder);
  build_bundles();
  run_references();
  run_points();
  collect();
  measure_times();
  decide();
  write_file_atomically(options_.folder / "results.json", to_json(result_).dump(1) + '\n');
  write_file_atomically(options_.folder / "results.csv", world_results_csv(result_));
  return std::move(result_);
}

}  // namespace

std::size_t WorldStudyResult::failures() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(points, [](const auto& point) { return !point.failure.empty(); }));
}

bool is_of_bodies(const StudyConfig& config) { return load_world(config.scene).is_list; }

WorldStudyResult run_world_study(const StudyConfig& config, const StudyOptions& options) {
  return WorldStudy(config, options).run();
}

}  // namespace exmat::precompute

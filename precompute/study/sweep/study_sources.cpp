#include "precompute/study/sweep/study_sources.h"

#include <algorithm>
#include <fmt/format.h>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "precompute/study/measure/runs.h"
#include "precompute/study/sources/exact_models.h"
#include "precompute/study/sweep/workers.h"
#include "runtime/scene/obstacle_loader.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr int kMoreFunctions = 2;     // times the point's own, in the full problem
constexpr int kFunctionsLeftOut = 3;  // of a mesh of n vertices: no more than n - 3 are found
constexpr const char* kFolder = "sources";

int most_functions(const StudyPlan& plan) { return static_cast<int>(plan.mesh.vertex_count()) - kFunctionsLeftOut; }

int largest_of_points(const StudyPlan& plan) {
  return std::ranges::max(plan.points, {}, [](const PointPlan& p) { return p.settings.eigenfunctions; })
      .settings.eigenfunctions;
}

AssetConfig exact_asset(const std::filesystem::path& file) {
  AssetConfig asset = load_asset(file);
  asset.file = file;
  return asset;
}

// Doubt of the correspondence of an asset that is read anyway.
std::string doubt_of(const AssetConfig& asset, InputFiles& files) {
  const ObjectInput object = read_object(asset, files);
  return doubt_of_correspondence(object, read_examples(asset, object, files));
}

// One way to see the examples.
struct Sight {
  int eigenfunctions = 0;
  bool exact = false;  // by the asset of `exact_examples`
};

// A motion of the chain, to be run where its frames are not there.
struct Motion {
  std::optional<ErrorSource> source;
  std::string name, note;
  std::filesystem::path file;
  std::function<BodyFrames()> run;
};

class Split {
 public:
  Split(const SourcesInput& input, std::size_t point)
      : input_(input),
        sources_(*input.config.sources),
        plan_(input.plan.points[point]),
        settings_(plan_.settings),
        point_(input.result.points[point]),
        scene_(with_settings(input.scene, settings_)) {
    scene_.bundle = bundle_file();
  }

  ErrorSplit measure();

 private:
  std::filesystem::path folder() const { return input_.folder / kFolder; }
  std::filesystem::path bundle_file() const { return input_.folder / "bundles" / (point_.bundle + ".h5"); }
  bool examples() const { return input_.result.has_examples; }

  void plan();
  void plan_sight();
  void leave(ErrorSource source, PartStatus status, std::string note);
  void add(std::optional<ErrorSource> source, std::string name, std::string note, const Ordered& identity,
           std::function<BodyFrames()> run);
  void add_full_space(std::optional<ErrorSource> source, const std::string& note, const Sight& sight, double time_step,
                      bool all_poses);
  void add_reduced(ErrorSource source, const std::string& note, bool all, bool exact);

  AssetConfig asset_of(const Sight& sight) const;
  ReducedModel model_of(const Sight& sight) const;
  std::vector<PoseCoordinates> coordinates_of(const ReducedModel& model) const;
  BodyFrames run_full(const Sight& sight, double time_step, bool all_poses) const;
  BodyFrames run_variant(const std::filesystem::path& bundle, bool all, bool exact) const;
  std::string run_missing();

  const SourcesInput& input_;
  const SourcesConfig& sources_;
  const PointPlan& plan_;
  const PointSettings& settings_;
  const PointResult& point_;
  SceneConfig scene_;
  std::optional<AssetConfig> exact_;
  std::string exact_inputs_;  // hash of them
  std::vector<Motion> motions_;
  std::vector<ErrorPart> others_;
  std::vector<Sight> sights_;  // whose targets are sought in few displacements
  std::string full_problem_;
};

void Split::leave(ErrorSource source, PartStatus status, std::string note) {
  others_.push_back({source, status, std::move(note), std::nullopt, std::nullopt});
}

void Split::add(std::optional<ErrorSource> source, std::string name, std::string note, const Ordered& identity,
                std::function<BodyFrames()> run) {
  const auto file = folder() / (key_of(input_.plan, identity) + ".frames");
  motions_.push_back({source, std::move(name), std::move(note), file, std::move(run)});
}

AssetConfig Split::asset_of(const Sight& sight) const {
  AssetConfig asset = sight.exact ? *exact_ : with_settings(input_.asset, settings_);
  asset.eigenfunctions = sight.eigenfunctions;
  asset.weighting = input_.asset.weighting;
  return asset;
}

// The point's own model, with the examples as they are seen. It begins as the point does: q of its own basis.
ReducedModel Split::model_of(const Sight& sight) const {
  ReducedModel model = read_bundle(bundle_file());
  if (!examples() || (!sight.exact && sight.eigenfunctions == settings_.eigenfunctions)) return model;
  StageCache cache(folder() / "cache");
  return with_examples_of(asset_of(sight), std::move(model), cache);
}

std::vector<PoseCoordinates> Split::coordinates_of(const ReducedModel& model) const {
  if (!examples()) return {};
  StageCache cache(folder() / "cache");
  return target_coordinates(model, scene_, input_.asset.target_tolerance, input_.asset.seed, cache);
}

BodyFrames Split::run_full(const Sight& sight, double time_step, bool all_poses) const {
  SceneConfig scene = scene_;
  scene.time_step = time_step;
  const ReducedModel own = read_bundle(bundle_file());
  if (scene.body.pose) {
    scene.body.reduced = runtime::start_coordinates(scene_, own, own.modal->basis.cols());
    scene.body.pose.reset();
  }
  const ReducedModel model = model_of(sight);
  return run_full_space(scene, model, input_.result.times,
                        all_poses ? std::vector<PoseCoordinates>{} : coordinates_of(model));
}

// `all`: all tets; `exact`: targets over all tets, solved to the end.
BodyFrames Split::run_variant(const std::filesystem::path& bundle, bool all, bool exact) const {
  SceneConfig scene = scene_;
  if (!all && !exact) return run_reduced(scene, input_.result.times).frames;
  ReducedModel model = read_bundle(bundle_file());
  if (exact) {
    use_exact_targets(scene, coordinates_of(model), model);
    scene = with_exact_targets(scene);
  }
  if (all) {
    use_all_elements(model);
    scene.internal_force = ForceMethod::kCubature;
  }
  write_bundle(model, bundle);
  scene.bundle = bundle;
  BodyFrames frames = run_reduced(scene, input_.result.times).frames;
  std::error_code ignored;
  std::filesystem::remove(bundle, ignored);
  return frames;
}

void Split::add_full_space(std::optional<ErrorSource> source, const std::string& note, const Sight& sight,
                           double time_step, bool all_poses) {
  std::string name = fmt::format("full space, {:g} ms", 1e3 * time_step);
  Ordered identity{{"full space", settings_.material},
                   {"time_step", time_step},
                   {"integrator", settings_.integrator},
                   {"times", input_.result.times}};
  if (input_.scene.body.reduced || input_.scene.body.pose) identity["bundle"] = point_.bundle;
  if (examples()) {
    name += fmt::format(", m {}{}{}", sight.eigenfunctions, sight.exact ? ", exact examples" : "",
                        all_poses ? "" : ", few displacements");
    identity["eigenfunctions"] = sight.eigenfunctions;
    identity["linear_modes"] = settings_.linear_modes;
    identity["examples"] = sight.exact ? exact_inputs_ : "own";
    identity["all_poses"] = all_poses;
    if (!all_poses) sights_.push_back(sight);
  }
  if (!source) full_problem_ = name;
  add(source, std::move(name), note, identity, [=, this] { return run_full(sight, time_step, all_poses); });
  // The point may have been measured against this very motion.
  const ReferencePlan& reference = input_.plan.references[plan_.reference];
  const bool same = all_poses && !sight.exact && sight.eigenfunctions == settings_.eigenfunctions &&
                    reference.scene.time_step == time_step && reference.scene.integrator == scene_.integrator;
  if (same) motions_.back().file = input_.folder / "references" / (reference.key + ".frames");
}

void Split::add_reduced(ErrorSource source, const std::string& note, bool all, bool exact) {
  const Ordered identity{{"reduced", to_json(settings_)},
                         {"bundle", point_.bundle},
                         {"all_elements", all},
                         {"exact_targets", exact && examples()},
                         {"times", input_.result.times}};
  const auto bundle = folder() / (key_of(input_.plan, identity) + ".h5");
  add(source, fmt::format("reduced, {}", note), note, identity,
      [=, this] { return run_variant(bundle, all, exact && examples()); });
}

// From the full problem to the point's own sight of the examples, in full space.
void Split::plan_sight() {
  const int m = settings_.eigenfunctions;
  const double time_step = settings_.time_step, fine = time_step / sources_.time_steps;
  const int more = sources_.eigenfunctions.value_or(
      std::min(std::max(kMoreFunctions * m, largest_of_points(input_.plan)), most_functions(input_.plan)));
  InputFiles files;
  const std::string doubt = examples() ? doubt_of(input_.asset, files) : "";
  if (sources_.exact_examples && examples()) {
    exact_ = exact_asset(*sources_.exact_examples);
    InputFiles exact_files{exact_->file};
    doubt_of(*exact_, exact_files);
    exact_inputs_ = hash_inputs(exact_files, "");
  }
  const bool exact = exact_.has_value();
  const Sight truth{examples() && more > m ? more : m, exact};
  const bool has_more = truth.eigenfunctions > m;
  // The full problem has the point's own functions, and all poses, where there are no more functions.
  const bool all_poses = examples() && !has_more;

  add_full_space(std::nullopt, "", truth, sources_.time_steps > 1 ? fine : time_step, all_poses);
  if (sources_.time_steps > 1)
    add_full_space(ErrorSource::kTimeStep,
                   fmt::format("full space: {:g} ms against {:g} ms", 1e3 * time_step, 1e3 * fine), truth, time_step,
                   all_poses);
  else
    leave(ErrorSource::kTimeStep, PartStatus::kLeftOut, "sources.time_steps is 1");

  if (!examples()) {
    for (const ErrorSource source : {ErrorSource::kEigenfunctions, ErrorSource::kAlignment, ErrorSource::kTargets})
      leave(source, PartStatus::kNone, "the scene has no examples");
    return;
  }
  if (has_more)
    add_full_space(ErrorSource::kEigenfunctions, fmt::format("full space: m = {} against m = {}", m, more), {m, exact},
                   time_step, true);
  else
    leave(ErrorSource::kEigenfunctions, PartStatus::kNotKnown, "the mesh has no more of them");
  if (exact)
    add_full_space(ErrorSource::kAlignment, "full space: the examples as aligned against those of exact_examples",
                   {m, false}, time_step, true);
  else if (doubt.empty())
    leave(ErrorSource::kAlignment, PartStatus::kNone,
          "each pose is on the object's own mesh or comes by a map of its vertices");
  else
    leave(ErrorSource::kAlignment, PartStatus::kNotKnown, doubt + "; sources.exact_examples would tell");
  add_full_space(ErrorSource::kTargets, "full space: targets in few displacements against all poses", {m, false},
                 time_step, false);
}

void Split::plan() {
  plan_sight();
  add_reduced(ErrorSource::kBasis, fmt::format("r = {} with all tets against full space", point_.modes), true, true);
  const std::string elements = settings_.internal_force == kAllElements ? "all tets against themselves"
                               : point_.internal_force == "polynomial"
                                   ? "the polynomial against all tets"
                                   : fmt::format("s = {} elements against all tets", point_.elements);
  add_reduced(ErrorSource::kCubature, elements, false, true);
  if (examples())
    add_reduced(
        ErrorSource::kTable,
        point_.target == "solve" ? "solve by its elements against exact targets" : "the table against exact targets",
        false, false);
  else
    leave(ErrorSource::kTable, PartStatus::kNone, "the scene has no examples");
}

// Empty, or what went wrong.
std::string Split::run_missing() {
  std::vector<Job> motions;
  bool any_full = false;
  for (const Motion& motion : motions_) {
    if (read_frames(motion.file)) continue;
    any_full = true;
    motions.push_back({motion.name, [&motion] { write_frames(motion.file, motion.run()); }});
  }
  std::vector<Job> targets;  // that several motions share
  for (std::size_t i = 0; any_full && i < sights_.size(); ++i) {
    const Sight& sight = sights_[i];
    const auto same = [&](const Sight& other) {
      return other.eigenfunctions == sight.eigenfunctions && other.exact == sight.exact;
    };
    if (std::ranges::find_if(sights_, same) - sights_.begin() != static_cast<std::ptrdiff_t>(i)) continue;
    targets.push_back(
        {fmt::format("targets, m {}", sight.eigenfunctions), [this, sight] { coordinates_of(model_of(sight)); }});
  }
  for (const auto& [stage, jobs] : {std::pair("targets of error sources", &targets), {"error sources", &motions}}) {
    const auto failures = run_in_processes(stage, *jobs, input_.jobs);
    for (std::size_t i = 0; i < failures.size(); ++i)
      if (failures[i]) return fmt::format("{}: {}", (*jobs)[i].name, *failures[i]);
  }
  return "";
}

ErrorSplit Split::measure() {
  plan();
  ErrorSplit split;
  split.failure = run_missing();
  split.full_problem = full_problem_;
  if (!split.failure.empty()) return split;
  const ReducedModel data = read_bundle(bundle_file());
  const SparseMatrix mass = scalar_mass(data.object->mesh, data.object->materials.density);
  std::vector<ChainMotion> chain;
  for (const Motion& motion : motions_) {
    auto frames = read_frames(motion.file);
    if (!frames) {
      split.failure = fmt::format("{}: no sound frames", motion.file.string());
      return split;
    }
    chain.push_back({motion.source, motion.note, std::move(*frames)});
  }
  split = split_error(chain, others_, data.object->mesh.vertices, mass, input_.result.free_body);
  split.full_problem = full_problem_;
  split.no_truth = inverted_tets(data.object->mesh, chain.front().frames.positions).any();
  const bool trained = data.fidelity && data.fidelity->basis == "trained";
  split.advice = advice_on(split, {settings_.eigenfunctions, settings_.basis_size, point_.elements, settings_.time_step,
                                   trained, point_.target});
  return split;
}

// True if any example force of the point is elastic.
bool has_elastic_force(const SceneConfig& scene) {
  const Needs needs = needs_of(scene);
  return needs.target_elasticity ||
         (needs.regions && std::ranges::any_of(*needs.regions, &RegionNeeds::target_elasticity));
}

}  // namespace

void require_sources(const SourcesInput& input) {
  const SourcesConfig& sources = *input.config.sources;
  const std::string file = input.config.file.string();
  if (!input.result.has_examples) return;
  for (const PointPlan& point : input.plan.points)
    if (has_elastic_force(with_settings(input.scene, point.settings)))
      throw InputError({file, "/sources", "a study of linear example forces", "an elastic one",
                        "leave /sources out, or study the linear force alone"});
  if (sources.eigenfunctions) {
    const int least = largest_of_points(input.plan) + 1, most = most_functions(input.plan);
    if (*sources.eigenfunctions < least)
      throw InputError({file, "/sources/eigenfunctions", fmt::format("at least {}, more than any point has", least),
                        std::to_string(*sources.eigenfunctions), "twice as many are usual; leave it out for these"});
    if (*sources.eigenfunctions > most)
      throw InputError({file, "/sources/eigenfunctions",
                        fmt::format("at most {} for a mesh of {} vertices", most, input.result.vertices),
                        std::to_string(*sources.eigenfunctions), "ask for fewer"});
  }
  if (!sources.exact_examples) return;
  const AssetConfig exact = exact_asset(*sources.exact_examples);
  const auto names = [](const AssetConfig& asset) {
    std::vector<std::string> found;
    for (const ExampleConfig& example : asset.examples)
      if (!example.rest) found.push_back(example.name);
    return found;
  };
  if (names(exact) != names(input.asset))
    throw InputError({file, "/sources/exact_examples",
                      fmt::format("an asset of the same examples: {}", fmt::join(names(input.asset), ", ")),
                      fmt::format("{}", fmt::join(names(exact), ", ")), "give its examples the same names and order"});
  InputFiles files;
  require_same_object(exact, read_object(exact, files), input.plan.mesh);
  if (const std::string doubt = doubt_of(exact, files); !doubt.empty())
    throw InputError({file, "/sources/exact_examples", "an asset whose poses correspond exactly to the object", doubt,
                      "pose the object's own mesh, or give alignment.map"});
}

ErrorSplit measure_sources(const SourcesInput& input, std::size_t point) {
  ErrorSplit split;
  const PointResult& result = input.result.points[point];
  if (result.failure.empty())
    split = Split(input, point).measure();
  else
    split.failure = fmt::format("point {}: {}", point + 1, result.failure);
  split.point = point;
  return split;
}

}  // namespace exmat::precompute

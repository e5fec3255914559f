#include "precompute/pipeline/build_reduced_model.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <memory>
#include <utility>

#include "common/config/scene_needs.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/version.h"
#include "common/mesh/elements.h"
#include "common/mesh/geometry.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/contact/contact_vertices.h"
#include "precompute/cubature/cubature.h"
#include "precompute/examples/alignment_report.h"
#include "precompute/examples/example_finish.h"
#include "precompute/examples/full_space_data.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/fem/rigid_moments.h"
#include "precompute/inputs/object_size.h"
#include "precompute/modes/linear_modes.h"
#include "precompute/modes/mesh_stiffness.h"
#include "precompute/pipeline/basis_stage.h"
#include "precompute/pipeline/cubature_stage.h"
#include "precompute/pipeline/modal_training.h"
#include "precompute/pipeline/settled_poses.h"
#include "precompute/pipeline/target_elasticity_stage.h"
#include "precompute/polynomial/internal_force.h"
#include "precompute/polynomial/reduced_polynomial.h"
#include "precompute/solvers/mesh_blame.h"
#include "precompute/targets/target_space.h"
#include "precompute/training/fidelity.h"

namespace exmat::precompute {
namespace {

bool in_whole_body(const AssetConfig& asset, const ExampleConfig& example) {
  return std::ranges::none_of(asset.regions, [&](const RegionConfig& region) {
    return std::ranges::find(region.examples, example.name) != region.examples.end();
  });
}

// Those of the whole body, the rest pose among them, which is the object where no example is marked rest. None where
// every pose is of a region.
std::int64_t example_count(const AssetConfig& asset) {
  const auto poses = std::ranges::count_if(
      asset.examples, [&](const ExampleConfig& example) { return !example.rest && in_whole_body(asset, example); });
  if (asset.examples.empty() || (poses == 0 && !asset.regions.empty())) return 0;
  return 1 + poses;
}

// The set of the whole body, then the sets of the regions.
std::vector<const ExampleSet*> example_sets(const ReducedModel& model) {
  std::vector<const ExampleSet*> sets;
  if (model.examples) sets.push_back(&*model.examples);
  for (const RegionData& region : model.regions) sets.push_back(&region.examples);
  return sets;
}

std::vector<ExampleSet> copies_of(const std::vector<const ExampleSet*>& sets) {
  std::vector<ExampleSet> copies;
  for (const ExampleSet* set : sets) copies.push_back(*set);
  return copies;
}

// [r x k] the poses of all sets but the rest.
Eigen::MatrixXd example_poses(const ReducedModel& model, Eigen::Index modes) {
  Eigen::MatrixXd poses(modes, 0);
  for (const ExampleSet* set : example_sets(model))
    for (const ExampleData& example : set->examples) {
      if (example.is_rest) continue;
      poses.conservativeResize(Eigen::NoChange, poses.cols() + 1);
      poses.rightCols(1) = example.pose;
    }
  return poses;
}

// The runs to learn from, before they are run.
struct PlannedTraining {
  TrainingPlan plan;
  std::uint64_t seed = 0;
  TrainingChains chains{};
  bool in_modes = false;
  Eigen::MatrixXd responses{};  // static ones, for runs in modes
};

class Pipeline {
 public:
  Pipeline(const AssetConfig& asset, const Needs& needs, BuildReport& report, const BuildOptions& options)
      : asset_(asset), needs_(needs), report_(report), options_(options) {
    if (!options.cache.empty()) cache_ = StageCache(options.cache);
  }

  void read();
  ReducedModel run();
  const StageCache& cache() const { return cache_; }

 private:
  template <typename Work>
  auto timed(const std::string& stage, Work work) {
    return timed_stage(stage, report_, work);
  }

  void compare_with_quadratic_tets();
  ObjectData object_data() const;
  void require_modes(const ElasticSystem& system) const;
  void leave_out(const std::string& group, const std::string& reason);
  TargetSpace target_space(const ElasticSystem& system, const PoseFitter& fitter, Eigen::Index group);
  std::vector<TargetSpace> target_spaces(const ElasticSystem& system, const PoseFitter& fitter);
  std::optional<PlannedTraining> plan(const TrainingInput& input, const SemidefiniteSolver& solver, ReducedModel& body);
  std::optional<Motions> train(const BodyStages& stages, const PlannedTraining& planned, const ReducedModel& body);
  std::string loads_text() const;
  void require_vertices(const TrainingLoads& loads) const;
  void add_internal_force(ReducedModel& model);
  std::vector<bool> elastic_groups(const PoseFitter& fitter) const;
  void add_target_elasticity(const BodyStages& stages, const PoseSource& source, ReducedModel& model);
  CubatureOptions cubature_options() const {
    return {asset_.cubature_elements, asset_.cubature_tolerance, asset_.cubature_method, asset_.training_poses,
            asset_.seed};
  }
  void add_contact(ReducedModel& model);
  void settle_examples(const BodyStages& stages, ReducedModel& model);
  void add_full_space(const BodyStages& stages, ReducedModel& model);
  void add_fidelity(const BodyStages& stages, const Motions& motions, const BasisChoice& choice, ReducedModel& model);

  const AssetConfig& asset_;
  const Needs& needs_;
  BuildReport& report_;
  const BuildOptions& options_;
  std::optional<SceneConfig> own_scene_;  // that of the options, the vertices of its forces known
  const SceneConfig* scene_ = nullptr;
  StageCache cache_;
  ObjectInput object_;
  std::optional<MeshStiffness> stiffness_;
  std::optional<ExampleInput> examples_;
  std::optional<RenderData> render_;
};

ObjectData Pipeline::object_data() const {
  ObjectData data;
  data.mesh = object_.mesh;
  data.surface = surface_triangles(object_.mesh.tets);
  data.fixed = object_.fixed;
  data.materials = object_.materials;
  if (stiffness_) {
    data.stiffness_ratio = stiffness_->vibration;
    data.worst_stiffness = stiffness_->worst;
    data.thin_share = stiffness_->thin;
  }
  pack_marks(object_.marks, data);
  return data;
}

// Tells how the mesh compares with quadratic tets, in a warning where it is too stiff.
void say_stiffness(const std::string& name, Formulation formulation, const MeshStiffness& found,
                   std::vector<std::string>& warnings) {
  const std::string text = fmt::format("{}: {}", name, to_string(found));
  if (found.worst <= kTooStiff) return log::info(text);
  warn(warnings, fmt::format("{}; {}a finer mesh is softer", text,
                             formulation == Formulation::kLinear ? "object.formulation \"smoothed\" or " : ""));
}

// Says how stiff the mesh is, and makes smoothed elements as stiff as quadratic tets on it.
void Pipeline::compare_with_quadratic_tets() {
  TetMaterials& materials = object_.materials;
  stiffness_ = timed("stiffness of the mesh", [&] {
    return cache_.get(
        "stiffness of the mesh", [&] { return mesh_stiffness(object_.mesh, materials, object_.fixed, asset_.name); },
        object_.mesh, materials, object_.fixed);
  });
  if (stiffness_) materials.variance_factor = stiffness_->variance_factor;
  if (materials.formulation == Formulation::kSmoothed)
    log::info(fmt::format("elements: smoothed, beta {:.3f}", materials.variance_factor));
  if (stiffness_) return say_stiffness(asset_.name, materials.formulation, *stiffness_, report_.warnings);
  log::info(fmt::format("{}: the mesh is not compared with quadratic tets: that takes at most {} tets", asset_.name,
                        kMostComparedTets));
}

// One more than is asked for must be there, to see that none was missed.
void Pipeline::require_modes(const ElasticSystem& system) const {
  const Eigen::Index available = system.mass.rows() - system.null_space.cols();
  if (asset_.linear_modes < available) return;
  throw InputError({asset_.file.string(), "/basis/linear_modes",
                    fmt::format("at most {} for a mesh of {} vertices, {} of them fixed", available - 1,
                                object_.mesh.vertex_count(), object_.fixed.cast<int>().sum()),
                    std::to_string(asset_.linear_modes), "ask for fewer or refine the mesh"});
}

void Pipeline::leave_out(const std::string& group, const std::string& reason) {
  auto& entry = *std::ranges::find(report_.ledger, group, &LedgerEntry::group);
  entry.included = false;
  entry.reason = reason;
}

void Pipeline::add_internal_force(ReducedModel& model) {
  if (!includes(report_.ledger, "polynomial"))
    return choose_internal_force(ForceMethod::kCubature, std::nullopt, model);
  const ForceMethod asked = needs_.internal_force;
  if (asked == ForceMethod::kPolynomial || reason_against_polynomial(model, asset_.cubature_tolerance).empty())
    model.polynomial = timed("polynomial", [&] {
      return cache_.get(
          "polynomial", [&] { return reduced_polynomial(object_.mesh, object_.materials, model.modal->basis); },
          object_.mesh, object_.materials, model.modal->basis);
    });
  timed("internal force", [&] { choose_internal_force(asked, asset_.cubature_tolerance, model); });
  log::info(fmt::format("internal force: {}, {}", name_of(model.cubature->internal_force),
                        model.cubature->internal_force_reason));
  if (!model.polynomial) leave_out("polynomial", model.cubature->internal_force_reason);
}

TargetSpace Pipeline::target_space(const ElasticSystem& system, const PoseFitter& fitter, Eigen::Index group) {
  const std::string& region = fitter.region(group);
  const std::optional<RegionNeeds> needs = region.empty() ? std::nullopt : needs_of_region(needs_, region);
  const TargetSpaceOptions options{.energy_reference = needs ? needs->energy_reference : needs_.energy_reference,
                                   .tolerance = asset_.target_tolerance,
                                   .table = needs ? needs->targets : includes(report_.ledger, "targets"),
                                   .seed = asset_.seed};
  const ObjectData object = object_data();
  const PoseCoordinates range = fitter.range(group);
  return timed(region.empty() ? "targets" : fmt::format("targets of region {}", region), [&] {
    TargetSpace space = cache_.get(
        "targets", [&] { return build_target_space(object, system, range, options); }, object_.mesh, object_.materials,
        system.free_dofs, range, options);
    if (options.table) log::info(space.table_message);
    if (space.left_out > 0)
      warn(report_.warnings,
           fmt::format("{}the energies of targets leave out {} of {} elements, which a pose turns inside out",
                       region.empty() ? "" : fmt::format("region {}: ", region), space.left_out,
                       elements_of(object_.mesh, object_.materials).count()));
    return space;
  });
}

std::vector<TargetSpace> Pipeline::target_spaces(const ElasticSystem& system, const PoseFitter& fitter) {
  std::vector<TargetSpace> spaces;
  for (Eigen::Index group = 0; group < fitter.groups(); ++group) {
    spaces.push_back(target_space(system, fitter, group));
    if (fitter.region(group).empty() && includes(report_.ledger, "targets") && !spaces.back().table)
      leave_out("targets", spaces.back().table_message);
  }
  return spaces;
}

std::vector<bool> Pipeline::elastic_groups(const PoseFitter& fitter) const {
  std::vector<bool> elastic;
  for (Eigen::Index group = 0; group < fitter.groups(); ++group) {
    const std::string& region = fitter.region(group);
    elastic.push_back(region.empty() ? includes(report_.ledger, "target_elasticity")
                                     : needs_of_region(needs_, region)->target_elasticity);
  }
  return elastic;
}

void Pipeline::add_target_elasticity(const BodyStages& stages, const PoseSource& source, ReducedModel& model) {
  const auto choose = [&](const TargetElasticityInput& input) {
    return timed("elastic example force", [&] {
      return choose_target_elements(input, source, cubature_options(), *model.cubature, cache_, report_.warnings);
    });
  };
  put_target_elasticity(stages, choose, model);
}

// The scene's loads are an input: bodies are trained on them and settled under them.
std::string Pipeline::loads_text() const {
  if (scene_ == nullptr) return "";
  TrainingBody body{.free = !object_.fixed.any(), .size = 1, .angular_frequency = 1, .groups = {""}};
  for (const RegionConfig& region : asset_.regions) body.groups.push_back(region.name);
  const bool compensate = scene_->examples && scene_->examples->compensate;
  return text_of(scene_loads(*scene_, body)) + (compensate ? "compensated\n" : "");
}

void Pipeline::require_vertices(const TrainingLoads& loads) const {
  for (std::size_t i = 0; i < loads.forces.size(); ++i)
    for (const std::int64_t vertex : loads.forces[i].vertices)
      if (vertex < 0 || vertex >= object_.mesh.vertex_count())
        throw InputError({scene_->file.string(), fmt::format("/forces/{}/vertices", i),
                          fmt::format("vertices of the object, 0 to {}", object_.mesh.vertex_count() - 1),
                          std::to_string(vertex), ""});
}

// While there is a solver, since what comes next takes the memory of its factors.
std::optional<PlannedTraining> Pipeline::plan(const TrainingInput& input, const SemidefiniteSolver& solver,
                                              ReducedModel& body) {
  if (object_.skeleton && asset_.training.from == Training::kAuto) {
    log::info("training: left out, of a body on bones, which steps in all its vertices");
    return std::nullopt;
  }
  std::optional<PlannedTraining> planned({plan_training(asset_.training, scene_, object_.pushed, training_body(input)),
                                          asset_.training.seed.value_or(asset_.seed)});
  const TrainingLoads& loads = planned->plan.loads;
  log::info(fmt::format("training: {}", planned->plan.reason));
  if (!loads.deforms(!input.system.constrained())) return std::nullopt;
  require_vertices(loads);
  if (loads.obstacle)
    body.contact = contact_data(*body.object, RowMatrix::Zero(3 * object_.mesh.vertex_count(), 1), object_.contact,
                                asset_.contact_count);
  planned->chains = draw_training(input, loads, asset_.training, planned->seed);
  planned->in_modes = trains_in_modes(asset_.training.space, input.system);
  if (planned->in_modes)
    planned->responses = timed("static responses", [&] {
      return static_responses(input.system, solver, bounding_box_diagonal(object_.mesh.vertices), planned->chains.runs);
    });
  return planned;
}

std::optional<Motions> Pipeline::train(const BodyStages& stages, const PlannedTraining& planned,
                                       const ReducedModel& body) {
  const ElasticSystem& system = stages.system;
  const TrainingPlan& plan = planned.plan;
  return timed("training", [&] {
    const std::uint64_t seed = planned.seed;
    std::optional<Motions> result(std::in_place);
    Motions& motions = *result;
    motions.chains = planned.chains;
    motions.loads = plan.loads;
    motions.general = plan.general;
    motions.reason = plan.reason;
    motions.chains.options.budget = options_.training_budget;
    const auto cached = [&](const char* stage, const auto& work) {
      // A budget cuts each run elsewhere: results within one are not kept.
      if (options_.training_budget > 0) return work();
      return cache_.get(stage, work, object_.mesh, object_.materials, system.free_dofs, stages.targets,
                        copies_of(example_sets(body)), object_.contact, asset_.contact_count, text_of(plan.loads),
                        asset_.training.segments, asset_.training.seconds, seed,
                        planned.in_modes ? asset_.linear_modes : 0);
    };
    if (planned.in_modes)
      std::tie(motions.set, motions.elements) = cached("training in modes", [&] {
        const ManyModes modes = many_modes(stages, body, planned.responses, plan.loads.obstacle.has_value(), seed);
        return std::pair(run_training(modes, system, motions.chains), *modes.model.cubature);
      });
    else
      motions.set = cached("training", [&] {
        return run_training({body, system, stages.modes}, stages.targets, motions.chains);
      });
    const TrainingRuns& runs = motions.set.runs;
    log::info(fmt::format(
        "training: {} runs of {} steps in {}, {} snapshots", runs.segments, runs.steps,
        motions.elements ? fmt::format("many modes, {} elements", motions.elements->elements.size()) : "full space",
        runs.snapshots.cols()));
    if (runs.skipped > 0)
      warn(report_.warnings,
           fmt::format("training: {} of {} runs were left out, {}since they did not stay finite; {}", runs.skipped,
                       runs.skipped + runs.segments, options_.training_budget > 0 ? "by --training-budget or " : "",
                       "are the loads of the asset, or of the scene, too large?"));
    constexpr double kMoved = 1e-12;  // of the body's size: less is rounding
    const double least = kMoved * bounding_box_diagonal(object_.mesh.vertices);
    const double moved = runs.snapshots.size() > 0 ? runs.snapshots.cwiseAbs().maxCoeff() : 0;
    if (runs.snapshots.cols() > 0 && !(moved > least))
      warn(report_.warnings,
           "training: the loads move no vertex, so the basis is that of linear modes; do they act on vertices that are "
           "free to move?");
    else if (const Eigen::Index own = motions.own_columns();
             own > 0 && !(runs.snapshots.leftCols(own).cwiseAbs().maxCoeff() > least))
      warn(report_.warnings,
           "training: the scene itself moves no vertex; do its forces act within its steps, and do they not cancel?");
    if (!(moved > least)) result.reset();
    return result;
  });
}

void Pipeline::add_contact(ReducedModel& model) {
  if (!includes(report_.ledger, "contact")) return;
  model.contact = timed("contact", [&] {
    return contact_data(*model.object, model.modal->basis, object_.contact, asset_.contact_count);
  });
  if (model.contact->areas.size() == 0)
    throw InputError(
        {asset_.file.string(), "/contact/vertices", "vertices of the surface, some of them not fixed", "none", ""});
  log::info(contact_summary(*model.object, object_.contact, *model.contact));
}

void Pipeline::add_fidelity(const BodyStages& stages, const Motions& motions, const BasisChoice& choice,
                            ReducedModel& model) {
  model.fidelity = timed("fidelity", [&] {
    ReducedModel whole = model;  // of a body that is thrown, even where the bundle is not to hold what that takes
    if (!whole.rigid && !stages.system.constrained())
      whole.rigid = rigid_moments(object_.mesh, object_.materials.density, model.modal->basis);
    const RollOut run = final_roll_out(stages, whole, motions);
    return fidelity_of({whole, run, choice.exact, choice.modal, motions.set.runs, motions.set.heldout, choice.trained,
                        motions.reason, motions.chains,
                        motions.elements ? TrainingSpace::kModes : TrainingSpace::kFullSpace});
  });
  auto& entry = *std::ranges::find(report_.ledger, "fidelity", &LedgerEntry::group);
  entry.included = true;
  entry.reason = "runs to compare with";
  const FidelityData& found = *model.fidelity;
  log::info(fmt::format("fidelity: {:.2f} % from {} in {} held-out runs, {:.2f} % of modes alone; {}",
                        100 * found.shape_error, motions.elements ? "a body of many modes" : "the full space",
                        found.heldout_runs, 100 * found.modal_error, found.advice));
  if (const std::string warning = warning_of(found); !warning.empty()) warn(report_.warnings, warning);
}

void Pipeline::settle_examples(const BodyStages& stages, ReducedModel& model) {
  std::optional<SettlingLoad> load;
  if (scene_ != nullptr) {
    TrainingBody body{.free = !stages.system.constrained(), .size = 1, .angular_frequency = 1};
    for (Eigen::Index group = 0; group < stages.fitter->groups(); ++group)
      body.groups.push_back(stages.fitter->region(group));
    const TrainingLoads loads = scene_loads(*scene_, body);
    load = {scene_->file.string(), loads.examples, loads.gravity, scene_->examples && scene_->examples->compensate};
  }
  const auto found = timed("settled poses", [&] { return precompute::settle_examples(stages, load, model); });
  for (const SettledPose& pose : found) {
    const std::string text = fmt::format("example {}", to_string(pose, model));
    if (pose.settles && pose.error() <= kFarFromPose)
      log::info(text);
    else
      warn(report_.warnings, text);
  }
}

void Pipeline::add_full_space(const BodyStages& stages, ReducedModel& model) {
  auto region = model.regions.begin();
  for (Eigen::Index group = 0; group < stages.fitter->groups(); ++group) {
    const std::string& name = stages.fitter->region(group);
    const bool whole = name.empty();
    const bool wanted =
        whole ? includes(report_.ledger, "full_space") : object_.skeleton || needs_of_region(needs_, name)->full_space;
    std::optional<FullSpaceData>& data = whole ? model.full_space : region->full_space;
    const auto at = static_cast<std::size_t>(group);
    if (wanted)
      data = full_space_data(model, stages.system, stages.fitter->view(group),
                             whole ? *model.examples : region->examples, stages.targets[at], stages.elastic[at]);
    if (!whole) ++region;
  }
}

std::string generator() { return fmt::format("exmat-precompute {}", version()); }

void Pipeline::read() {
  if (needs_.internal_force == ForceMethod::kPolynomial)
    require_polynomial(asset_.material.model, asset_.basis_size.value_or(kBasisSize));
  object_ = timed("reading the object", [&] { return read_object(asset_, report_.inputs, cache_); });
  if (options_.scene != nullptr) {
    own_scene_ = *options_.scene;
    own_scene_->forces = forces_on_vertices(*own_scene_, {.points = object_.mesh.vertices,
                                                          .marks = object_.surface ? &object_.marks : nullptr,
                                                          .surface = asset_.object_mesh.string()});
    scene_ = &*own_scene_;
  }
  if (object_.skeleton && scene_ != nullptr && !(asset_.clamp_follows && object_.skeleton->bones.size() == 1))
    require_uncompensated(*scene_);
  warn_of_size(object_, asset_.object_mesh.string(), report_.warnings);
  std::ranges::copy(object_.warnings, std::back_inserter(report_.warnings));
  require_regions(asset_, needs_);
  report_.ledger = plan_groups(needs_, object_.fixed.any(), example_count(asset_), std::ssize(asset_.regions),
                               asset_.render_mesh.has_value(), object_.skeleton.has_value());
  if (includes(report_.ledger, "shape_space")) {
    examples_ = timed("reading the examples", [&] { return read_examples(asset_, object_, report_.inputs, cache_); });
    keep_needed(needs_, includes(report_.ledger, "examples"), *examples_);
  }

  if (includes(report_.ledger, "render"))
    render_ = timed("render mesh", [&] { return read_render_mesh(asset_, object_, report_.inputs, report_.warnings); });
  report_.input_sha256 = hash_inputs(report_.inputs, generator() + "\n" + text_of(needs_) + loads_text() +
                                                         (asset_.clamp_follows ? "its clamp follows\n" : ""));
}

ReducedModel Pipeline::run() {
  read();
  compare_with_quadratic_tets();
  ReducedModel model;
  model.render = std::move(render_);
  model.skeleton = object_.skeleton;
  model.asset_name = asset_.name;
  model.generator = generator();
  model.input_sha256 = report_.input_sha256;
  model.object = object_data();

  std::optional<ShapeStage> shape;
  if (examples_)
    shape = timed("shape space and examples",
                  [&] { return build_shape_stage(asset_, object_, *examples_, cache_, report_.warnings); });
  if (shape && asset_.clamp_follows) {
    const Eigen::MatrixXd& shifts = shape->groups.front().shifts;
    const Eigen::Index vertices = object_.mesh.vertex_count();
    model.skeleton->shifts.setZero((1 + shifts.cols()) * vertices, 3);
    for (Eigen::Index k = 0; k < shifts.cols(); ++k)
      model.skeleton->shifts.middleRows((1 + k) * vertices, vertices) =
          shifts.col(k).reshaped<Eigen::RowMajor>(vertices, 3);
  }
  if (shape && !options_.alignment_report.empty())
    write_alignment_report(asset_.name, object_.mesh, *examples_, *shape, options_.alignment_report);
  if (shape) require_aligned(asset_, shape->alignments, report_.warnings);

  const auto system =
      timed("assembly", [&] { return build_elastic_system(object_.mesh, object_.materials, object_.fixed); });
  require_modes(system);
  const auto blamed = [&](auto work) { return with_mesh_blamed(object_.mesh, asset_.name, work); };
  auto solver = timed("factorisation", [&] {
    return blamed([&] {
      return std::make_unique<SemidefiniteSolver>(system.stiffness, system.mass * system.null_space,
                                                  asset_.name + ": elastic stiffness", system.rigid);
    });
  });
  log::info(system.constrained() ? fmt::format("constrained body: {} fixed vertices", object_.fixed.cast<int>().sum())
                                 : "free body: six rigid modes found and excluded");
  const auto modes = timed("linear modes", [&] {
    return cache_.get(
        "linear modes", [&] { return blamed([&] { return linear_modes(system, *solver, asset_.linear_modes); }); },
        system.mass, system.stiffness, system.null_space, asset_.linear_modes);
  });
  const auto derivatives = timed("modal derivatives", [&] {
    return cache_.get(
        "modal derivatives",
        [&] { return modal_derivatives(object_.mesh, object_.materials, system, *solver, modes.modes); }, object_.mesh,
        object_.materials, system.free_dofs, modes.modes);
  });

  const double size = bounding_box_diagonal(object_.mesh.vertices);
  ReducedModel body;
  body.asset_name = model.asset_name;
  body.object = model.object;
  if (shape) preview_examples(*shape, body);
  const std::optional<PlannedTraining> planned = plan({body, system, modes}, *solver, body);
  // Factors are the most of the memory: none longer than needed.
  if (!shape || !shape->has_regions()) solver.reset();
  std::optional<PoseFitter> fitter;
  if (shape)
    timed("poses of the examples", [&] {
      // As fine as the linear modes resolve.
      fitter.emplace(asset_, object_, system, std::move(solver), modes.eigenvalues.tail(1)[0], *shape);
    });
  std::vector<TargetSpace> targets;
  if (fitter) targets = target_spaces(system, *fitter);
  const BodyStages stages{asset_,      object_,
                          system,      modes,
                          derivatives, fitter ? &*fitter : nullptr,
                          targets,     fitter ? elastic_groups(*fitter) : std::vector<bool>()};
  std::optional<Motions> motions;
  if (planned) motions = train(stages, *planned, body);
  const BasisChoice choice = timed("basis", [&] { return choose_basis(stages, body, motions ? &*motions : nullptr); });
  const Eigen::MatrixXd& basis = choice.basis;
  put_basis(stages, basis, model);
  if (fitter) fitter->log_losses(model, report_.warnings);

  auto source = pose_source(system, modes, derivatives, basis, size, example_poses(model, basis.cols()));
  if (motions)
    set_motions(motions->set.runs.snapshots, motions->own_columns(), motions->set.heldout.snapshots, system, basis,
                source);
  model.cubature = timed("cubature", [&] {
    const bool judged = motions && needs_.internal_force != ForceMethod::kPolynomial;
    return choose_cubature(stages, source, cubature_options(), model, judged ? &*motions : nullptr, cache_);
  });
  log::info(fmt::format("cubature: {} elements, held-out errors: force {:.2f} %, energy {:.2f} %, stiffness {:.2f} %",
                        model.cubature->elements.size(), 100 * model.cubature->heldout_error,
                        100 * model.cubature->heldout_energy_error, 100 * model.cubature->heldout_stiffness_error));
  add_target_elasticity(stages, source, model);
  add_internal_force(model);
  if (includes(report_.ledger, "rigid"))
    model.rigid = timed("rigid moments",
                        [&] { return rigid_moments(object_.mesh, object_.materials.density, model.modal->basis); });
  add_contact(model);
  if (motions) add_fidelity(stages, *motions, choice, model);
  if (fitter) add_full_space(stages, model);
  if (fitter) settle_examples(stages, model);
  return model;
}

// Names the asset's file in errors of the numerical stages: they refuse a member of it and do not know the file.
template <typename Work>
auto with_file_named(const AssetConfig& asset, Work work) {
  try {
    return work();
  } catch (const InputError& error) {
    Complaint complaint = error.complaint();
    if (complaint.file.empty()) complaint.file = asset.file.string();
    throw InputError(std::move(complaint));
  }
}

}  // namespace

ReducedModel build_reduced_model(const AssetConfig& asset, const Needs& needs, BuildReport& report,
                                 const BuildOptions& options) {
  report.inputs.push_back(asset.file);
  return with_file_named(asset, [&] {
    Pipeline pipeline(asset, needs, report, options);
    ReducedModel model = pipeline.run();
    report.cache = pipeline.cache().uses();
    return model;
  });
}

void read_inputs(const AssetConfig& asset, const Needs& needs, BuildReport& report, const BuildOptions& options) {
  report.inputs.push_back(asset.file);
  with_file_named(asset, [&] { Pipeline(asset, needs, report, options).read(); });
}

std::vector<AlignmentOutcome> check_inputs(const AssetConfig& asset, const std::filesystem::path& alignment_folder,
                                           BuildReport& report) {
  report.inputs.push_back(asset.file);
  const auto object = read_object(asset, report.inputs);
  warn_of_size(object, asset.object_mesh.string(), report.warnings);
  std::ranges::copy(object.warnings, std::back_inserter(report.warnings));
  if (asset.render_mesh) read_render_mesh(asset, object, report.inputs, report.warnings);
  if (const auto found = mesh_stiffness(object.mesh, object.materials, object.fixed, asset.name))
    say_stiffness(asset.name, object.materials.formulation, *found, report.warnings);
  if (asset.examples.empty()) return {};
  const auto input = read_examples(asset, object, report.inputs);
  StageCache no_cache;
  const ShapeStage stage =
      with_file_named(asset, [&] { return build_shape_stage(asset, object, input, no_cache, report.warnings); });
  if (!alignment_folder.empty()) write_alignment_report(asset.name, object.mesh, input, stage, alignment_folder);
  return stage.alignments;
}

}  // namespace exmat::precompute

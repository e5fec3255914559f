#include "runtime/scene/scene_loader.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <string_view>
#include <utility>

#include "common/bundle/scene_places.h"
#include "common/config/scene_needs.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/nearest_name.h"
#include "runtime/scene/attachment_loader.h"
#include "runtime/scene/keyed_settings.h"
#include "runtime/scene/obstacle_loader.h"
#include "runtime/scene/reach_loader.h"
#include "runtime/sim/lanes/lane_step.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {
namespace {

void check_examples(const SceneConfig& config, const BundleSummary& summary) {
  const std::string bundle = config.bundle.string();
  if (config.examples && summary.examples == 0)
    throw InputError({bundle, "/examples", "this group, since the scene asks for an example force", "none",
                      "precompute the asset with its examples, or drop \"examples\" from " + config.file.string()});
}

void check_regions(const SceneConfig& config, const BundleSummary& summary) {
  std::string names;
  for (const RegionSummary& region : summary.regions)
    names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", region.name);
  for (std::size_t i = 0; i < config.regions.size(); ++i) {
    const std::string& name = config.regions[i].name;
    if (std::ranges::find(summary.regions, name, &RegionSummary::name) != summary.regions.end()) continue;
    throw InputError(
        {config.file.string(), fmt::format("{}/regions/{}/name", config.place, i),
         fmt::format("a region of {}; {}", config.bundle.string(), names.empty() ? "it has none" : "it has " + names),
         '"' + name + '"', "name regions in the asset and precompute it again"});
  }
}

/// A table of targets where the scene insists on one. `owner` is the member of the scene, `group` that of the bundle.
void check_table(const SceneConfig& config, const ExampleForceConfig& force, const std::string& owner,
                 const std::string& group, bool has_targets, EnergyReference energy_reference) {
  if (force.target != TargetSource::kTable) return;
  const std::string bundle = config.bundle.string();
  const std::string advice =
      fmt::format("precompute the asset with this scene (--scene), or let the scene's {}.target say \"auto\"", owner);
  if (!has_targets)
    throw InputError({bundle, group, "this group, since the scene asks for a table of targets", "none", advice});
  if (energy_reference != force.energy_reference)
    throw InputError({bundle, group, fmt::format("targets of energy_reference \"{}\"", name_of(force.energy_reference)),
                      fmt::format("\"{}\"", name_of(energy_reference)), advice});
}

void check_methods(const SceneConfig& config, const BundleSummary& summary) {
  const std::string bundle = config.bundle.string();
  if (config.internal_force == ForceMethod::kPolynomial && !summary.has_polynomial)
    throw InputError({bundle, "/polynomial", "this group, since the scene asks for it by internal_force", "none",
                      "precompute the asset with internal_force \"polynomial\", or let the scene say \"auto\""});
  if (config.examples) {
    check_table(config, *config.examples, "examples", "/targets", summary.has_targets, summary.energy_reference);
  }
  for (std::size_t i = 0; i < config.regions.size(); ++i) {
    const auto& [name, force] = config.regions[i];
    const RegionSummary& region = *std::ranges::find(summary.regions, name, &RegionSummary::name);
    check_table(config, force, fmt::format("regions[{}]", i), fmt::format("/regions/{}/targets", name),
                region.has_targets, region.energy_reference);
  }
}

void check_render(const SceneConfig& config, const BundleSummary& summary) {
  if (!config.render || !config.trajectory || summary.render_vertices > 0) return;
  throw InputError({config.bundle.string(), "/render", "this group, since the scene asks for output.render", "none",
                    "name object.render_mesh in the asset and precompute it again, or drop \"render\" from " +
                        config.file.string()});
}

void check_force_vertices(const SceneConfig& config, const std::vector<VertexForceConfig>& forces,
                          const BundleSummary& summary) {
  for (std::size_t i = 0; i < forces.size(); ++i)
    for (const std::int64_t vertex : forces[i].vertices)
      if (vertex < 0 || vertex >= summary.vertices)
        throw InputError({config.file.string(), fmt::format("{}/forces/{}/vertices", config.place, i),
                          fmt::format("vertices of the object, 0 to {} (0-based)", summary.vertices - 1),
                          std::to_string(vertex), ""});
}

void count_bytes(const std::vector<ReadRecord>& records, std::vector<LedgerEntry>& ledger) {
  for (LedgerEntry& entry : ledger) {
    const std::string folder = fmt::format("/{}/", entry.group);
    for (const ReadRecord& record : records)
      if (record.dataset.starts_with(folder)) entry.bytes += record.bytes;
    if (!entry.included || entry.bytes > 0) continue;
    entry.included = false;
    entry.reason = "not needed to step";
  }
}

RowMatrix basis_rows(const SceneConfig& config, const VertexForceConfig& force, LoadedScene& loaded) {
  const RowMatrix& basis = loaded.data.modal->basis;
  if (basis.rows() == 0) return read_basis_rows(bundle_of(config), force.vertices, &loaded.records);
  RowMatrix rows(3 * force.vertices.size(), basis.cols());
  for (std::size_t i = 0; i < force.vertices.size(); ++i)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = basis.middleRows<3>(3 * force.vertices[i]);
  return rows;
}

ScriptedForce scripted_force_of(const SceneConfig& config, const VertexForceConfig& force, LoadedScene& loaded) {
  const RowMatrix rows = basis_rows(config, force, loaded);
  VertexArray positions;
  if (loaded.model->frame->moves()) {
    positions.resize(std::ssize(force.vertices), 3);
    for (std::size_t i = 0; i < force.vertices.size(); ++i)
      positions.row(static_cast<Eigen::Index>(i)) = loaded.data.object->mesh.vertices.row(force.vertices[i]);
  }
  ScriptedForce scripted = runtime::scripted_force(*loaded.model, rows, positions, force.force);
  if (loaded.full) {
    scripted.on_vertices = Eigen::VectorXd::Zero(loaded.full->space.size());
    for (const std::int64_t vertex : force.vertices)
      if (const std::int32_t number = loaded.full->space.number(vertex); number >= 0)
        scripted.on_vertices.segment<3>(3 * number) += force.force;
  }
  scripted.start = force.start;
  scripted.end = force.end;
  return scripted;
}

/// Advice where a name is none of these.
std::string known_names(const std::string& name, const std::vector<std::string>& known) {
  const std::string nearest = nearest_name(name, known);
  return nearest.empty() ? fmt::format("it has \"{}\"", fmt::join(known, "\", \""))
                         : fmt::format("did you mean \"{}\"?", nearest);
}

/// A joint of the body's skeleton by its name.
std::size_t find_joint(const SceneConfig& config, const LoadedScene& loaded, const std::string& name,
                       const std::string& place) {
  const std::string file = config.file.string(), bundle = config.bundle.string();
  const Skeleton* const skeleton = loaded.model->skeleton.get();
  if (skeleton == nullptr)
    throw InputError({file, place, "a bundle of a body with bones", bundle + ", which has none", ""});
  const std::vector<std::string>& names = skeleton->names();
  const auto found = std::ranges::find(names, name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  throw InputError({file, place, "a joint of " + bundle, fmt::format("\"{}\"", name), known_names(name, names)});
}

/// The motion of the bones that the scene asks for, if any.
std::optional<BonePlay> bone_play(const SceneConfig& config, const LoadedScene& loaded) {
  const BodyConfig& body = config.body;
  if (!body.animation && body.bones.empty()) return std::nullopt;
  BonePlay play;
  if (const auto& animation = body.animation)
    play = {loaded.model->skeleton->find_animation(animation->name), animation->speed, animation->start,
            animation->loop};
  for (std::size_t i = 0; i < body.bones.size(); ++i) {
    const std::size_t bone =
        find_joint(config, loaded, body.bones[i].joint, fmt::format("{}/body/bones/{}/joint", config.place, i));
    play.add_keys(*loaded.model->skeleton, bone, make_motion(body.bones[i].motion));
  }
  if (loaded.model->skeleton) play.bound = loaded.model->skeleton->bound();
  return play;
}

/// The drivers of the examples of the whole body.
std::vector<ExampleDriver> example_drivers(const SceneConfig& config, const LoadedScene& loaded) {
  std::vector<ExampleDriver> drivers;
  if (!config.examples || config.examples->drivers.empty()) return drivers;
  std::vector<std::string> names;  // but for the rest pose, which is the first
  for (const ExampleData& example : loaded.data.examples->examples) names.push_back(example.name);
  names.erase(names.begin());
  for (const DriverConfig& own : config.examples->drivers) {
    const std::string place = fmt::format("{}/examples/drivers/{}", config.place, drivers.size());
    const auto found = std::ranges::find(names, own.example);
    if (found == names.end())
      throw InputError({config.file.string(), place + "/example",
                        fmt::format("an example of {} other than the rest pose", config.bundle.string()),
                        fmt::format("\"{}\"", own.example), known_names(own.example, names)});
    drivers.push_back({1 + (found - names.begin()), find_joint(config, loaded, own.joint, place + "/joint"), own.axis,
                       own.angles, own.rotation, own.radius});
  }
  return drivers;
}

ExampleSettings example_settings(const ExampleForceConfig& config) {
  ExampleSettings settings{config.stiffness, config.damping, config.bias, config.target_iterations,
                           config.law == ExampleForceLaw::kElastic};
  if (config.weights) settings.given_weights = *config.weights;
  return settings;
}

StepScene step_scene(const SceneConfig& config, const Obstacles& obstacles, LoadedScene& loaded) {
  StepScene scene;
  scene.time_step = config.time_step;
  scene.integrator = config.integrator;
  scene.mass_damping = config.mass_damping;
  scene.stiffness_damping = config.stiffness_damping;
  scene.newton = {config.newton.max_iterations, config.newton.tolerance};
  scene.precision = config.precision;
  scene.sleep = {config.sleep.energy, config.sleep.time};
  scene.space = {config.space.space,
                 config.space.release,
                 /*contact=*/!loaded.summary.knows_scene || config.meets_others,
                 /*forces=*/!loaded.summary.knows_scene,
                 {config.space.newton.max_iterations, config.space.newton.tolerance}};
  scene.meeting = config.meeting;
  scene.obstacles = obstacles_of(config.meeting, obstacles);
  if (loaded.model->skeleton) {
    if (config.space.space == Space::kAuto)
      log::warning(
          fmt::format("{}, {}/space: \"auto\": a body on bones, or whose clamp follows examples, steps in all "
                      "its vertices in every step; \"full\" says so",
                      config.file.string(), config.place));
    scene.space.space = Space::kFull;
  }
  scene.animation = bone_play(config, loaded);
  if (!config.body.motion.empty()) scene.carrier = make_motion(config.body.motion);
  scene.gravity = config.gravity;
  scene.gravity_force = gravity_force(*loaded.model, config.gravity);
  for (const VertexForceConfig& force : loaded.forces) scene.forces.push_back(scripted_force_of(config, force, loaded));
  if (config.examples) scene.examples.push_back(example_settings(*config.examples));
  if (config.examples) scene.examples.front().drivers = example_drivers(config, loaded);
  for (const RegionForceConfig& region : config.regions) scene.examples.push_back(example_settings(region.force));
  return scene;
}

State start_state(const SceneConfig& config, const LoadedScene& loaded) {
  const Eigen::Index modes = loaded.model->modes();
  State state = make_state(*loaded.model, start_coordinates(config, loaded.data, modes), Eigen::VectorXd::Zero(modes));
  prepare_contacts(*loaded.model, loaded.scene.obstacles.size(), state);
  if (loaded.full) prepare_full(*loaded.full, state);
  if (loaded.model->skeleton) {
    enter_full_space(*loaded.full, *loaded.model, state);
    BonePoses bones = loaded.model->skeleton->bound();
    if (loaded.scene.animation) loaded.scene.animation->sample(0, bones);
    put_on_bones(*loaded.full, bones, state);
  }
  const BodyFrame& frame = *loaded.model->frame;
  FrameWorkspace workspace = frame.make_workspace();
  frame.follow(loaded.scene, state.time, state.q, state.v, workspace, state.frame);
  FrameMotion motion;
  motion.position = config.body.position.value_or(motion.position);
  motion.orientation = config.body.orientation.value_or(motion.orientation);
  motion.linear_velocity = config.body.linear_velocity.value_or(motion.linear_velocity);
  motion.angular_velocity = config.body.angular_velocity.value_or(motion.angular_velocity);
  frame.set_motion(motion, state.q, state.v, workspace, state.frame);
  return state;
}

std::vector<std::vector<NamedPose>> named_poses(const LoadedScene& loaded) {
  std::vector<std::vector<NamedPose>> all;
  for (const ExampleModel& force : loaded.model->examples) {
    const auto region = std::ranges::find(loaded.data.regions, force.region, &RegionData::name);
    const ExampleSet& set = force.region.empty() ? *loaded.data.examples : region->examples;
    std::vector<NamedPose>& poses = all.emplace_back();
    for (const ExampleData& example : set.examples) poses.push_back({example.name, example.pose});
  }
  return all;
}

void check_weights(const SceneConfig& config, const Model& model) {
  std::vector<Eigen::Index> examples;
  for (const ExampleModel& own : model.examples) examples.push_back(own.weights.examples());
  require_weights(config, examples);
}

// Targets that make up for one stiffness and gravity are wrong with others.
void check_compensation(const SceneConfig& config, const ReducedModel& data) {
  if (!config.examples || !data.targets) return;
  const double stiffness = data.targets->compensated_stiffness;
  if (data.skeleton && !data.skeleton->is_clamp()) require_uncompensated(config);
  if (config.examples->compensate && stiffness == 0)
    throw InputError({config.file.string(), "/examples/compensate", "a bundle that was made for this scene",
                      config.bundle.string() + ", whose targets are not compensated",
                      "make it again: exmat-precompute bundle ASSET --scene " + config.file.string()});
  const Eigen::Vector3d& gravity = data.targets->compensated_gravity;
  if (stiffness == 0 || (config.examples->stiffness == stiffness && config.gravity == gravity)) return;
  log::warning(
      fmt::format("{}: its targets are compensated for a stiffness of {:g} 1/s^2 and gravity of ({:g}, {:g}, {:g}) "
                  "m/s^2; with those of the scene the body settles beside its poses",
                  config.bundle.string(), stiffness, gravity[0], gravity[1], gravity[2]));
}

std::unique_ptr<const Model> prepare(const SceneConfig& config, const ReducedModel& data) {
  ModelOptions options;
  options.examples = config.examples.has_value();
  options.target_table = data.targets.has_value();
  options.polynomial = data.polynomial.has_value();
  options.carried = !config.body.motion.empty();
  if (config.examples) options.energy_reference = config.examples->energy_reference;
  options.elastic = config.examples && config.examples->law == ExampleForceLaw::kElastic;
  for (const auto& [name, force] : config.regions)
    options.regions.push_back({name, std::ranges::find(data.regions, name, &RegionData::name)->targets.has_value(),
                               force.law == ExampleForceLaw::kElastic, force.energy_reference});
  ModelResult result = build_model(data, options);
  if (result.model) return std::move(result.model);
  result.complaint.file = config.bundle.string();
  throw InputError(std::move(result.complaint));
}

void check_animation(const SceneConfig& config, const LoadedScene& loaded) {
  if (!config.body.animation) return;
  const std::string place = config.place + "/body/animation";
  const Skeleton* skeleton = loaded.model->skeleton.get();
  if (skeleton == nullptr)
    throw InputError({config.file.string(), place, "a bundle of a body with bones",
                      config.bundle.string() + ", which has none", ""});
  if (skeleton->find_animation(config.body.animation->name) != nullptr) return;
  std::vector<std::string> names;
  for (const BoneAnimation& animation : skeleton->animations()) names.push_back(animation.name());
  throw InputError(
      {config.file.string(), place + "/name",
       names.empty() ? "no animation, since the bundle has none" : fmt::format("\"{}\"", fmt::join(names, "\" or \"")),
       fmt::format("\"{}\"", config.body.animation->name), ""});
}

std::unique_ptr<const FullModel> prepare_full_space(const SceneConfig& config, const LoadedScene& loaded) {
  FullModelResult result = build_full_model(loaded.data, *loaded.model);
  if (result.model) return std::move(result.model);
  result.complaint.file = config.bundle.string();
  throw InputError(std::move(result.complaint));
}

void check_full_space(const SceneConfig& config, const LoadedScene& loaded) {
  const char* const reason = unsupported(*loaded.full, loaded.scene);
  if (reason != nullptr && loaded.model->skeleton)
    throw InputError({config.file.string(), config.place.empty() ? "/" : config.place,
                      "what a body on bones, or whose clamp follows examples, can do, which steps in all its vertices",
                      reason, "leave it out"});
  if (reason != nullptr)
    throw InputError({config.file.string(), config.place + "/space",
                      std::string("\"reduced\", where a scene has ") + reason,
                      fmt::format("\"{}\"", name_of(config.space.space)), ""});
}

std::string describe_target(const ExampleModel& examples, const ExampleSettings& settings) {
  if (examples.table && examples.table->is_of_pairs())
    return fmt::format("target: table, terms of one and two examples, {} control points", examples.table->piece_rows());
  if (examples.table)
    return fmt::format(
        "target: table, {} of degree {}",
        examples.table->pieces() == 1 ? "one polynomial" : fmt::format("{} pieces", examples.table->pieces()),
        examples.table->degree());
  return fmt::format("target: Newton in d = {} coordinates, s = {} elements, at most {} iterations a step",
                     examples.target->dimension(), examples.target->elements(), settings.target_iterations);
}

std::string describe_bones(const std::optional<BonePlay>& play) {
  if (!play) return "which stay where they were bound";
  std::string words = play->animation != nullptr ? fmt::format("moved by \"{}\"", play->animation->name()) : "";
  if (!play->keys.empty())
    words += fmt::format("{}keys of {} joints", words.empty() ? "moved by " : " and ", play->keys.size());
  return words;
}

void describe_examples(const ExampleModel& examples, const ExampleSettings& settings, bool reaches,
                       std::vector<std::string>& plan) {
  const std::string owner = examples.region.empty() ? "" : fmt::format("region {}: ", examples.region);
  if (!acts(settings)) {
    plan.push_back(owner + "weights, target, example_force: left out, stiffness and damping are 0");
    return;
  }
  const Eigen::Index modes = examples.filter.rows();
  plan.push_back(
      owner +
      (settings.given_weights.size() > 0 ? fmt::format("weights: K = {} examples, given", examples.weights.examples())
       : reaches
           ? fmt::format("weights: K = {} examples, chosen in each step to reach a place", examples.weights.examples())
       : is_driven(settings)
           ? fmt::format("weights: K = {} examples, by {} joints", examples.weights.examples(), settings.drivers.size())
           : fmt::format("weights: K = {} examples, bias {:g}", examples.weights.examples(), settings.bias)));
  plan.push_back(owner + describe_target(examples, settings));
  if (settings.elastic)
    plan.push_back(owner + fmt::format("example_force: elastic, s = {} elements", examples.elasticity->elements()));
  if (!is_filtered(settings)) return;
  plan.push_back(owner + fmt::format("{}: linear, symmetric filter of {} x {}",
                                     settings.elastic ? "damping of the example_force" : "example_force", modes,
                                     modes));
}

}  // namespace

BundleInput bundle_of(const SceneConfig& config) { return {config.bundle, config.pack}; }

LoadedScene load_run(const SceneConfig& config, const Obstacles* obstacles) {
  require_files(config);
  LoadedScene loaded;
  loaded.summary = summarise_bundle(bundle_of(config));
  check_body(config, loaded.summary.constrained);
  check_examples(config, loaded.summary);
  check_regions(config, loaded.summary);
  check_methods(config, loaded.summary);
  loaded.forces = forces_on_vertices(config);
  check_force_vertices(config, loaded.forces, loaded.summary);
  check_render(config, loaded.summary);
  Needs needs = fit_needs(needs_of(config), loaded.summary);
  needs.render = needs.render && config.trajectory;
  // A body on bones steps in all its vertices.
  const bool on_bones = loaded.summary.bones > 0;
  loaded.ledger = plan_groups(needs, loaded.summary.constrained, loaded.summary.examples,
                              std::ssize(loaded.summary.regions), loaded.summary.render_vertices > 0, on_bones);
  // A force on a body that moves needs to know where it acts.
  const bool moves = !loaded.summary.constrained || !config.body.motion.empty();
  const bool steps_in_full = on_bones || config.space.space != Space::kReduced;
  const bool positions = config.trajectory || config.meets_bodies || (moves && !config.forces.empty());
  const BundleRequest request{loaded.ledger, needs.regions, /*step_only=*/true, positions, steps_in_full};
  loaded.data = read_bundle(bundle_of(config), request, &loaded.records);
  check_compensation(config, loaded.data);
  loaded.model = prepare(config, loaded.data);
  if (steps_in_full) loaded.full = prepare_full_space(config, loaded);
  check_weights(config, *loaded.model);
  loaded.keys = make_keys(config);
  check_animation(config, loaded);
  const Obstacles all = obstacles != nullptr ? *obstacles : make_obstacles(config.obstacles);
  loaded.scene = step_scene(config, all, loaded);
  if (steps_in_full) check_full_space(config, loaded);
  loaded.start = start_state(config, loaded);
  if (!config.attachments.empty() || config.reach) {
    const BundleRequest whole{.groups = {{"object", true, 0, "the scene holds or moves vertices of it"}}};
    const ObjectData object = *read_bundle(bundle_of(config), whole, &loaded.records).object;
    loaded.attachments = load_attachments(config, object, all, loaded);
    if (config.reach) loaded.reach = load_reach(config, object, loaded);
  }
  count_bytes(loaded.records, loaded.ledger);
  loaded.poses = named_poses(loaded);
  loaded.element_weights = loaded.data.cubature->weights;
  // The model holds its own, prepared for stepping.
  loaded.data.cubature.reset();
  loaded.data.examples.reset();
  loaded.data.projection.reset();
  loaded.data.polynomial.reset();
  loaded.data.targets.reset();
  loaded.data.target_space.reset();
  loaded.data.target_elasticity.reset();
  loaded.data.full_space.reset();
  loaded.data.contact.reset();
  loaded.data.regions.clear();
  return loaded;
}

std::vector<std::string> describe_plan(const LoadedScene& loaded, const SceneConfig& config) {
  const Model& model = *loaded.model;
  const StepScene& scene = loaded.scene;
  std::vector<std::string> plan;
  plan.push_back(fmt::format("integrator: {}, time step {:g} s, r = {} modes", name_of(config.integrator),
                             scene.time_step, model.modes()));
  const auto left_out = [&plan](std::string_view stage, std::string_view why) {
    plan.push_back(fmt::format("{}: left out, {}", stage, why));
  };
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    describe_examples(model.examples[i], scene.examples[i], loaded.reach && loaded.reach->targets.force == i, plan);
  if (scene.examples.empty()) left_out("weights, target, example_force", "the scene names no examples");
  for (std::string& line : describe_keys(loaded.keys, model)) plan.push_back(std::move(line));
  plan.push_back(model.internal_force.polynomial() ? std::string("internal_force: exact polynomial")
                                                   : fmt::format("internal_force: cubature, s = {} elements",
                                                                 model.internal_force.cubature().elements()));
  plan.push_back(fmt::format("instruction set: {}", kernels().name));
  if (scene.precision == Precision::kMixed)
    plan.push_back(can_step_side_by_side(model, scene) && config.instances >= kFewestLanes
                       ? "precision: mixed, stiffness in single precision"
                       : "precision: double, mixed is for four and more bodies side by side");
  plan.push_back(fmt::format("solve: Newton, Cholesky of {} x {}, at most {} iterations", model.modes(), model.modes(),
                             scene.newton.max_iterations));
  if (loaded.full)
    plan.push_back(fmt::format(
        "full space: {} vertices, Newton, conjugate gradients with a factor of {} x {}{}",
        loaded.full->space.vertices(), loaded.full->space.vertices(), loaded.full->space.vertices(),
        scene.space.space == Space::kAuto
            ? fmt::format("; until {:g} s after a load that the bundle was not made for", scene.space.release)
            : ", in all steps"));
  if (model.skeleton)
    plan.push_back(
        fmt::format("skeleton: {} {} vertices, {}{}",
                    model.skeleton->size() == 1 ? "a bone holds" : fmt::format("{} bones hold", model.skeleton->size()),
                    loaded.full->space.driven(), describe_bones(scene.animation),
                    loaded.data.skeleton->shifts.rows() > 0 ? "; examples shift them by their weights" : ""));
  if (scene.mass_damping > 0 || scene.stiffness_damping > 0) {
    plan.push_back(
        fmt::format("damping: mass {:g} 1/s, stiffness {:g} s", scene.mass_damping, scene.stiffness_damping));
  } else {
    left_out("damping", "both factors are 0");
  }
  if (scene.sleep.energy > 0)
    plan.push_back(
        fmt::format("sleep: after {:g} s with a kinetic energy below {:g} J", scene.sleep.time, scene.sleep.energy));
  if (scene.forces.empty()) {
    left_out("scripted forces", "the scene names none");
  } else {
    plan.push_back(fmt::format("scripted forces: {}", scene.forces.size()));
  }
  if (!loaded.attachments.empty()) plan.push_back(fmt::format("attachments: {}", loaded.attachments.size()));
  if (model.frame->moves())
    plan.push_back(fmt::format("rigid motion: {}", model.frame->description()));
  else
    left_out("rigid motion", "the body is constrained");
  if (touches(model, scene))
    plan.push_back(fmt::format("contact: {} vertices against {} obstacles, backward Euler near them",
                               model.contact->vertices(), scene.obstacles.size()));
  else
    left_out("contact", "the scene names no obstacles");
  if (config.trajectory) {
    const RenderData* const render = loaded.data.render ? &*loaded.data.render : nullptr;
    plan.push_back(fmt::format("output: n = {} positions{} every {} steps", loaded.summary.vertices,
                               render ? fmt::format(" and {} of the render mesh", render->tets.size()) : "",
                               config.every));
  } else {
    left_out("output", "no trajectory is asked for; positions are not loaded");
  }
  return plan;
}

}  // namespace exmat::runtime

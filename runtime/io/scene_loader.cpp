#include "runtime/io/scene_loader.h"

#include <fmt/format.h>
#include <string_view>
#include <utility>

#include "common/config/config.h"
#include "common/core/error.h"

namespace exmat::runtime {
namespace {

Integrator integrator_from_name(std::string_view name) {
  if (name == "backward_euler") return Integrator::kBackwardEuler;
  if (name == "newmark") return Integrator::kNewmark;
  return Integrator::kBdf2;
}

void check_body(const SceneConfig& config, const BundleSummary& summary) {
  const std::string bundle = config.bundle.string();
  if (!summary.constrained)
    throw InputError({bundle, "/", "a body with fixed vertices", "a free body",
                      "name \"fixed\" vertices in the asset; free bodies come in a later version"});
  if (config.examples && summary.examples == 0)
    throw InputError({bundle, "/examples", "this group, since the scene asks for an example force", "none",
                      "precompute the asset with its examples, or drop \"examples\" from " + config.file.string()});
}

void check_force_vertices(const SceneConfig& config, const BundleSummary& summary) {
  for (std::size_t i = 0; i < config.forces.size(); ++i)
    for (const std::int64_t vertex : config.forces[i].vertices)
      if (vertex < 0 || vertex >= summary.vertices)
        throw InputError({config.file.string(), fmt::format("/forces/{}/vertices", i),
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
  if (basis.rows() == 0) return read_basis_rows(config.bundle, force.vertices, &loaded.records);
  RowMatrix rows(3 * force.vertices.size(), basis.cols());
  for (std::size_t i = 0; i < force.vertices.size(); ++i)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = basis.middleRows<3>(3 * force.vertices[i]);
  return rows;
}

StepScene step_scene(const SceneConfig& config, LoadedScene& loaded) {
  StepScene scene;
  scene.time_step = config.time_step;
  scene.integrator = integrator_from_name(config.integrator);
  scene.mass_damping = config.mass_damping;
  scene.stiffness_damping = config.stiffness_damping;
  scene.newton = {config.newton.max_iterations, config.newton.tolerance};
  scene.gravity_force = gravity_force(*loaded.model, config.gravity);
  for (const VertexForceConfig& force : config.forces)
    scene.forces.push_back({vertex_force(basis_rows(config, force, loaded), force.force), force.start, force.end});
  if (config.examples)
    scene.examples = ExampleSettings{config.examples->stiffness, config.examples->damping, config.examples->bias};
  return scene;
}

std::unique_ptr<const Model> prepare(const SceneConfig& config, const ReducedModel& data) {
  ModelOptions options;
  options.examples = config.examples.has_value();
  if (config.examples && config.examples->energy_reference == "rest") options.energy_reference = EnergyReference::kRest;
  ModelResult result = build_model(data, options);
  if (result.model) return std::move(result.model);
  result.complaint.file = config.bundle.string();
  throw InputError(std::move(result.complaint));
}

}  // namespace

LoadedScene load_run(const SceneConfig& config) {
  LoadedScene loaded;
  loaded.summary = summarise_bundle(config.bundle);
  check_body(config, loaded.summary);
  check_force_vertices(config, loaded.summary);
  loaded.ledger = plan_groups(needs_of(config), loaded.summary.constrained, loaded.summary.examples > 0);
  const BundleRequest request{loaded.ledger, /*step_only=*/true, /*positions=*/config.trajectory.has_value()};
  loaded.data = read_bundle(config.bundle, request, &loaded.records);
  loaded.model = prepare(config, loaded.data);
  loaded.scene = step_scene(config, loaded);
  count_bytes(loaded.records, loaded.ledger);
  // The model holds its own, prepared for stepping.
  loaded.data.cubature.reset();
  loaded.data.examples.reset();
  loaded.data.projection.reset();
  return loaded;
}

std::vector<std::string> describe_plan(const LoadedScene& loaded, const SceneConfig& config) {
  const Model& model = *loaded.model;
  const StepScene& scene = loaded.scene;
  std::vector<std::string> plan;
  plan.push_back(
      fmt::format("integrator: {}, time step {:g} s, r = {} modes", config.integrator, scene.time_step, model.modes()));
  const auto left_out = [&plan](std::string_view stage, std::string_view why) {
    plan.push_back(fmt::format("{}: left out, {}", stage, why));
  };
  if (runs_examples(model, scene)) {
    const Eigen::Index count = model.example_count();
    plan.push_back(fmt::format("weights: K = {} examples, bias {:g}", count, scene.examples->bias));
    plan.push_back(fmt::format("target: Newton in d = {} coordinates, {} examples of s = {} elements",
                               model.examples->target.dimension(), count, model.elasticity.elements()));
    plan.push_back(fmt::format("example_force: linear, {} filter of {} x {}",
                               model.examples->filter.is_symmetric() ? "symmetric" : "unsymmetric", model.modes(),
                               model.modes()));
  } else {
    left_out("weights, target, example_force",
             scene.examples ? "stiffness and damping are 0" : "the scene names no examples");
  }
  plan.push_back(fmt::format("internal_force: cubature, s = {} elements", model.elasticity.elements()));
  plan.push_back(fmt::format("solve: Newton, Cholesky of {} x {}, at most {} iterations", model.modes(), model.modes(),
                             scene.newton.max_iterations));
  if (scene.mass_damping > 0 || scene.stiffness_damping > 0) {
    plan.push_back(
        fmt::format("damping: mass {:g} 1/s, stiffness {:g} s", scene.mass_damping, scene.stiffness_damping));
  } else {
    left_out("damping", "both factors are 0");
  }
  if (scene.forces.empty()) {
    left_out("scripted forces", "the scene names none");
  } else {
    plan.push_back(fmt::format("scripted forces: {}", scene.forces.size()));
  }
  left_out("rigid motion", "the body is constrained");
  left_out("contact", "the scene names no obstacles");
  if (config.trajectory) {
    plan.push_back(fmt::format("output: n = {} positions every {} steps", loaded.summary.vertices, config.every));
  } else {
    left_out("output", "no trajectory is asked for; positions are not loaded");
  }
  return plan;
}

}  // namespace exmat::runtime

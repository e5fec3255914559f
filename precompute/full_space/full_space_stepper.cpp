#include "precompute/full_space/full_space_stepper.h"

#include <algorithm>
#include <utility>

#include "common/core/error.h"
#include "common/core/timer.h"
#include "precompute/full_space/target_update.h"

namespace exmat::precompute {
namespace {

runtime::ScriptedForce scripted(const FullSpaceModel& model, const VertexForceConfig& force) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(3 * model.rest.rows());
  for (const std::int64_t vertex : force.vertices) all.segment<3>(3 * vertex) += force.force;
  runtime::ScriptedForce scripted;
  scripted.on_vertices = model.system.restrict(all);
  scripted.start = force.start;
  scripted.end = force.end;
  return scripted;
}

}  // namespace

void FullSpaceStepper::set(const FullSpaceScene& scene) {
  runtime::StepScene next;
  next.time_step = scene.time_step;
  next.integrator = scene.integrator;
  next.mass_damping = scene.mass_damping;
  next.stiffness_damping = scene.stiffness_damping;
  next.space.newton = scene.newton;
  next.gravity = scene.gravity;
  next.obstacles = scene.obstacles;
  for (const runtime::ExampleSettings& settings : scene.examples)
    if (runtime::acts(settings)) next.examples = scene.examples;
  if (const char* const found = runtime::unsupported(model_.matrix_free, next))
    throw InputError({"", "", "what a body can have that steps in all vertices", found, ""});
  for (const VertexForceConfig& force : scene.forces) next.forces.push_back(scripted(model_, force));
  if (workspace_)
    workspace_->fit(model_.matrix_free, next);
  else
    workspace_.emplace(model_.matrix_free, next);
  if (!next.obstacles.empty())
    contact_ = runtime::ContactWorkspace(model_.matrix_free.contacts->vertices(), 0, next.obstacles.size());
  scene_ = std::move(next);
}

void FullSpaceStepper::set_targets(const FullSpaceState& state, runtime::FullStep& step,
                                   std::vector<runtime::ExampleState>& examples, FullSpaceReport& report) {
  Eigen::VectorXd q(model_.size());
  step.first_iterate(q);
  if (!q.allFinite()) return;
  const Eigen::VectorXd u = deformation(model_, q);
  for (std::size_t group = 0; group < scene_.examples.size(); ++group) {
    const runtime::ExampleSettings& settings = scene_.examples[group];
    if (!runtime::acts(settings)) continue;
    examples[group] = next_target(model_, group, settings, state.examples[group], u, targets_[group], report);
    if ((report.status & runtime::kStepNonFinite) != 0) return;
    const Eigen::VectorXd target = target_displacement(model_, group, examples[group]);
    if (settings.elastic)
      step.set_elastic_target(group, target);
    else
      step.set_target(group, model_.examples[group].root_coefficients(target));
  }
}

FullSpaceReport FullSpaceStepper::step(FullSpaceState& state) {
  const Timer timer;
  FullSpaceReport report;
  runtime::FullMemory memory;
  if (!scene_.obstacles.empty()) {
    state.contacts.held.resize(std::max(state.contacts.held.size(), contact_.candidates.size()));
    memory.held = &state.contacts;
    memory.found = &contact_;
  }
  runtime::FullStep one(model_.matrix_free, scene_, state, *workspace_, memory);
  one.begin();
  std::vector<runtime::ExampleState> examples = state.examples;
  if (!scene_.examples.empty()) set_targets(state, one, examples, report);
  one.take_elastic_targets();
  report.target_seconds = timer.seconds();
  one.solve();
  const runtime::FullReport& found = one.finish();
  const std::uint32_t status = report.status | found.status;
  const int target_iterations = report.target_iterations;
  static_cast<runtime::StepReport&>(report) = found;
  report.status = status;
  report.target_iterations = target_iterations;
  if ((found.status & runtime::kStepNonFinite) == 0) state.examples = std::move(examples);
  report.seconds = timer.seconds();
  return report;
}

runtime::Energies energies(const FullSpaceModel& model, const FullSpaceScene& scene, const FullSpaceState& state) {
  return {0.5 * state.v.dot(model.system.mass * state.v), state.elastic_energy,
          -(model.gravity_load * scene.gravity).dot(state.q)};
}

}  // namespace exmat::precompute

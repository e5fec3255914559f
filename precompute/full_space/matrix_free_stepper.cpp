#include "precompute/full_space/matrix_free_stepper.h"

#include <utility>

#include "common/core/timer.h"
#include "precompute/full_space/step_potential.h"
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

bool MatrixFreeStepper::set(const FullSpaceScene& scene) {
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
  if (runtime::unsupported(model_.matrix_free, next) != nullptr) return false;
  for (const VertexForceConfig& force : scene.forces) next.forces.push_back(scripted(model_, force));
  if (workspace_)
    workspace_->fit(model_.matrix_free, next);
  else
    workspace_.emplace(model_.matrix_free, next);
  scene_ = std::move(next);
  return true;
}

FullSpaceReport MatrixFreeStepper::step(FullSpaceState& state) {
  const Timer timer;
  FullSpaceReport report;
  runtime::FullStep one(model_.matrix_free, scene_, state, *workspace_);
  one.begin();
  std::optional<runtime::ExampleState> examples;
  if (!scene_.examples.empty()) {
    Eigen::VectorXd q(model_.size());
    one.first_iterate(q);
    if (q.allFinite())
      examples = next_target(model_, 0, scene_.examples.front(), state.examples.front(), Deformation(model_, q).u(),
                             target_, report);
    if (examples && (report.status & runtime::kStepNonFinite) == 0) {
      const Eigen::VectorXd target = target_displacement(model_, 0, *examples);
      if (scene_.examples.front().elastic)
        one.set_elastic_target(target);
      else
        one.set_target(
            Eigen::MatrixXd(model_.space_root.transpose() * target.reshaped<Eigen::RowMajor>(model_.size() / 3, 3)));
    }
    report.target_seconds = timer.seconds();
  }
  one.solve();
  const runtime::FullReport& found = one.finish();
  const std::uint32_t status = report.status | found.status;
  const int target_iterations = report.target_iterations;
  static_cast<runtime::StepReport&>(report) = found;
  report.status = status;
  report.target_iterations = target_iterations;
  if (examples && (found.status & runtime::kStepNonFinite) == 0) state.examples.front() = *std::move(examples);
  report.seconds = timer.seconds();
  return report;
}

}  // namespace exmat::precompute

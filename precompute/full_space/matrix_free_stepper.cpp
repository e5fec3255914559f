#include "precompute/full_space/matrix_free_stepper.h"

#include <array>
#include <utility>

#include "common/core/timer.h"
#include "precompute/full_space/target_update.h"

namespace exmat::precompute {
namespace {

// Tells whether factors that were made for one scene serve the other.
bool same_matrices(const runtime::StepScene& a, const runtime::StepScene& b) {
  const auto numbers = [](const runtime::StepScene& scene) {
    const bool acts = !scene.examples.empty();
    return std::array{scene.time_step, scene.mass_damping, scene.stiffness_damping,
                      acts ? scene.examples.front().stiffness : 0, acts ? scene.examples.front().damping : 0};
  };
  return a.integrator == b.integrator && numbers(a) == numbers(b);
}

runtime::ScriptedForce scripted(const FullSpaceModel& model, const VertexForceConfig& force) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(3 * model.rest.rows());
  for (const std::int64_t vertex : force.vertices) all.segment<3>(3 * vertex) += force.force;
  runtime::ScriptedForce scripted;
  scripted.force = model.system.restrict(all);
  scripted.start = force.start;
  scripted.end = force.end;
  return scripted;
}

}  // namespace

bool MatrixFreeStepper::set(const FullSpaceScene& scene) {
  if (model_.frame) return false;
  runtime::StepScene next;
  next.time_step = scene.time_step;
  next.integrator = scene.integrator;
  next.mass_damping = scene.mass_damping;
  next.stiffness_damping = scene.stiffness_damping;
  next.newton = scene.newton;
  next.gravity = scene.gravity;
  next.obstacles = scene.obstacles;
  for (const runtime::ExampleSettings& settings : scene.examples)
    if (runtime::acts(settings)) next.examples = scene.examples;
  if (runtime::unsupported(model_.space, next) != nullptr) return false;
  for (const VertexForceConfig& force : scene.forces) next.forces.push_back(scripted(model_, force));
  if (!workspace_ || !same_matrices(scene_, next)) workspace_.emplace(model_.space, next);
  scene_ = std::move(next);
  return true;
}

FullSpaceReport MatrixFreeStepper::step(FullSpaceState& state) {
  const Timer timer;
  FullSpaceReport report;
  runtime::FullStep one(model_.space, scene_, state, *workspace_);
  one.begin();
  std::optional<runtime::ExampleState> examples;
  if (!scene_.examples.empty()) {
    Eigen::VectorXd u(model_.size());
    one.first_iterate(u);
    if (u.allFinite())
      examples = next_target(model_, 0, scene_.examples.front(), state.examples.front(), u, target_, report);
    if (examples && (report.status & runtime::kStepNonFinite) == 0) {
      const Eigen::VectorXd target = target_displacement(model_, 0, *examples);
      const Eigen::MatrixXd coefficients =
          model_.space_root.transpose() * target.reshaped<Eigen::RowMajor>(model_.size() / 3, 3);
      one.set_target(coefficients);
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

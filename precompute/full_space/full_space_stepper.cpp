#include "precompute/full_space/full_space_stepper.h"

#include "common/core/timer.h"
#include "precompute/full_space/full_space_step.h"
#include "precompute/full_space/sparse_newton.h"

namespace exmat::precompute {
namespace {

using runtime::NewtonReport;
using runtime::NewtonStatus;

NewtonStatus minimise(const FullSpaceScene& scene, FullSpaceWorkspace& workspace, FullSpaceStep& step) {
  const auto solve = [&] {
    const NewtonReport newton = minimise_step(step.potential(), scene.newton, workspace.direction, step.d());
    step.add(newton);
    return newton.status;
  };
  NewtonStatus status = solve();
  for (int round = 1; step.near_obstacles() && round < runtime::kFrictionRounds; ++round) {
    runtime::FrictionChange change;
    step.refresh_friction(change);
    if (status == NewtonStatus::kNonFinite || change.relative() <= runtime::kSameFriction) return status;
    step.potential().start(step.d());
    status = solve();
  }
  return status;
}

}  // namespace

FullSpaceWorkspace::FullSpaceWorkspace(const FullSpaceModel& model)
    : direction(model.elasticity.pattern()), examples(model.examples.size()) {}

FullSpaceReport step(const FullSpaceModel& model, const FullSpaceScene& scene, FullSpaceState& state,
                     FullSpaceWorkspace& workspace) {
  const Timer timer;
  FullSpaceStep one(model, scene, state, workspace);
  const NewtonStatus status = one.begin() ? minimise(scene, workspace, one) : NewtonStatus::kNonFinite;
  FullSpaceReport report = one.finish(status);
  report.seconds = timer.seconds();
  return report;
}

runtime::Energies energies(const FullSpaceModel& model, const FullSpaceScene& scene, const FullSpaceState& state) {
  return {0.5 * state.v.dot(model.system.mass * state.v), state.elastic_energy,
          -(model.gravity_load * scene.gravity).dot(state.q)};
}

}  // namespace exmat::precompute

#include "tests/support/sparse_space/sparse_model.h"

#include <utility>

#include "common/core/timer.h"
#include "tests/support/sparse_space/sparse_newton.h"
#include "tests/support/sparse_space/sparse_step.h"

namespace exmat::precompute {
namespace {

using runtime::NewtonReport;
using runtime::NewtonStatus;

NewtonStatus minimise(const FullSpaceScene& scene, SparseWorkspace& workspace, SparseStep& step) {
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

SparseModel::SparseModel(FullSpaceModel of, const ReducedModel& data)
    : FullSpaceModel(std::move(of)), mass_values(elasticity.values_of(system.mass)) {
  if (data.contact) contacts.emplace(*data.contact, system.free_dofs);
}

SparseModel build_sparse_model(const ReducedModel& model, const FullSpaceOptions& options) {
  return {build_full_space_model(model, options), model};
}

SparseWorkspace::SparseWorkspace(const SparseModel& model)
    : direction(model.elasticity.pattern()), examples(model.examples.size()) {}

SparseReport step(const SparseModel& model, const FullSpaceScene& scene, FullSpaceState& state,
                  SparseWorkspace& workspace) {
  const Timer timer;
  SparseStep one(model, scene, state, workspace);
  const NewtonStatus status = one.begin() ? minimise(scene, workspace, one) : NewtonStatus::kNonFinite;
  SparseReport report = one.finish(status);
  report.seconds = timer.seconds();
  return report;
}

}  // namespace exmat::precompute

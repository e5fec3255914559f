#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>

#include "precompute/full_space/full_space_stepper.h"

namespace exmat::precompute {

/// Weights and target of the group's example force at the deformation u [f] of a step's first iterate, from those of
/// the step before; iterations, and a target that did not converge, into the report.
runtime::ExampleState next_target(const FullSpaceModel& model, std::size_t group,
                                  const runtime::ExampleSettings& settings, const runtime::ExampleState& former,
                                  const Eigen::VectorXd& u, std::optional<runtime::TargetSolver::Workspace>& scratch,
                                  FullSpaceReport& report);

/// [f] the displacement that a target stands for.
Eigen::VectorXd target_displacement(const FullSpaceModel& model, std::size_t group, const runtime::ExampleState& state);

}  // namespace exmat::precompute

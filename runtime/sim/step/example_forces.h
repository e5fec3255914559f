#pragma once

#include <Eigen/Core>

#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

// The example forces of a step, that of the whole body and those of regions: independent of each other, they add up.
// docs/step_in_detail.md, "Target". No call allocates or throws. Those that do not act are left out.

/// Weights after the bias at the pose q [r], into the workspace.
void evaluate_weights(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                      Workspace& workspace) noexcept;

/// Weights and targets at the pose q [r], into the workspace. Targets that are solved for start from those of the
/// state.
void update_targets(const Model& model, const StepScene& scene, const State& state, const Eigen::VectorXd& q,
                    Workspace& workspace, StepReport& report) noexcept;

/// The terms of the forces that stay the same during the step, after update_targets().
void prepare_example_forces(const StepScene& scene, Workspace& workspace) noexcept;

/// The forces -kappa P_s (q - p*) - c_kappa P_s qdot of the state, added to `force` [r]; after update_targets().
void add_example_forces(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                        Eigen::VectorXd& force) noexcept;

/// Weights, and targets where those of the step are solved, from the workspace into the state.
void commit_weights(const StepScene& scene, const Workspace& workspace, State& state) noexcept;
void commit_targets(const Model& model, const StepScene& scene, const Workspace& workspace, State& state) noexcept;

}  // namespace exmat::runtime

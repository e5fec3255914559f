#pragma once

#include <Eigen/Core>

#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

// The example forces of a step, that of the whole body and those of regions: independent of each other, they add up.
// docs/step_in_detail.md, "Target". No call allocates or throws. Those that do not act are left out.

/// Sets the weights in the workspace: those given, or those of the coordinates that `weights` takes, after the bias.
void set_weights(const ExampleWeights& weights, const ExampleSettings& settings, const Eigen::VectorXd& coordinates,
                 ExampleWorkspace& workspace) noexcept;

/// Weights after the bias at the pose q [r], into the workspace.
void evaluate_weights(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                      Workspace& workspace) noexcept;

/// Finds the pull of the target for the weights in the workspace or, for an elastic force, the elasticity from it.
void find_target(const ExampleModel& model, const ExampleSettings& settings, const ExampleState& state,
                 ExampleWorkspace& workspace, StepReport& report) noexcept;

/// p* of these examples by Newton's method from the last target, for the weights in the workspace: its coordinates.
void solve_target(const ExampleModel& model, int most_iterations, const ExampleState& state,
                  ExampleWorkspace& workspace, StepReport& report) noexcept;

/// Weights and targets at the pose q [r], into the workspace. Targets that are solved for start from those of the
/// state.
void update_targets(const Model& model, const StepScene& scene, const State& state, const Eigen::VectorXd& q,
                    Workspace& workspace, StepReport& report) noexcept;

/// The terms of the forces that stay the same during the step, after update_targets().
void prepare_example_forces(const StepScene& scene, Workspace& workspace) noexcept;

/// The forces of the state, -kappa P_s (q - p*) or the elastic one and -c_kappa P_s qdot, added to `force` [r]; after
/// update_targets().
void add_example_forces(const Model& model, const StepScene& scene, const State& state, Workspace& workspace,
                        Eigen::VectorXd& force) noexcept;

/// The energies of the elastic forces at q [r] and their first and second derivatives, added to `gradient` [r] and to
/// the lower triangle of `hessian` [r x r]; after update_targets(). Nothing where all forces are linear.
double elastic_example_energy(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                              const Workspace& workspace) noexcept;
double add_elastic_example_forces(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                                  Workspace& workspace, Eigen::VectorXd& gradient) noexcept;
void add_elastic_example_stiffness(const Model& model, const StepScene& scene, const Eigen::VectorXd& q,
                                   Tangent tangent, Workspace& workspace, Eigen::MatrixXd& hessian) noexcept;

/// Weights, and targets where those of the step are solved, from the workspace into the state.
void commit_weights(const StepScene& scene, const Workspace& workspace, State& state) noexcept;
void commit_targets(const Model& model, const StepScene& scene, const Workspace& workspace, State& state) noexcept;

}  // namespace exmat::runtime

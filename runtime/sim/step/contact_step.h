#pragma once

#include "runtime/sim/step/contact_problem.h"

namespace exmat::runtime {

// What a step does near obstacles. docs/step_in_detail.md, "Contact". No call allocates.

/// Where the body is.
BodyPose pose_of(const Model& model, const State& state) noexcept;

/// Whether any vertex may touch an obstacle in this step; then the candidates are in workspace.near.
bool is_near_obstacles(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept;

/// The unknowns of a step near something, into workspace.near->x: of free flight, and of workspace.q.
void start_contact(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept;

/// q, and where a free body will be and its momenta, into the workspace, from the unknowns of the solution, the force
/// of its contacts and this torque of theirs about the centre of mass [N m].
void finish_contact(const Model& model, const State& state, bool converged, const Eigen::Vector3d& torque,
                    Workspace& workspace) noexcept;

/// Newton's method of a step near obstacles, from workspace.q; friction follows the normal forces of the solution.
/// Leaves q, and where a free body will be and its momenta, in the workspace.
NewtonReport solve_with_contacts(const Model& model, const StepScene& scene, const State& state,
                                 IncrementalPotential& potential, Workspace& workspace) noexcept;

/// The anchors of friction go with a body that is put from one place to another.
void carry_contacts(const StepScene& scene, const Placement& from, const Placement& to, State& state) noexcept;

/// What the state, already that of the end of the step, remembers of its contacts.
void commit_contacts(const Model& model, bool near, const Workspace& workspace, State& state) noexcept;

}  // namespace exmat::runtime

#pragma once

#include "runtime/sim/step/contact_problem.h"

namespace exmat::runtime {

// What a step does near obstacles. docs/step_in_detail.md, "Contact". No call allocates.

/// Whether any vertex may touch an obstacle in this step; then the candidates are in workspace.near.
bool is_near_obstacles(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept;

/// Newton's method of a step near obstacles, from workspace.q; friction follows the normal forces of the solution.
/// Leaves q, and where a free body will be and its momenta, in the workspace.
NewtonReport solve_with_contacts(const Model& model, const StepScene& scene, const State& state,
                                 IncrementalPotential& potential, Workspace& workspace) noexcept;

/// The anchors of friction go with a body that is put from one place to another.
void carry_contacts(const StepScene& scene, const Placement& from, const Placement& to, State& state) noexcept;

/// What the state, already that of the end of the step, remembers of its contacts.
void commit_contacts(const Model& model, bool near, const Workspace& workspace, State& state) noexcept;

}  // namespace exmat::runtime

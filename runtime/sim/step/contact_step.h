#pragma once

#include "runtime/sim/step/contact_problem.h"

namespace exmat::runtime {

// Steps near obstacles. docs/step_in_detail.md, "Contact". No call allocates.

/// Pose of the body.
BodyPose pose_of(const Model& model, const State& state) noexcept;

/// True if any vertex may touch an obstacle in this step, in which others push it `pushed` [m] far at most; then the
/// candidates are in workspace.near. Changes nothing in the state but what saves searches.
bool is_near_obstacles(const Model& model, const StepScene& scene, double pushed, State& state,
                       Workspace& workspace) noexcept;

/// True if nothing but gravity and obstacles that stand still changes the energy of a body, its frame aside; of the
/// scene and the obstacles near alone, or of the state, too.
bool is_isolated(const StepScene& scene, const ContactWorkspace& contact) noexcept;
bool is_isolated(const StepScene& scene, const State& state, const ContactWorkspace& contact) noexcept;

/// Relative gain of energies in the modes that is rounding.
inline constexpr double kEnergyRounding = 1e-12;

/// The unknowns of a step near something, into workspace.near->x: of free flight, and of workspace.q.
void start_contact(const Model& model, const StepScene& scene, const State& state, Workspace& workspace) noexcept;

/// q, and where a free body will be and its momenta, into the workspace, from the unknowns of the solution, the force
/// of its contacts and this torque of theirs about the centre of mass [N m], beside those of its attachments.
void finish_contact(const Model& model, const State& state, bool converged, const Eigen::Vector3d& torque,
                    Workspace& workspace) noexcept;

/// The counts of a minimisation, after those of others before it.
void add(const NewtonReport& more, NewtonReport& total) noexcept;

/// Newton's method from x with friction as it follows the normal forces of the solution. A round goes on with the
/// factor of the one before it, as friction of other size changes the stiffness little. Where there is none,
/// `restart()` starts the elastic potential where the last round ended. `refresh()` sets friction and returns its
/// relative change. `begin`: of the first round. A problem may offer rough_tolerance(), of a round before the others
/// whose solution is for the normal forces alone.
template <class Problem, class Restart, class Refresh>
NewtonReport minimise_with_friction(Problem& problem, const NewtonSettings& settings, Eigen::VectorXd& x,
                                    NewtonWorkspace& workspace, const Restart& restart, const Refresh& refresh,
                                    NewtonBegin begin = NewtonBegin::kHessian) noexcept {
  NewtonReport total;
  NewtonSettings rough = settings;
  if constexpr (requires { problem.rough_tolerance(); })
    rough.tolerance = std::max(settings.tolerance, problem.rough_tolerance());
  const int first = rough.tolerance > settings.tolerance ? -1 : 0;
  for (int round = first; round < kFrictionRounds; ++round) {
    const bool has_factor = total.factorisations > 0 && total.status == NewtonStatus::kConverged;
    if (round > first && !has_factor) restart();
    if (round > first) begin = has_factor ? NewtonBegin::kFactor : NewtonBegin::kHessian;
    add(newton_minimise(problem, round < 0 ? rough : settings, x, workspace, begin), total);
    if (total.status == NewtonStatus::kNonFinite) break;
    const bool is_settled = refresh() <= kSameFriction;
    if (is_settled && round >= 0) break;
  }
  return total;
}

/// The same of the step of one body near obstacles, or that a host holds, from workspace.near->x.
template <class Problem>
NewtonReport minimise_near(Problem& problem, const Model& model, const StepScene& scene, const State& state,
                           IncrementalPotential& potential, Workspace& workspace,
                           NewtonBegin begin = NewtonBegin::kHessian) noexcept {
  ContactProblemWorkspace& near = *workspace.near;
  const auto restart = [&] {
    workspace.q = state.q + near.x.tail(state.q.size());
    potential.start(workspace.q);
  };
  const auto refresh = [&] {
    return near.contact.candidate_count > 0 ? model.contact->refresh_friction(near.contact) : 0;
  };
  return minimise_with_friction(problem, scene.newton, near.x, near.newton, restart, refresh, begin);
}

/// Newton's method of a step near obstacles, from workspace.q; friction follows the normal forces of the solution.
/// Leaves q, and where a free body will be and its momenta, in the workspace.
NewtonReport solve_with_contacts(const Model& model, const StepScene& scene, const State& state,
                                 IncrementalPotential& potential, Workspace& workspace) noexcept;

/// The anchors of friction go with a body that is put from one place to another.
void carry_contacts(const StepScene& scene, const Placement& from, const Placement& to, State& state) noexcept;

/// Writes the contacts of the step into the state, already that of its end.
void commit_contacts(const Model& model, bool near, Workspace& workspace, State& state) noexcept;

}  // namespace exmat::runtime

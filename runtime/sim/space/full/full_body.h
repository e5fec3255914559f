#pragma once

#include "runtime/sim/space/full/full_step.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

// A body that has two spaces: the modes of its model and all vertices of its mesh. docs/step_in_detail.md, "All
// vertices".

/// Sizes what a state needs to step in full space at any time. Allocates.
void prepare_full(const FullModel& full, State& state);

/// Puts a body into full space where its reduced coordinates place it, or takes it out of there to the modes nearest to
/// it; its momenta stay. Nothing where it is there already. The first of the two allocates.
void enter_full_space(const FullModel& full, const Model& model, State& state);
void leave_full_space(State& state) noexcept;

/// True if the body's next step is to be in full space: the scene says so, or it says `auto` and a load acts, or has
/// acted lately, that asks for it. `last` is the body's last step. Counts how long the body was left alone.
bool asks_for_full_space(const StepScene& scene, const StepReport& last, State& state) noexcept;

/// The place and the motion of a body's frame.
struct RigidPlace {
  Placement placement;
  FrameVelocity velocity;
};
/// After the frame of a free body in full space was set: its vertices go with it from where the frame was.
void move_full(const FullModel& full, const Model& model, const RigidPlace& before, State& state) noexcept;

/// One step of a body in full space; its reduced coordinates and its frame follow. `workspace` is that of reduced
/// steps, whose contacts are then those of this one.
StepReport step_in_full_space(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                              Workspace& workspace, FullWorkspace& own) noexcept;

/// Where a vertex of the mesh is displaced to from where it was meshed, and its velocity, world [m], [m/s]; of a body
/// whose frame is there and moves so.
Eigen::Vector3d full_displacement(const FullModel& full, const Placement& frame, const FullMotion& motion,
                                  Eigen::Index vertex) noexcept;
Eigen::Vector3d full_velocity(const FullModel& full, const Placement& frame, const FrameVelocity& velocity,
                              const FullMotion& motion, Eigen::Index vertex) noexcept;

/// runtime::energies() of a body in the space that it is in.
Energies energies(const FullModel* full, const Model& model, const StepScene& scene, const State& state) noexcept;

}  // namespace exmat::runtime

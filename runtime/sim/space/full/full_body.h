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

/// Puts a body in full space onto its skeleton as `bones` are: what it is displaced by beside them stays and turns
/// along, and in the next step it goes with them. No call allocates.
void put_on_bones(const FullModel& full, const BonePoses& bones, State& state) noexcept;

/// Puts a body in full space that no motion has led to where it is there by the shifts of its examples, of the weights
/// that its next step has; nothing of others. No call allocates.
void put_by_shifts(const FullModel& full, const StepScene& scene, State& state) noexcept;

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

/// One step of a body in full space in parts: begin(), a solution of step(), finish(). Its reduced coordinates and its
/// frame follow. `workspace` is that of reduced steps, whose contacts are then those of this one. Refers to all that it
/// is made of. No call allocates.
class FullBodyStep {
 public:
  FullBodyStep(const FullModel& full, const Model& model, const StepScene& scene, State& state, Workspace& workspace,
               FullWorkspace& own) noexcept;

  /// FullStep::begin(), weights and target. False where numbers are not finite.
  bool begin(bool touches_others = false, double pushed = 0) noexcept;

  FullStep& step() noexcept { return step_; }

  /// FullStep::finish().
  const StepReport& finish(const FrameMomenta& others = {}) noexcept;
  const StepReport& report() const noexcept { return report_; }

  // In place of a step, of a body that a host gives impulses between two of them.

  /// FullStep::stand(), weights and target.
  void stand() noexcept;
  /// FullStep::push(). The body wakes.
  void push(Eigen::VectorXd& impulses) noexcept;

  // After finish(), of a step that was solved with those of others.

  void add_motion(double share, const FrameVelocity& added) noexcept;
  /// The body stands still where it was displaced to by `q` [f], moved on by `way` [m].
  void put(const Eigen::VectorXd& q, double elastic_energy, const Eigen::Vector3d& way) noexcept;

 private:
  void take_time() noexcept;
  void choose_shifts() noexcept;
  void set_reduced() noexcept;

  const FullModel& full_;
  const Model& model_;
  const StepScene& scene_;
  State& state_;
  Workspace& workspace_;
  FullWorkspace& own_;
  FullStep step_;
  StepReport report_;
};

/// All of that of a body that touches no other.
StepReport step_in_full_space(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                              Workspace& workspace, FullWorkspace& own) noexcept;

/// It stands still, and sleeps from the next step on.
void put_full_to_sleep(const Model& model, State& state, Workspace& workspace) noexcept;

/// Displacement of a vertex of the mesh from where it was meshed, and its velocity, world [m], [m/s], while the body's
/// frame is there and moves so.
Eigen::Vector3d full_displacement(const FullModel& full, const Placement& frame, const FullMotion& motion,
                                  Eigen::Index vertex) noexcept;
Eigen::Vector3d full_velocity(const FullModel& full, const Placement& frame, const FrameVelocity& velocity,
                              const FullMotion& motion, Eigen::Index vertex) noexcept;

/// runtime::energies() of a body in the space that it is in. With `own` the elastic energy of one in full space is that
/// where it stands, also where its last step was not evaluated at its end; the state stays as it is.
Energies energies(const FullModel* full, const Model& model, const StepScene& scene, const State& state,
                  FullWorkspace* own = nullptr) noexcept;

}  // namespace exmat::runtime

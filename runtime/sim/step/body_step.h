#pragma once

#include <cmath>

#include "runtime/sim/solver/newton.h"
#include "runtime/sim/step/incremental_potential.h"
#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// True if the next step has no smooth past: the first one, or one that a scripted force begins or ends with, or in
/// which a setting of the scene or the accelerations of the frame jump.
bool begins_anew(const Model& model, const StepScene& scene, const State& state) noexcept;

/// The counts, the residual and the end of a minimisation.
void add_newton_report(const NewtonReport& newton, StepReport& report) noexcept;

/// True if the potentials of the two first iterates differ by more than rounding of the elastic energy may.
inline bool are_clearly_apart(double a, double b, double elastic_energy) noexcept {
  constexpr double kUnclear = 1e-3;
  return std::abs(a - b) > kUnclear * std::abs(elastic_energy);
}

/// One step of one body in parts: begin(), solve(), finish(). Bodies that touch are solved together instead: begin(),
/// prepare(), their common solution, finish(). Refers to all that it is made of. No call allocates.
class BodyStep {
 public:
  BodyStep(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept;

  /// External forces, obstacles near, and the form of the integrator. `pushed`: how far the bodies that it touches may
  /// push a vertex in the step [m].
  void begin(bool touches_others, double pushed = 0) noexcept;

  /// The first iterate, targets and example forces. False where numbers are not finite.
  bool prepare() noexcept;

  /// Targets and example forces alone, at the first iterate in the workspace. False where numbers are not finite.
  bool find_targets() noexcept;

  /// True near obstacles or bodies, after begin().
  bool is_near() const noexcept { return near_; }

  /// prepare() and Newton's method; q at the end of the step into the workspace.
  NewtonReport solve() noexcept;

  /// take(); near obstacles a solution that did not converge may hold contact forces that throw the body: it is then
  /// slowed down until it has no more energy than before, or stands still.
  StepReport finish(const NewtonReport& newton) noexcept;

  /// Takes the solution in the workspace, unless it is not finite.
  const StepReport& take(const NewtonReport& newton) noexcept;

  /// After take(): slows the body down to a kinetic energy of at most `allowed` [J]; the force of the contacts tells
  /// the difference.
  void limit_kinetic_energy(double allowed) noexcept;

  /// After take(): every velocity becomes `share` of what it is and that of a rigid motion beside it, likewise.
  void add_motion(double share, const FrameVelocity& added) noexcept;

  const StepReport& report() const noexcept { return report_; }

  IncrementalPotential& potential() noexcept { return potential_; }

 private:
  NewtonReport solve_once() noexcept;

  const Model& model_;
  const StepScene& scene_;
  State& state_;
  Workspace& workspace_;
  FrameStep in_frame_;
  IncrementalPotential potential_;
  bool near_ = false, held_ = false;
  StepReport report_;
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "runtime/sim/solver/newton.h"
#include "runtime/sim/space/full/full_potential.h"
#include "runtime/sim/space/full/full_space.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// How far a step solves for a direction of Newton's method, whose own limits are those of the scene.
struct FullAccuracy {
  double tolerance = 1e-3;  ///< of the preconditioned residual, beside the initial one
  int iterations = 300;     ///< of conjugate gradients, at most
  /// The first direction of a step from the predictor is taken without an evaluation at its end if it moves no vertex
  /// by more than this share of an edge; 0: never. Saves a third of a step of few iterations.
  double unchecked_move = 0;
};
/// A step of 4 ms within 0.5 % of the displacement.
inline constexpr FullAccuracy kRealTime{0.1, 4, 0.03};
inline constexpr NewtonSettings kRealTimeNewton{20, 0.01};

/// Why steps of this space cannot have this scene; null where they can. Steps look at nothing else of the scene than
/// time step, integrator, damping, limits of Newton's method, gravity, forces, and one example force.
const char* unsupported(const FullSpace& space, const StepScene& scene) noexcept;

/// Scratch of the steps of one body, of a scene's time step, damping and example force: factors for these, and the
/// target of the next step.
struct FullWorkspace {
  FullWorkspace(const FullSpace& space, const StepScene& scene, const FullAccuracy& accuracy = {});

  /// What a step form makes constant.
  struct Linear {
    FullPreconditioner preconditioner;
    std::vector<float> matrix;  ///< M (c_a + alpha c_v) + (1 + beta c_v) V, see Kernels::mesh_product()
    float filter_stiffness = 0;
  };
  FullAccuracy accuracy;
  Linear first, second;  ///< of backward Euler, of BDF2
  StepForm form;
  FullPotentialWorkspace potential;
  Eigen::VectorXd external;                                          ///< f
  Eigen::VectorXd d, gradient, direction, trial, trial_gradient;     ///< fields
  AlignedFloats residual, solved, search, image, sum, coefficients;  ///< of conjugate gradients
};

struct FullReport : StepReport {
  int cg_iterations = 0;
};

/// One step of a body in full space from its beginning to its end: begin(), set_target() where there is an example
/// force, solve(), finish(). M u'' + D u' + f_int(u) = f_ext + f_example by the integrators of runtime::step(), damping
/// frozen at the first iterate. Newton's method with the tangents of the first iterate for as long as they serve, in
/// single precision, its directions by conjugate gradients preconditioned by one constant sparse factor. No call
/// allocates.
class FullStep {
 public:
  FullStep(const FullSpace& space, const StepScene& scene, State& state, FullWorkspace& workspace) noexcept;

  /// The first iterate: the predictor q_n + dt v_n or q_n, whichever has the lower potential; where ends of directions
  /// are taken unchecked, the predictor unless it moves a vertex by half an edge or the step has no smooth past.
  void begin() noexcept;

  /// Displacement [f] at the first iterate, of which weights and target are made.
  void first_iterate(Eigen::VectorXd& u) const noexcept;
  /// c* = W^T u* [m x 3].
  template <typename Coefficients>
  void set_target(const Coefficients& target) noexcept {
    for (int a = 0; a < 3; ++a)
      for (Eigen::Index k = 0; k < target.rows(); ++k)
        workspace_.potential.target[a * space_.filter().stride + k] = target(k, a);
  }

  void solve() noexcept;

  /// The state of the end, unless a number is not finite. Its elastic energy is that of the last evaluation: see
  /// energies().
  const FullReport& finish() noexcept;

 private:
  enum class Outcome { kFound, kIndefinite };

  void gather_external_force() noexcept;
  void choose_first_iterate() noexcept;
  NewtonStatus minimise() noexcept;
  Outcome find_direction(double tolerance) noexcept;
  void project() noexcept;
  bool is_checked() const noexcept { return workspace_.accuracy.unchecked_move == 0; }
  bool is_short() const noexcept;
  bool move() noexcept;

  const FullSpace& space_;
  const StepScene& scene_;
  State& state_;
  FullWorkspace& workspace_;
  const FullWorkspace::Linear* linear_ = nullptr;
  FullPotential potential_;
  FullReport report_;
  PotentialEvaluation here_;
  NewtonStatus status_ = NewtonStatus::kConverged;
  bool anew_ = false, predicted_ = false, at_first_iterate_ = true;
  bool tangents_are_current_ = true, projected_ = false;
  double unchecked_from_ = 0;  ///< residual before a step that no line search checked; 0: a line search did
};

/// begin(), solve(), finish() of a body without example force.
FullReport step(const FullSpace& space, const StepScene& scene, State& state, FullWorkspace& workspace) noexcept;

/// At rest, or with displacement and velocity [f], at time 0.
State make_state(const FullSpace& space, FullWorkspace& workspace);
State make_state(const FullSpace& space, const Eigen::VectorXd& u, const Eigen::VectorXd& v, FullWorkspace& workspace);

/// As runtime::energies(); sets the state's elastic energy.
Energies energies(const FullSpace& space, const StepScene& scene, State& state, FullWorkspace& workspace) noexcept;

}  // namespace exmat::runtime

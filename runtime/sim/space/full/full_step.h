#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/sim/solver/newton.h"
#include "runtime/sim/space/full/full_model.h"
#include "runtime/sim/space/full/full_potential.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// Accuracy of a direction of Newton's method, whose own limits are those of the scene.
struct FullAccuracy {
  double tolerance = 1e-3;  ///< largest preconditioned residual over the initial one
  int iterations = 300;     ///< most iterations of conjugate gradients
  /// The first direction of a step from the predictor is taken without an evaluation at its end if it moves no vertex
  /// by more than this share of an edge; 0: never. Saves a third of a step of few iterations.
  double unchecked_move = 0;
};
/// A step of 4 ms within 0.5 % of the displacement, with SpaceSettings::newton.
inline constexpr FullAccuracy kRealTime{0.1, 40, 0.03};

/// That, unless the scene asks for a smaller residual than it leaves.
inline FullAccuracy accuracy_of(const StepScene& scene) noexcept {
  return scene.space.newton.tolerance < SpaceSettings{}.newton.tolerance ? FullAccuracy{} : kRealTime;
}

/// Why steps in full space cannot have this scene; null where they can.
const char* unsupported(const FullModel& model, const StepScene& scene) noexcept;

/// Scratch of the steps of one body, of a scene's time step, damping and example force: factors for these, and the
/// target of the next step.
struct FullWorkspace {
  FullWorkspace(const FullModel& model, const StepScene& scene, const FullAccuracy& accuracy = {});

  /// Makes factors again where they do not serve the scene.
  void fit(const FullModel& model, const StepScene& scene);

  /// The example force of a group in the Hessian, on the coefficients of its functions.
  struct Filter {
    Eigen::Index first = 0, columns = 0;
    float stiffness = 0;
    Eigen::MatrixXf product;  ///< that of a region that is seen from its band, in place of the stiffness
  };
  /// Arrays that are constant for a step form.
  struct Linear {
    FullPreconditioner preconditioner;
    std::vector<float> matrix;  ///< M (c_a + alpha c_v) + (1 + beta c_v) V, see Kernels::mesh_product()
    std::vector<Filter> filters;
    bool is_filtered = false;
  };
  /// The settings of a scene that factors are made of.
  struct Key {
    struct Pull {
      double stiffness = 0, elasticity = 0, damping = 0;
    };
    double time_step = 0, mass_damping = 0, stiffness_damping = 0;
    Integrator integrator = Integrator::kBdf2;
    std::vector<Pull> pulls;  ///< of each group of examples
  };

  FullAccuracy accuracy;
  Linear first, second;  ///< one for backward Euler, one for the scene's integrator
  Key key;
  StepForm form;
  StepForm fixed_form;  ///< form for the fixed vertices of a body on a skeleton
  FullPotentialWorkspace potential;
  Eigen::VectorXd external, moved, rate, acceleration;               ///< f
  Eigen::VectorXd d, gradient, direction, trial, trial_gradient;     ///< fields
  AlignedFloats residual, solved, search, image, sum, coefficients;  ///< scratch of conjugate gradients
  AlignedFloats scaled;                                              ///< residual that the preconditioner takes
  AlignedFloats turned;                                              ///< in the axes of bones, where there are some
  FullContactScratch contact;
  Eigen::VectorXd field;     ///< a field
  AlignedArray modes;        ///< padded(r)
  Eigen::VectorXf of_group;  ///< coefficients of a group, and forces on them
  struct Examples {
    TargetTable::Workspace table;
    Eigen::VectorXd coefficients, target;  ///< 3m
  };
  std::vector<Examples> examples;  ///< as the model's
};

/// Mean displacement of vertices of the mesh in a step by a force of 1 N shared out to them so, by the preconditioner
/// [m/N]. Vertices and shares [k] each.
double compliance(const FullModel& model, std::span<const std::int32_t> vertices, std::span<const double> shares,
                  FullWorkspace& workspace) noexcept;

struct FullReport : StepReport {
  int cg_iterations = 0;
};

/// State that a step in full space reads and changes beside its motion; null where there is none.
struct FullMemory {
  ContactState* held = nullptr;
  ContactWorkspace* found = nullptr;    ///< scratch, which then holds the contacts of the step
  SkeletonMotion* bones = nullptr;      ///< present for a body on a skeleton
  std::span<Attachment> attachments{};  ///< which then have their loads
};

/// One step of a body in full space from its beginning to its end: begin(), set_target() where there is an example
/// force, solve(), finish(). M u'' + D u' + f_int(u) = f_ext + f_example + f_contact by the integrators of
/// runtime::step(), damping frozen at the first iterate. Newton's method with the tangents of the first iterate for as
/// long as they serve, in single precision, its directions by conjugate gradients preconditioned by one constant sparse
/// factor. A free body moves in the world; after each step its velocities get the rigid motion that its momenta lack of
/// those that forces have made. A carried one does, too: its fixed vertices are where their frame is at the end of the
/// step. No call allocates.
class FullStep {
 public:
  FullStep(const FullModel& model, const StepScene& scene, Motion& state, FullWorkspace& workspace,
           const FullMemory& memory = {}) noexcept;

  /// Obstacles near, and the first iterate: the predictor q_n + dt v_n or q_n, whichever has the lower potential; where
  /// ends of directions are taken unchecked, the predictor unless it moves a vertex by half an edge or the step has no
  /// smooth past. `touches_others`: other bodies are near; the step is solved with theirs, and they may
  /// push a vertex `pushed` [m] far.
  void begin(bool touches_others = false, double pushed = 0) noexcept;

  /// Displacement [f] at the first iterate, of which weights and target are made.
  void first_iterate(Eigen::VectorXd& u) const noexcept;
  /// Coefficients of the examples there into the workspace; of a body whose frame moves those of its deformation.
  void first_coefficients() noexcept;
  /// Before begin(): those of what a body on a skeleton is displaced by beside its bones.
  void own_coefficients() noexcept;
  /// c* [3m] of a group of examples, of a body whose frame moves that of its deformation.
  void set_target(std::size_t group, const Eigen::VectorXd& target) noexcept {
    workspace_.potential.target.segment(3 * model_.examples[group].first, target.size()) = target;
  }

  /// u* [f] of an elastic example force, in any frame, in place of set_target(); after all of them,
  /// take_elastic_targets().
  void set_elastic_target(std::size_t group, const Eigen::VectorXd& shape) noexcept;
  void take_elastic_targets() noexcept;

  void solve() noexcept;

  // In place of solve(), of a step that is solved with those of others.

  FullPotential& potential() noexcept { return potential_; }
  /// d of a body that stays, or goes along with what carries it, a field.
  void stay(Eigen::VectorXd& d) const noexcept;
  /// Begins the blocks of the workspace's contacts with the stiffness of obstacles; others may add to what pushes, then
  /// scales are set.
  void begin_blocks() noexcept;
  void set_scales() noexcept;
  /// The workspace's image = A search, and its solved = B residual, B near the inverse of A. Fields.
  void multiply() noexcept;
  void precondition() noexcept;
  void set_solution(NewtonStatus status, const Eigen::VectorXd& d) noexcept;

  /// Sets the state of the end, unless a number is not finite. Its elastic energy is that of the last evaluation: see
  /// energies(). Of a free body the workspace then holds where it stands, and in `field` its velocities.
  /// `others`: force [N] and torque about the centre of mass [N m] of other bodies.
  const FullReport& finish(const FrameMomenta& others = {}) noexcept;

  /// After finish(), of a step with others: velocities become `share` of what they are, and of a free body those of a
  /// rigid motion beside it.
  void add_motion(double share, const FrameVelocity& added) noexcept;

  // In place of a step, of a body that a host gives impulses between two of them.

  /// The body as it stands, without obstacles.
  void stand() noexcept;
  /// Change of velocity by impulses, world [N s], as a step of backward Euler would give it (ImpulseResponse). A field,
  /// in place.
  void respond(Eigen::VectorXd& impulses) noexcept;
  /// Adds what respond() makes of them, and the way of a step by it; momenta of a free body change by these impulses.
  /// The workspace is then as after finish().
  void push(Eigen::VectorXd& impulses) noexcept;

  bool is_near() const noexcept { return near_; }
  /// After begin(): the momenta that external forces alone make of those of a free body.
  FrameMomenta expected_momenta() const noexcept;

 private:
  enum class Outcome { kFound, kIndefinite };
  static constexpr double kStiffStep = 4;  ///< edges that waves go

  void see_coefficients() noexcept;
  void own_velocity(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                    Eigen::VectorXd& own) const noexcept;
  void carry(Eigen::VectorXd& d) const noexcept;
  bool find_contacts(double pushed) noexcept;
  float begin_preconditioning() noexcept;
  void end_preconditioning() noexcept;
  void scale_blocks(AlignedFloats& field) noexcept;
  void filter_coefficients() noexcept;
  void hold(Eigen::VectorXd& d) const noexcept;
  void end_attachments() noexcept;
  bool is_attached() const noexcept { return is_held(memory_.attachments); }
  void hang(bool second_order) noexcept;
  void take_along() noexcept;
  void end_bones() noexcept;
  void set_own() noexcept;
  void gather_external_force() noexcept;
  void choose_first_iterate() noexcept;
  NewtonStatus minimise() noexcept;
  NewtonStatus minimise_with_friction() noexcept;
  Outcome find_direction(double tolerance, int most_iterations) noexcept;
  void project() noexcept;
  /// Near obstacles or bodies, where a host holds it or the caller asks for it, and where waves go so far in a step
  /// that the predictor leads away from the solution: what an unchecked direction leaves then would grow.
  bool is_checked() const noexcept {
    return near_ || among_others_ || is_attached() || workspace_.accuracy.unchecked_move == 0 || is_stiff();
  }
  bool is_stiff() const noexcept { return space_.wave_rate() * scene_.time_step > kStiffStep; }
  bool comes_unchecked() const noexcept;
  double direction_tolerance() const noexcept;
  bool is_short() const noexcept;
  double largest_move(const Eigen::VectorXd& field) const noexcept;
  bool move() noexcept;
  void add_external_impulse() noexcept;
  void correct_momenta(const FrameMomenta& others) noexcept;
  void give_momenta(const FrameMomenta& momenta) noexcept;
  bool is_free() const noexcept { return model_.rigid && !is_attached(); }
  void move_centre(const Eigen::Vector3d& velocity) noexcept;
  bool is_closed() const noexcept;
  double limit_energy(double allowed, double springs, double gain) noexcept;

  const FullModel& model_;
  const FullSpace& space_;
  const StepScene& scene_;
  Motion& state_;
  FullWorkspace& workspace_;
  FullMemory memory_;
  const FullWorkspace::Linear* linear_ = nullptr;
  FullPotential potential_;
  FullReport report_;
  PotentialEvaluation here_;
  NewtonStatus status_ = NewtonStatus::kConverged;
  FrameMomenta expected_momenta_;  ///< that external forces make of those of the start
  MotionSample from_, to_;         ///< frame of a carried body where the step begins and ends
  bool anew_ = false, near_ = false, among_others_ = false, predicted_ = false, at_first_iterate_ = true;
  bool tangents_are_current_ = true, projected_ = false;
  double unchecked_from_ = 0;  ///< residual before a step that no line search checked; 0: a line search did
};

/// begin(), solve(), finish() of a body without example force.
FullReport step(const FullModel& model, const StepScene& scene, Motion& state, FullWorkspace& workspace,
                const FullMemory& memory = {}) noexcept;

/// At rest, or with displacement and velocity [f], at time 0.
State make_state(const FullModel& model, FullWorkspace& workspace);
State make_state(const FullModel& model, const Eigen::VectorXd& u, const Eigen::VectorXd& v, FullWorkspace& workspace);

/// Energies of a state, as runtime::energies(); of a body on a skeleton with its bones.
Energies energies_of(const FullModel& model, const StepScene& scene, const Motion& state,
                     const SkeletonMotion* bones = nullptr) noexcept;
/// Elastic energy where it stands [J].
double elastic_energy(const FullModel& model, const StepScene& scene, const Motion& state, FullWorkspace& workspace,
                      const SkeletonMotion* bones = nullptr) noexcept;
/// Energies with that, which is set.
Energies energies(const FullModel& model, const StepScene& scene, Motion& state, FullWorkspace& workspace,
                  const SkeletonMotion* bones = nullptr) noexcept;

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "common/model/reduced_model.h"
#include "runtime/sim/frame/carried_motion.h"
#include "runtime/sim/frame/free_motion.h"
#include "runtime/sim/frame/placement.h"
#include "runtime/sim/frame/world_loads.h"

namespace exmat::runtime {

/// State of a frame from step to step, part of a State; empty for a clamped body.
using FrameState = std::variant<std::monostate, FreeState, CarriedState>;

/// Scratch of a step, sized once; nothing for a clamped body.
using FrameWorkspace = std::variant<std::monostate, FreeMotionWorkspace, CarriedWorkspace>;

/// One step as a frame sees it. Refers to what the step works on.
struct FrameStep {
  const WorldLoads& loads;
  double time_step;                      ///< [s]
  double start, end;                     ///< [s]
  const Eigen::VectorXd &q, &v;          ///< [r] at the beginning
  const Eigen::VectorXd& applied_force;  ///< [r] of the host

  double midpoint() const noexcept { return start + 0.5 * time_step; }
};

/// The frame that a body deforms in: how it moves in the world, what that adds to mass, force and Hessian of the
/// reduced coordinates q, and how the body at rest becomes the body in the world. Clamped: the world itself. Free:
/// moved by the body's momenta. Carried: moved by a prescribed motion. Immutable, part of a Model; what changes is in
/// FrameState. No call allocates or throws, but for make_state(), make_workspace() and numbers(). r modes.
///
/// A body of another kind of frame is a class here, with its state and its workspace among the alternatives above; a
/// step, contact, trajectories and the API ask this interface alone.
class BodyFrame {
 public:
  virtual ~BodyFrame() = default;

  // ---- What it is.

  /// Description of its motion; empty if it stands still.
  virtual std::string_view description() const noexcept { return {}; }
  bool moves() const noexcept { return !description().empty(); }
  /// Origin of rest positions: Placement::origin.
  virtual Eigen::Vector3d origin() const noexcept { return Eigen::Vector3d::Zero(); }
  /// Centre of mass at rest, world [m]; 0 for a frame that does not move.
  virtual Eigen::Vector3d centre_of_mass() const noexcept { return Eigen::Vector3d::Zero(); }
  /// Inertia of a body that its momenta move, else null: such bodies rotate side by side (sim/lanes).
  virtual const DeformingInertia* inertia_of_momenta() const noexcept { return nullptr; }
  /// True if it exerts forces on q that depend on q and its velocity and have no potential.
  virtual bool exerts_forces() const noexcept { return false; }

  // ---- Its state.

  /// At rest where the body was meshed.
  virtual FrameState make_state() const { return {}; }
  virtual FrameWorkspace make_workspace() const { return {}; }

  /// After q or its velocity v were set from outside at `time`: the frame moves on as it did.
  virtual void follow(const WorldLoads& /*loads*/, double /*time*/, const Eigen::VectorXd& /*q*/,
                      const Eigen::VectorXd& /*v*/, FrameWorkspace& /*workspace*/,
                      FrameState& /*state*/) const noexcept {}
  /// Sets how it moves; false where that is not for others to say.
  virtual bool set_motion(const FrameMotion& /*motion*/, const Eigen::VectorXd& /*q*/, const Eigen::VectorXd& /*v*/,
                          FrameWorkspace& /*workspace*/, FrameState& /*state*/) const noexcept {
    return false;
  }

  /// Takes place, motion and momenta of a body that steps in full space; q and v are of the modes nearest to it there.
  virtual void adopt(const FrameMotion& /*motion*/, const FrameMomenta& /*momenta*/, const Eigen::VectorXd& /*q*/,
                     const Eigen::VectorXd& /*v*/, FrameWorkspace& /*workspace*/,
                     FrameState& /*state*/) const noexcept {}

  virtual Placement placement(const FrameState& /*state*/) const noexcept { return {}; }
  virtual FrameVelocity velocity(const FrameState& /*state*/) const noexcept { return {}; }
  virtual FrameMotion motion(const FrameState& /*state*/) const noexcept { return {}; }
  /// Momenta of the body, if the frame moves by them.
  virtual std::optional<FrameMomenta> momenta(const FrameState& /*state*/) const noexcept { return std::nullopt; }
  /// [rad/s] in the world.
  virtual double turn_rate(const FrameState& /*state*/) const noexcept { return 0; }
  /// [r] the momentum of q, now and one step earlier: its velocity where the frame does not turn by itself.
  virtual const Eigen::VectorXd& momentum(const Eigen::VectorXd& v, const FrameState& /*state*/) const noexcept {
    return v;
  }
  virtual const Eigen::VectorXd& former_momentum(const Eigen::VectorXd& v_previous,
                                                 const FrameState& /*state*/) const noexcept {
    return v_previous;
  }
  /// All of the body's kinetic energy [J].
  virtual double kinetic_energy(const Eigen::VectorXd& v, const FrameState& /*state*/) const noexcept {
    return 0.5 * v.squaredNorm();
  }
  /// Potential energy in gravity [m/s^2], beyond that of q [J].
  virtual double potential_energy(const Eigen::Vector3d& /*gravity*/, const FrameState& /*state*/) const noexcept {
    return 0;
  }
  /// Coordinates that it integrates by itself, for hashes: c, the quaternion's x y z w, p, L of a free body.
  using Coordinates = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 13, 1>;
  virtual Coordinates coordinates(const FrameState& /*state*/) const noexcept { return {}; }

  /// Writes all numbers of a state, for files, from `to` on, or nothing where that is null; returns their count.
  virtual std::size_t write_numbers(const FrameState& /*state*/, double* /*to*/) const noexcept { return 0; }
  std::vector<double> numbers(const FrameState& state) const;
  /// Takes as many numbers.
  virtual void set_numbers(std::span<const double> /*numbers*/, FrameState& /*state*/) const noexcept {}

  /// A force [N] and a torque about the centre of mass [N m] of the host, world, on the frame until clear_forces().
  virtual void apply(const Eigen::Vector3d& /*force*/, const Eigen::Vector3d& /*torque*/,
                     FrameState& /*state*/) const noexcept {}
  virtual void clear_forces(FrameState& /*state*/) const noexcept {}

  /// After a step near obstacles whose contacts gave the linear `impulse` [kg m/s]: takes out motion, q's velocity v
  /// included, until the kinetic energy, which is above it, is `allowed` [J]. The vibration goes first, which has no
  /// momentum, then what the contacts gave, then the rest. Returns the linear momentum that this took.
  virtual Eigen::Vector3d limit_kinetic_energy(double allowed, const Eigen::Vector3d& impulse,
                                               FrameWorkspace& workspace, Eigen::VectorXd& v,
                                               FrameState& state) const noexcept;
  /// After a step: every velocity, q's v included, becomes `share` of what it is and that of a rigid motion beside it.
  virtual void add_motion(double /*share*/, const FrameVelocity& /*added*/, FrameWorkspace& /*workspace*/,
                          Eigen::VectorXd& /*v*/, FrameState& /*state*/) const noexcept {}
  /// After the solution of a step: whether all is finite that commit() is to take.
  virtual bool is_finite(const FrameWorkspace& /*workspace*/) const noexcept { return true; }
  /// After a step, about the centre of mass, world [kg m^2]; 0 where the body is not moved by its momenta.
  virtual Eigen::Matrix3d inertia(const FrameWorkspace& /*workspace*/, const FrameState& /*state*/) const noexcept {
    return Eigen::Matrix3d::Zero();
  }
  /// True if something outside moves it whatever energy that takes.
  virtual bool is_driven() const noexcept { return false; }

  // ---- A step, in this order.

  /// The frame as far as it is known before forces act, and [r] the external force on q, into the workspace and
  /// `external_force`.
  virtual void begin(const FrameStep& step, FrameWorkspace& workspace, Eigen::VectorXd& external_force) const noexcept;
  /// At the end of the step as far as it is known after begin().
  virtual FrameVelocity expected_velocity(const FrameState& state, const FrameWorkspace& /*workspace*/) const noexcept {
    return velocity(state);
  }
  /// Moves what external forces move. `near`: the motion of the frame is unknown in this step, obstacles may touch or a
  /// host holds the body; `dissipative`: by backward Euler, else a step that is near is by BDF2.
  virtual void move(const FrameStep& /*step*/, bool /*near*/, bool /*dissipative*/, const FrameState& /*state*/,
                    FrameWorkspace& /*workspace*/, Eigen::VectorXd& /*external_force*/) const noexcept {}
  /// After move(), until end_contact(): the momenta that external forces alone have made; where it is moved by them.
  virtual std::optional<FrameMomenta> expected_momenta(const FrameWorkspace& /*workspace*/) const noexcept {
    return std::nullopt;
  }
  /// True if its accelerations may jump in [from, to).
  virtual bool jumps(const WorldLoads& /*loads*/, double /*from*/, double /*to*/) const noexcept { return false; }

  /// External force and force() of the beginning of the step, for an acceleration there; leave_start() goes back to the
  /// end.
  virtual void enter_start(const FrameStep& /*step*/, FrameWorkspace& /*workspace*/,
                           Eigen::VectorXd& /*external_force*/) const noexcept {}
  virtual void add_start_force(const FrameStep& /*step*/, const FrameState& /*state*/, FrameWorkspace& /*workspace*/,
                               Eigen::VectorXd& /*force*/) const noexcept {}
  virtual void leave_start(const FrameStep& /*step*/, FrameWorkspace& /*workspace*/,
                           Eigen::VectorXd& /*external_force*/) const noexcept {}

  // Functions of frames that exert forces, q with the velocity c_v (q - q_v).

  /// Evaluates force(). False where there is no motion of the frame for q.
  virtual bool update_force(const Eigen::VectorXd& /*q*/, double /*velocity_factor*/,
                            const Eigen::VectorXd& /*velocity_centre*/, FrameWorkspace& /*workspace*/) const noexcept {
    return true;
  }
  /// [r] on q, of the last update_force().
  virtual const Eigen::VectorXd* force(const FrameWorkspace& /*workspace*/) const noexcept { return nullptr; }
  /// Adds the symmetric part of the derivative of -force to the lower triangle, as far as it keeps it positive
  /// definite.
  virtual void add_stiffness(double /*velocity_factor*/, FrameWorkspace& /*workspace*/,
                             Eigen::MatrixXd& /*hessian*/) const noexcept {}
  /// About what the antisymmetric part is of inertia.
  virtual double gyroscopic_ratio(double /*velocity_factor*/, const FrameWorkspace& /*workspace*/) const noexcept {
    return 0;
  }
  /// The antisymmetric part [r x r], after add_stiffness(), and its product with x [r].
  virtual const Eigen::MatrixXd* gyroscopic(double /*velocity_factor*/, FrameWorkspace& /*workspace*/) const noexcept {
    return nullptr;
  }
  virtual const Eigen::VectorXd* gyroscopic_product(double /*velocity_factor*/, const Eigen::VectorXd& /*x*/,
                                                    FrameWorkspace& /*workspace*/) const noexcept {
    return nullptr;
  }
  /// Takes a motion that always exists when the step has no solution. False where there is none.
  virtual bool fall_back(const FrameStep& /*step*/, FrameWorkspace& /*workspace*/) const noexcept { return false; }

  /// Takes the solution: q and v are those of the end of the step, `a` [r] = rate (v - ...) so far.
  virtual void commit(const WorldLoads& /*loads*/, double /*rate*/, const Eigen::VectorXd& /*q*/,
                      const Eigen::VectorXd& /*v*/, Eigen::VectorXd& /*a*/, FrameWorkspace& /*workspace*/,
                      FrameState& /*state*/) const noexcept {}

  // ---- A step near obstacles or held by a host, in the unknowns x = (rigid unknowns of the frame, q - q_n).

  /// Number of the frame's unknowns: 6 where contacts move it (d [m] and the rotation vector t [rad] of the step),
  /// else none.
  virtual Eigen::Index rigid_unknowns() const noexcept { return 0; }
  /// Takes the frame's motion as unknowns, from those of free flight at q [r], into the head of x.
  virtual void begin_contact(const FrameState& /*state*/, const Eigen::VectorXd& /*q*/, double /*time_step*/,
                             FrameWorkspace& /*workspace*/, Eigen::VectorXd& /*x*/) const noexcept {}
  /// Placement at x, at the end of the step.
  virtual Placement place(const Eigen::VectorXd& /*x*/, FrameWorkspace& /*workspace*/) const noexcept { return {}; }
  /// The rotation vector in the world [rad] of a change of the unknown t at x.
  virtual Eigen::Matrix3d turn_to_world(const Eigen::VectorXd& /*x*/, const Placement& /*placement*/) const noexcept {
    return Eigen::Matrix3d::Identity();
  }
  /// Inertia of the unknowns, less the work of the contacts' force [N] and torque [N m, about the centre of mass]:
  /// value, and with `gradient` its head. That of t is exact in the gradient, a quadratic form and a frozen rest in the
  /// value.
  virtual double rigid_potential(const Eigen::VectorXd& /*x*/, FrameWorkspace& /*workspace*/) const noexcept {
    return 0;
  }
  virtual void rigid_gradient(const Eigen::VectorXd& /*x*/, const FrameMomenta& /*contact*/,
                              FrameWorkspace& /*workspace*/, Eigen::VectorXd& /*gradient*/) const noexcept {}
  /// Change of the value where the gradient last asked for becomes that of the iterate.
  virtual double accept_rigid(FrameWorkspace& /*workspace*/) const noexcept { return 0; }
  /// Adds the stiffness of contacts about world axes [(6 + r) x (6 + r), lower triangle; used up] as the unknowns have
  /// it, and the frame's inertia.
  virtual void add_rigid_hessian(const Eigen::VectorXd& /*x*/, const Placement& /*placement*/,
                                 Eigen::MatrixXd& /*contact_stiffness*/, FrameWorkspace& /*workspace*/,
                                 Eigen::MatrixXd& /*hessian*/) const noexcept {}
  /// The force that moves the centre of mass to where x has it [N].
  virtual Eigen::Vector3d force_of(const Eigen::VectorXd& /*x*/, const FrameWorkspace& /*workspace*/) const noexcept {
    return Eigen::Vector3d::Zero();
  }
  /// A force [N] in the units of the residual [kg^1/2 m/s^2].
  virtual double residual_of(const Eigen::Vector3d& /*force*/) const noexcept { return 0; }
  /// Pose and momenta of the solution x. Momenta come from the contacts' force and torque; where those are not balanced
  /// for want of convergence, from the way that the body went, and `force` becomes what that took.
  virtual void end_contact(const Eigen::VectorXd& /*x*/, bool /*converged*/, const Eigen::Vector3d& /*torque*/,
                           const FrameState& /*state*/, FrameWorkspace& /*workspace*/,
                           Eigen::Vector3d& /*force*/) const noexcept {}
};

/// The world itself: a body whose fixed vertices stay where they are.
class ClampedFrame final : public BodyFrame {};

/// Makes the frame of the bundle's body: free if it has /rigid, unless a motion carries its fixed part. `carried` takes
/// spin_load of `rigid`; gravity_load [3 x r].
std::shared_ptr<const BodyFrame> make_frame(const RigidData* rigid, bool carried, const RowMatrix& gravity_load);

}  // namespace exmat::runtime

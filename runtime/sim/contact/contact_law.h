#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "runtime/sim/contact/near_planes.h"
#include "runtime/sim/contact/passage.h"

namespace exmat::runtime {

// The law of contact of one vertex with one obstacle, for bodies of any description. docs/method.md, "Contact".
//
// With depth d, area A, kappa = A stiffness and the mean velocity v of the step relative to the obstacle, v h = x -
// x_0, tau = damping / stiffness, a vertex feels
//   normal    kappa max(0, d - tau n_0 . v) n: a spring and a damper that never pull. The damper acts in steps in which
//             the vertex touches at the beginning or would by its velocity.
//   friction  -mu lambda f1(|y|) y / |y|, y = (I - n_0 n_0^T) (x - anchor + tau v): a spring and a damper of initial
//             stiffness kappa, capped by Coulomb's law: f1(l) = 2 l / e - (l / e)^2 up to e = 2 mu lambda / kappa,
//             then 1 (the mollifier of Li et al. 2020 on a displacement). The anchor sticks to the obstacle and is
//             dragged along where it slides (Cundall and Strack 1979), so that nothing creeps below the cone.
// Depths are those beyond the overlap of the vertex: what it was inside where it began, less what has been released of
// that since, so that nothing that starts inside is thrown out.
// lambda is the normal force at the end of the last step, or at the last refresh_friction(). Both forces are minus the
// gradient of a potential of the positions x at the end of the step, whatever the integrator.

inline constexpr int kFrictionRounds = 3;      ///< solutions of one step for the normal forces of friction
inline constexpr double kSameFriction = 0.05;  ///< relative change of friction that needs no further one
inline constexpr double kEntrySteps = 2;       ///< limit in ways of a vertex: one that is deeper has not come in

/// Stiffness, damping and friction of a pair of surfaces, per area.
struct ContactLaw {
  double stiffness = 0;       ///< pressure per depth, > 0 [N/m^3]
  double damping = 0;         ///< pressure per approach velocity, >= 0 [N s/m^3]
  double friction = 0;        ///< Coulomb's coefficient, >= 0
  double release = kRelease;  ///< speed at which overlap at the start is let out, > 0 [m/s]

  /// The law of each of two surfaces whose vertices meet the other one.
  ContactLaw half() const noexcept { return {0.5 * stiffness, 0.5 * damping, friction, release}; }

  /// Depth by which what is released may press springs [m], `load` [kg/m^2] in an `acceleration` [m/s^2]: springs of a
  /// body that is held, or pushed to several sides, hold a quarter of the energy of its motion at the speed of release,
  /// and its weight on a quarter of its surface. Infinite with a load that is not known.
  double most_pressed(double load, double acceleration) const noexcept;
};

/// Memory of a touching vertex from step to step.
struct HeldContact {
  int vertex = 0, obstacle = 0;
  double normal_force = 0;                           ///< at the end of the last step [N]
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< anchor of the tangential spring, frame of the obstacle [m]
  /// To the surface that it came in by, where that is not the nearest; else 0. Frame of the obstacle [m].
  Eigen::Vector3d way_out = Eigen::Vector3d::Zero();
  double overlap = 0;  ///< that is not released yet [m]
};

/// The contacts of a State: the first `count` of `held`, in order of vertex and obstacle.
struct ContactState {
  std::vector<HeldContact> held;
  std::size_t count = 0;
  NearPlanes near_planes;  ///< saves searches; results are the same without
  bool first_step = true;  ///< True until the first step after the body was placed by hand.
  /// The most that the springs may hold where the next step begins [J]: what the body has put into them. Negative where
  /// it has got more from them. kUnbounded: what they do hold.
  double account = kUnbounded;
  static constexpr double kUnbounded = std::numeric_limits<double>::max();

  /// Distance of the farthest of them from the surface that it came in by, where that is not the nearest [m].
  double longest_way_out() const noexcept;
};

/// A vertex that may touch an obstacle in this step.
struct ContactCandidate {
  int vertex = 0, obstacle = 0;

  // Frozen for the step.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< n_0, where the step begins
  Eigen::Vector3d carried = Eigen::Vector3d::Zero();  ///< x_0, where the obstacle would carry the vertex [m]
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();   ///< anchor of the tangential spring, world [m]
  double stiffness = 0;                               ///< kappa = area * stiffness [N/m]
  double damping = 0;                                 ///< gamma = damping / (stiffness * time step) if it touches
  double spring_share = 1;                            ///< 1 / (1 + gamma)
  double start_gap = 0;                               ///< where the step begins [m]
  double friction_force = 0;                          ///< mu lambda, lambda the lagged normal force [N]
  double overlap = 0;                                 ///< part of the depth that pushes nothing yet [m]
  double released = 0;                                ///< energy that its spring has by what is released [J]
  Passage passage;                                    ///< set for obstacles

  /// Clearance: the way of its vertex from the first evaluation on which nothing touches it [m]; negative: it has to be
  /// looked at.
  double clearance = -1;

  // Results of the last evaluation.
  NearestHint hint;                                     ///< hint for nearest_surface_point()
  bool by_plane = false;                                ///< its surface was the passage's plane
  double gap = 0;                                       ///< [m]; 0 where it was not looked at
  double normal_force = 0;                              ///< [N]
  Eigen::Vector3d arm = Eigen::Vector3d::Zero();        ///< x - position [m]
  Eigen::Vector3d force = Eigen::Vector3d::Zero();      ///< on the vertex [N]
  Eigen::Vector3d slip = Eigen::Vector3d::Zero();       ///< y, tangential [m]
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< direction of the normal force, where there is one

  /// Releases at most `most` [m] of the overlap of a vertex `depth` inside [m], of which `before` had no push so far
  /// [m], and by which its spring, at the end of a step that takes it `out` [m], is pressed no more than `pressed` [m].
  void release_overlap(double depth, double before, double out, double pressed, double most) noexcept {
    const double end = depth - out;
    most = std::clamp(pressed - (end - before), 0.0, most);
    before = std::clamp(before, 0.0, std::max(0.0, depth));
    overlap = std::max(0.0, before - most);
    const double press = std::max(0.0, end - overlap), press_before = std::max(0.0, end - before);
    released = 0.5 * stiffness * (press * press - press_before * press_before);
  }
  /// So is one whose numbers overflowed: its force tells.
  bool is_loaded() const noexcept { return !(normal_force <= 0) || friction_force > 0; }
  /// Energy of the spring alone, pressed so deep [m] [J].
  double spring_energy(double depth) const noexcept { return depth > 0 ? 0.5 * stiffness * depth * depth : 0; }
  /// No friction keeps bodies from leaving what they overlap.
  bool rubs() const noexcept { return overlap <= 0; }
  /// Derivative of the normal force by the depth [N/m]; 0 where there is no force.
  double normal_stiffness() const noexcept { return normal_force > 0 ? stiffness * (1 + damping) : 0; }
};

/// The memory of the candidate's vertex, or null. Candidates come in order; `next`, 0 before the first one, is
/// where the search in `state` goes on.
const HeldContact* find_held(const ContactState& state, std::size_t& next, const ContactCandidate& candidate) noexcept;

/// Start of a vertex in a step, and the end to which its velocity leads.
struct VertexMotion {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();      ///< place where the step begins, world [m]
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();  ///< a step on
  Eigen::Vector3d heading = Eigen::Vector3d::Zero();    ///< farther than it may go: two steps on
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();     ///< of its body, where the step begins [m]
  /// Mass of its body over the area of the surface [kg/m^2]; infinite: not known.
  double load = std::numeric_limits<double>::infinity();
  bool first_step = false;  ///< its body was placed by hand: what it overlaps was not seen coming
};

/// Sets what a step keeps of a candidate, whose vertex has the share `area` of the surface [m^2]; friction and anchor
/// are those of `held`, if the vertex touched.
void freeze_contact(const PlacedObstacle& placed, const HeldContact* held, const VertexMotion& motion, double area,
                    double time_step, ContactCandidate& candidate) noexcept;

/// The same for a vertex that is `carried` to `surface`, its nearest point there; `predicted` is where it would be.
void freeze_contact(const ContactLaw& law, const SurfacePoint& surface, const Eigen::Vector3d& carried,
                    const Eigen::Vector3d& predicted, double area, double time_step,
                    ContactCandidate& candidate) noexcept;

/// Force and stiffness of the vertex at `point` at the end of the step. Returns W [J].
double evaluate_contact(const PlacedObstacle& placed, const Eigen::Vector3d& point,
                        ContactCandidate& candidate) noexcept;

/// The same `gap` [m] outside of what it may touch, whose outward normal there is `normal`.
double evaluate_contact(double gap, const Eigen::Vector3d& normal, const Eigen::Vector3d& point,
                        ContactCandidate& candidate) noexcept;

/// The stiffness of a candidate's last evaluation as a sum of squares, -df/dx = sum of f f^T over `count` columns of
/// `columns` [N^1/2 m^-1/2].
struct StiffnessFactors {
  explicit StiffnessFactors(const ContactCandidate& candidate) noexcept;

  auto used() const noexcept { return columns.leftCols(count); }  ///< 3 x count

  Eigen::Matrix3d columns;
  int count = 0;
};

/// After the first evaluation: how far the vertex may go from there and still feel nothing.
double clearance_of(const ContactCandidate& candidate, const Eigen::Vector3d& point) noexcept;

/// Evaluates a vertex that has gone no farther than its clearance from the first evaluation.
void leave_untouched(ContactCandidate& candidate) noexcept;

/// W [J] of the vertex at `point` whose distance is `gap` [m].
double contact_potential(const ContactCandidate& candidate, double gap, const Eigen::Vector3d& point) noexcept;

/// The same of the vertex at `point` of an obstacle's candidate; leaves the last evaluation as it is.
double contact_potential(const PlacedObstacle& placed, const ContactCandidate& candidate,
                         const Eigen::Vector3d& point) noexcept;

/// Energy that the springs of a candidate hold at `point`, `gap` from the surface [J]: those that damp and the way that
/// it slides apart.
double stored_energy(const ContactCandidate& candidate, double gap, const Eigen::Vector3d& point) noexcept;

/// Change of the friction forces when lambda is updated.
struct FrictionChange {
  double change = 0, largest = 0;  ///< change and largest value of mu lambda [N]

  /// Adds one contact.
  void add(double former, double now) noexcept {
    change = std::max(change, std::abs(now - former));
    largest = std::max({largest, now, former});
  }
  /// Takes lambda of a candidate from its last evaluation.
  void refresh(double friction, ContactCandidate& candidate) noexcept;
  double relative() const noexcept { return largest > 0 ? change / largest : 0; }
};

/// Takes lambda of all candidates from their last evaluation. Returns the largest change of mu lambda over the largest
/// mu lambda.
double refresh_friction(const std::vector<PlacedObstacle>& obstacles,
                        std::vector<ContactCandidate>& candidates) noexcept;

/// Stretch of a touching candidate's tangential spring at the end of the step, its vertex at `point`
/// [m].
Eigen::Vector3d held_stretch(double friction, const Eigen::Vector3d& point, const ContactCandidate& candidate) noexcept;

/// Writes a candidate of the last evaluation, its vertex at `point`, if it touches; its anchor is moved where it slid.
void hold_contact(const PlacedObstacle& placed, const Eigen::Vector3d& point, const ContactCandidate& candidate,
                  ContactState& state) noexcept;

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/contact/contact_law.h"
#include "runtime/sim/contact/deformation_tree.h"
#include "runtime/sim/contact/plane_contacts.h"
#include "runtime/sim/contact/vertex_rows.h"
#include "runtime/sim/frame/placement.h"

namespace exmat::runtime {

/// Pose of a body: x = position + rotation (X + U q), rest positions X about the frame's origin.
struct BodyPose : Placement {
  const Eigen::VectorXd& q;  ///< [r]
};

/// Velocities of a body: at x it is linear + angular x (x - position) + rotation U v.
struct BodyVelocity : FrameVelocity {
  const Eigen::VectorXd& v;  ///< [r]
};

/// Bound on how far a point of a body is at one pose from where it is at another [m]: one that is at most `reach` [m]
/// from the frame's origin at rest, and moved by q as far as `movement` allows.
double way_bound(double reach, const MovementBound& movement, const BodyPose& pose, const Placement& from,
                 const Eigen::VectorXd& from_q) noexcept;

class ContactSet;

/// Sums of the contact forces on a body in one evaluation.
struct ContactSums {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< sum of f_i, world [N]
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< sum of (x_i - position) x f_i, world [N m]
  Eigen::VectorXd generalised;                       ///< sum of U_i^T rotation^T f_i [r]
  double potential = 0;                              ///< W [J], f = -dW/dx; none of it without candidates
  double stiffness = 0;                              ///< sum over the candidates that touch [N/m]
  int touching = 0;                                  ///< candidates with a normal force

  void set_zero(Eigen::Index modes) {
    generalised.setZero(modes);
    force.setZero();
    torque.setZero();
    potential = stiffness = 0;
    touching = 0;
  }
  void add(const ContactSums& more) noexcept {
    force += more.force;
    torque += more.torque;
    generalised += more.generalised;
    potential += more.potential;
    stiffness += more.stiffness;
    touching += more.touching;
  }
};

/// Scratch of one step of one body, sized once for as many obstacles as it may have; holds nothing from step to step.
/// Sums are of the last evaluation.
struct ContactWorkspace : ContactSums {
  ContactWorkspace() = default;
  ContactWorkspace(const ContactSet& set, std::size_t obstacle_count);
  ContactWorkspace(Eigen::Index vertices, Eigen::Index modes, std::size_t obstacle_count);

  std::vector<PlacedObstacle> obstacles;     ///< at the end of the step
  std::vector<ContactCandidate> candidates;  ///< the first candidate_count, in order of vertex and obstacle
  std::size_t candidate_count = 0;
  std::vector<double> clearances;   ///< theirs, which each evaluation looks at
  std::vector<char> is_left;        ///< true for each that the last evaluation did not look at
  std::vector<std::size_t> loaded;  ///< the first loaded_count: those with a normal force or friction in the last one
  std::size_t loaded_count = 0;
  PlaneContacts planes;         ///< the candidates
  bool are_all_planes = false;  ///< that stand: what evaluations find is in `planes`, until commit()

  /// Adds what a candidate that was just evaluated feels, its number and its W [J], to the sums; true if it feels
  /// anything.
  bool add_candidate(std::size_t number, double potential) noexcept;
  /// Takes lambda of candidates one by one from the last evaluation.
  void refresh_friction(FrictionChange& change) noexcept;

  /// Energy that the springs hold where the step begins, after freeze(), of obstacles that do not move, as far as the
  /// state's account and what is released pay for it [J].
  double start_energy(const ContactState& state) const noexcept;
  /// The same where it ends, after commit() at arms beyond `position`, all of it; ContactState::kUnbounded where it
  /// overflows.
  double end_energy(const Eigen::Vector3d& position) const noexcept;

  // Counts of the last gather().
  int visited_nodes = 0;
  int tested_vertices = 0;

  /// The pose of the first evaluation after freeze(), which clearances are about.
  bool has_first = false;
  Placement first;
  Eigen::VectorXd first_q;

  AlignedArray x;        ///< padded(r), q or v
  AlignedArray loads;    ///< padded(r), of the generalised force
  AlignedArray factors;  ///< some of padded(6 + r) each: r, then 6
  AlignedArray squares;  ///< padded(6 + r) x padded(6 + r), their sum
};

/// Contact of a body's surface with obstacles, by the law of contact_law.h. docs/method.md, "Contact".
///
/// One step: gather, freeze, then evaluate, potential and add_stiffness as often as needed, then evaluate at the
/// accepted pose and commit.
class ContactSet {
 public:
  ContactSet() = default;
  /// `origin` [m], world: what rest positions are about, BodyFrame::origin(). `mass` [kg], infinite: not known.
  explicit ContactSet(const ContactData& data, const Eigen::Vector3d& origin = Eigen::Vector3d::Zero(),
                      double mass = std::numeric_limits<double>::infinity());

  Eigen::Index vertices() const noexcept { return areas_.size(); }
  Eigen::Index modes() const noexcept { return rows_.modes(); }

  /// Number of a vertex in the object, and its place in ContactData, which is the number, too, where the data has
  /// none; the set has an order of its own.
  int object_vertex(int vertex) const noexcept { return object_vertices_[static_cast<std::size_t>(vertex)]; }
  int data_index(int vertex) const noexcept { return data_indices_[static_cast<std::size_t>(vertex)]; }

  /// The vertices stand at `positions` [k x 3, m] in the frame of the body and go by `velocities` [k x 3, m/s],
  /// whatever its modes are: from now on it has one, the way that they go, at q = 0. They rest where they did.
  void move(const VertexArray& positions, const VertexArray& velocities);

  /// Nothing touches.
  ContactState make_state(std::size_t obstacle_count) const;

  /// Bound on how far a vertex goes in `time_step` at this velocity [m].
  double travel_bound(const BodyPose& pose, const BodyVelocity& velocity, double time_step) const noexcept;

  /// A vertex at q [padded(r)] in the frame of the body [m].
  Eigen::Vector3d place(int vertex, const AlignedArray& q) const noexcept;

  /// False only where nothing of a body that stays at this pose touches the obstacle in the step.
  bool may_meet(const PlacedObstacle& obstacle, const BodyPose& pose) const noexcept;

  /// Finds the candidates: vertices of this pose, that of the beginning, at most `margin` [m] away from the
  /// obstacles as they are at `end_time` [s]. Costs O(obstacles + r) where the whole body is farther away.
  /// `near_planes` is what earlier calls found of the same body; the candidates are the same without.
  void gather(const Obstacles& obstacles, double end_time, double time_step, const BodyPose& pose, double margin,
              NearPlanes& near_planes, ContactWorkspace& workspace) const noexcept;

  /// After gather() at the same pose: sets what the step keeps of each candidate; `expected` is the velocity
  /// that the loads of the step make of it.
  void freeze(const BodyPose& pose, const BodyVelocity& velocity, const FrameVelocity& expected, double time_step,
              const ContactState& state, ContactWorkspace& workspace) const noexcept;

  /// Forces, their sums and stiffness at a pose at the end of the step.
  void evaluate(const BodyPose& pose, ContactWorkspace& workspace) const noexcept;

  /// W alone [J]; leaves the last evaluation as it is.
  double potential(const BodyPose& pose, ContactWorkspace& workspace) const noexcept;

  /// Takes lambda from the last evaluation.
  void refresh_friction(ContactWorkspace& workspace, FrictionChange& change) const noexcept;
  /// The same. Returns the largest change of mu lambda over the largest mu lambda.
  double refresh_friction(ContactWorkspace& workspace) const noexcept;

  /// Adds sum_i J_i^T K_i J_i to the lower triangle of `stiffness` [(6 + r) x (6 + r)], J = [I, -[x - position]x,
  /// rotation U_i], K = -df/dx: positive semi-definite, exact but for the curvature of the obstacle.
  void add_stiffness(const BodyPose& pose, ContactWorkspace& workspace, Eigen::MatrixXd& stiffness) const noexcept;

  /// The same for the reduced coordinates alone [r x r].
  void add_reduced_stiffness(const BodyPose& pose, ContactWorkspace& workspace,
                             Eigen::MatrixXd& stiffness) const noexcept;

  /// The same as a sum of squares alone, into workspace.squares: its upper triangle by rows [padded(r + rigid)] of the
  /// r coordinates and then of 6 or 0 `rigid` unknowns, whose last three turn the body about world axes by `turn` times
  /// them, or as they are where that is null.
  void sum_squares(int rigid, const Eigen::Matrix3d* turn, const BodyPose& pose,
                   ContactWorkspace& workspace) const noexcept;

  /// Writes the contacts of the last evaluation, anchors moved where they slid; the candidates are complete after it.
  void commit(const BodyPose& pose, ContactWorkspace& workspace, ContactState& state) const noexcept;

  // Functions of one vertex.

  /// x - position, world [m].
  Eigen::Vector3d world_arm(int vertex, const BodyPose& pose) const noexcept;
  /// World [m/s]; `arm` is that of the vertex.
  Eigen::Vector3d world_velocity(int vertex, const Eigen::Vector3d& arm, const BodyPose& pose,
                                 const BodyVelocity& velocity) const noexcept;
  Eigen::Vector3d rest(int vertex) const noexcept { return rest_.row(vertex); }  ///< frame of the body [m]
  const VertexArray& rest() const noexcept { return rest_; }                     ///< all vertices
  bool is_moved() const noexcept { return is_moved_; }                           ///< by move()
  const VertexArray& places() const noexcept { return places_; }     ///< those of all vertices at q = 0 [k x 3, m]
  double area(int vertex) const noexcept { return areas_[vertex]; }  ///< share of the surface [m^2]
  double load() const noexcept { return load_; }                     ///< mass over area [kg/m^2]; infinite: not known
  VertexRows::Rows basis_rows(int vertex) const noexcept { return rows_[vertex]; }  ///< 3 x r

  const DeformationTree& tree() const noexcept { return tree_; }  ///< its items are the vertices, in their order
  double reach() const noexcept { return reach_; }  ///< largest distance of a vertex at rest from the origin [m]

 private:
  struct Batch;

  void set_products(const ContactWorkspace& workspace, Batch& batch) const noexcept;
  Eigen::Vector3d arm_in(const Batch& batch, int index, const BodyPose& pose) const noexcept;
  void freeze_batch(const BodyPose& pose, const BodyVelocity& velocity, const FrameVelocity& expected, double time_step,
                    const ContactState& state, std::size_t& next, Batch& batch,
                    ContactWorkspace& workspace) const noexcept;
  void evaluate_each(const BodyPose& pose, double way, bool is_first, ContactWorkspace& workspace) const noexcept;
  void evaluate_batch(const BodyPose& pose, bool is_first, Batch& batch, ContactWorkspace& workspace) const noexcept;
  double potential_of(const BodyPose& pose, Batch& batch, ContactWorkspace& workspace) const noexcept;
  void add_squares(int rigid, const Eigen::Matrix3d* turn, Batch& batch, ContactWorkspace& workspace) const noexcept;
  void find_sweeping(const BodyPose& pose, ContactWorkspace& workspace) const noexcept;
  bool is_near(int node, const BodyPose& pose, double q_norm, double margin,
               const ContactWorkspace& workspace) const noexcept;
  bool body_is_near(const BodyPose& pose, double margin, const ContactWorkspace& workspace) const noexcept;
  void test_batch(const BodyPose& pose, double margin, Batch& batch, ContactWorkspace& workspace,
                  NearPlanes* found) const noexcept;
  void search(const BodyPose& pose, double q_norm, double margin, double radius, ContactWorkspace& workspace,
              NearPlanes* found) const noexcept;
  void add_stiffness_of(int rigid, const BodyPose& pose, ContactWorkspace& workspace,
                        Eigen::MatrixXd& stiffness) const noexcept;

  VertexArray rest_;                                       // k x 3, X
  VertexArray places_;                                     // k x 3, X unless moved
  VertexRows rows_;                                        // of the basis
  Eigen::VectorXd areas_;                                  // k
  double load_ = std::numeric_limits<double>::infinity();  // [kg/m^2]
  std::vector<int> data_indices_, object_vertices_;
  DeformationTree tree_;
  double reach_ = 0;  // largest |X|
  bool is_moved_ = false;
};

}  // namespace exmat::runtime

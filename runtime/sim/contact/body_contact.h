#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/contact/own_search.h"
#include "runtime/sim/contact/touching_surface.h"

namespace exmat::runtime {

/// Memory of a vertex that is inside another body, from step to step.
struct HeldBodyContact {
  int vertex = 0;
  double gap = 0;                                     ///< at the end of the last step [m]
  double normal_force = 0;                            ///< likewise [N]
  Eigen::Vector3d stretch = Eigen::Vector3d::Zero();  ///< stretch of the tangential spring, frame of the other body [m]
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();   ///< side that it came in by, frame of the other body
  double overlap = 0;                                 ///< that is not released yet [m]
};

/// True if one of them has not left what it overlapped at the start.
bool overlap(const std::vector<HeldBodyContact>& held) noexcept;

/// A vertex of one body that may touch the surface of another in this step. Its law is that of contact_law.h with the
/// place of the vertex from the surface's material point y in place of its place in the world; point and normal are
/// those of the beginning of the step.
struct BodyCandidate : ContactCandidate {
  Eigen::Vector3d rest = Eigen::Vector3d::Zero();         ///< y where q = 0, frame of the other body [m]
  Eigen::Vector3d surface_arm = Eigen::Vector3d::Zero();  ///< y - position of the other body [m]; last evaluation
};

/// The triangle of the other body's surface that y is on, and the shares of its corners in it.
struct SurfacePlace {
  int triangle = 0;
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();
};

/// Candidates of a pair of bodies, one's vertices against the other's surface. Grows where more are met than before.
struct BodyCandidates {
  std::vector<BodyCandidate> all;
  std::vector<SurfacePlace> places;  ///< places of their y; at least as many
  RowMatrix basis;                   ///< 3 of `all` x r and more, rows of the basis at each y
  /// The poses of the first evaluation after gather(), a's and b's, which clearances are about.
  bool has_first = false;
  std::array<Placement, 2> first{};
  std::array<Eigen::VectorXd, 2> first_q{};

  auto rows(std::size_t index) const { return basis.middleRows<3>(3 * static_cast<Eigen::Index>(index)); }
  auto rows(std::size_t index) { return basis.middleRows<3>(3 * static_cast<Eigen::Index>(index)); }
  /// y - position of the other body, at its pose, world [m].
  Eigen::Vector3d surface_arm(std::size_t index, const BodyPose& pose) const {
    const Eigen::Vector3d moved = all[index].rest + rows(index).lazyProduct(pose.q);
    return pose.rotation * moved;
  }
};

/// Vertices of one body, a, near the surface of another, b, or its own, by a search that went farther than one step
/// needs: until the bodies have moved against each other by what it went farther, no step has to search again.
struct NearVertices {
  struct Found {
    int vertex = 0;
    double distance = 0;  ///< from the surface, inside or outside [m]
  };
  double radius = -1;        ///< all that were nearer than this are known [m]; negative: none is
  double farther = -1;       ///< most that the bodies may have moved by for that to hold [m]
  int served = 0;            ///< steps, by the last search
  int without = 0;           ///< so many more steps look for themselves: the last search did not serve enough
  std::vector<Found> found;  ///< in ascending order
  // Poses of the bodies in the search.
  Placement a_in_b;  ///< a in the frame of b
  Eigen::VectorXd q_a, q_b;
  VertexArray places_a, places_b;  ///< places() of bodies that ContactSet::move() moves [k x 3, m]; empty for others

  OwnSearch own;  ///< scratch for a body with itself
};

/// One body of a pair: what it is, where, and how it moves.
struct TouchingBody {
  const ContactSet& set;
  const TouchingSurface& touching;
  BodyPose pose;
  BodyVelocity velocity;
};

/// A reduced body at a pose as its contacts with others see it: where its vertices and points of its surface are, and
/// what forces there do to it. Arms are from its position, world [m]; columns are about world axes, as
/// ContactSet::add_stiffness() has them, `rigid` is 6 or 0.
struct ReducedSide {
  const ContactSet& set;
  const BodyPose& pose;
  int rigid = 0;

  const Eigen::Vector3d& position() const noexcept { return pose.position; }
  Eigen::Vector3d arm(int vertex) const noexcept { return set.world_arm(vertex, pose); }
  Eigen::Vector3d surface_arm(const BodyCandidates& candidates, std::size_t i) const noexcept {
    return candidates.surface_arm(i, pose);
  }
  void add_force(const BodyCandidate& candidate, ContactSums& sums) const noexcept {
    const Eigen::Vector3d force = pose.rotation.transpose() * candidate.force;
    sums.generalised += set.basis_rows(candidate.vertex).transpose().lazyProduct(force);
  }
  void add_surface_force(const BodyCandidates& candidates, std::size_t i, ContactSums& sums) const noexcept {
    const Eigen::Vector3d force = pose.rotation.transpose() * candidates.all[i].force;
    sums.generalised -= candidates.rows(i).transpose().lazyProduct(force);
  }
  Eigen::Index unknowns() const noexcept { return rigid + pose.q.size(); }
  template <class Column>
  void set_column(const BodyCandidate& candidate, const Eigen::Vector3d& direction, Column&& column) const {
    set_column(set.basis_rows(candidate.vertex), candidate.arm, direction, column);
  }
  template <class Column>
  void set_surface_column(const BodyCandidates& candidates, std::size_t i, const Eigen::Vector3d& direction,
                          Column&& column) const {
    set_column(candidates.rows(i), candidates.all[i].surface_arm, direction, column);
  }

 private:
  template <class Rows, class Column>
  void set_column(const Rows& rows, const Eigen::Vector3d& arm, const Eigen::Vector3d& direction,
                  Column& column) const {
    if (rigid > 0) column.template head<6>() << direction, arm.cross(direction);
    const Eigen::Vector3d turned = pose.rotation.transpose() * direction;
    column.tail(pose.q.size()) = rows.transpose().lazyProduct(turned);
  }
};

/// A search for the candidates of a step.
struct CandidateSearch {
  double time_step = 0;                      ///< [s]
  double margin = 0;                         ///< from the surface, outside [m]
  bool anew = false;                         ///< there is no last step
  const std::vector<HeldBodyContact>& held;  ///< vertices that were inside in the last step
  SurfaceShape& shape;                       ///< that of b, placed
  NearVertices& near;                        ///< found by earlier searches; the candidates are the same without
  /// The way by which a leaves b, world: way_out_of(a, b) where there is no last step, that of what overlaps after it.
  std::optional<Eigen::Vector3d> way_out{};
  double gravity = 0;  ///< [m/s^2]
};

/// The unit vector, world, along which `a` comes out of `b` soonest, axes of the bounding box of `a` taken. Nearest
/// points of the surface push vertices of bodies that lie deep in each other to all sides, and part nothing. With
/// `kept`, a way that serves already: that, unless another one is much shorter; without, none where it is less than a
/// quarter of its own thickness inside. way_out_of(b, a) may be another one.
std::optional<Eigen::Vector3d> way_out_of(const TouchingBody& a, const TouchingBody& b,
                                          const std::optional<Eigen::Vector3d>& kept = std::nullopt);

/// Contact of the vertices of one body, `a`, with the surface of another, `b`, which may be the same kind of body.
/// Forces are equal and opposite, at the vertex and at y. docs/step_in_detail.md, "Bodies that touch".
///
/// One step: gather, then evaluate, potential and add_stiffness as often as needed, then evaluate at the accepted poses
/// and commit. No call but gather() and commit() allocates, and these only where more is met than ever before.
class BodyContact {
 public:
  /// `law` of one direction: where both are looked at, each has half of the stiffness and damping.
  explicit BodyContact(const ContactLaw& law) : law_(law) {}

  /// Finds and freezes the candidates: vertices less than the margin outside, and those inside: that were so in the
  /// last step, or of any depth where there is none.
  void gather(const TouchingBody& a, const TouchingBody& b, const CandidateSearch& search,
              BodyCandidates& candidates) const;

  /// The same of a body with itself: vertices that parts of its surface which are farther away at rest have come near
  /// to from outside: nearer than the margin and two steps of the way that they go against each other; where these are
  /// fast, also one step of the fastest vertex, since what is hit may take its speed. What overlaps at the start never
  /// pushes.
  void gather_own(const TouchingBody& body, const CandidateSearch& search, BodyCandidates& candidates) const;

  // Sides A and B as ReducedSide.

  /// Adds forces, torques, potential and touching vertices to those of either body; the potential to a's alone. `way`:
  /// how far vertices and surface have gone, at most, from where they were when set_clearances() was called [m].
  template <class A, class B>
  void evaluate(const A& a, const B& b, double way, BodyCandidates& candidates, ContactSums& sums_a,
                ContactSums& sums_b) const noexcept;

  /// After the first evaluation: vertices that touch nothing are not looked at as long as they cannot have come near.
  void set_clearances(const BodyPose& a, const BodyPose& b, BodyCandidates& candidates) const noexcept;

  /// W alone [J].
  template <class A, class B>
  double potential(const A& a, const B& b, double way, const BodyCandidates& candidates) const noexcept;

  void refresh_friction(BodyCandidates& candidates, FrictionChange& change) const noexcept;

  /// -df/dx = J^T K J of the last evaluation, column by column: sqrt(w) J^T d of either body [unknowns() x columns].
  /// Returns the number of columns.
  template <class A, class B>
  static Eigen::Index stiffness_columns(const A& a, const B& b, const BodyCandidates& candidates,
                                        Eigen::MatrixXd& columns_a, Eigen::MatrixXd& columns_b);

  /// Stores what the next step has to remember of the last evaluation.
  void commit(const BodyPose& a, const BodyPose& b, const BodyCandidates& candidates,
              std::vector<HeldBodyContact>& held) const;

 private:
  ContactLaw law_;
};

template <class A, class B>
void BodyContact::evaluate(const A& a, const B& b, double way, BodyCandidates& candidates, ContactSums& sums_a,
                           ContactSums& sums_b) const noexcept {
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    BodyCandidate& candidate = candidates.all[i];
    if (candidate.clearance > way) {
      leave_untouched(candidate);
      continue;
    }
    candidate.arm = a.arm(candidate.vertex);
    candidate.surface_arm = b.surface_arm(candidates, i);
    const Eigen::Vector3d place = a.position() + candidate.arm - b.position() - candidate.surface_arm;
    const double potential = evaluate_contact(candidate.normal.dot(place), candidate.normal, place, candidate);
    if (!candidate.is_loaded()) continue;
    if (candidate.normal_force > 0) {
      ++sums_a.touching;
      ++sums_b.touching;
      sums_a.stiffness += candidate.normal_stiffness();
      sums_b.stiffness += candidate.normal_stiffness();
    }
    sums_a.force += candidate.force;
    sums_a.torque += candidate.arm.cross(candidate.force);
    a.add_force(candidate, sums_a);
    sums_a.potential += potential;
    sums_b.force -= candidate.force;
    sums_b.torque -= candidate.surface_arm.cross(candidate.force);
    b.add_surface_force(candidates, i, sums_b);
  }
}

template <class A, class B>
double BodyContact::potential(const A& a, const B& b, double way, const BodyCandidates& candidates) const noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    const BodyCandidate& candidate = candidates.all[i];
    if (candidate.clearance > way) continue;
    const Eigen::Vector3d place = a.position() + a.arm(candidate.vertex) - b.position() - b.surface_arm(candidates, i);
    sum += contact_potential(candidate, candidate.normal.dot(place), place);
  }
  return sum;
}

template <class A, class B>
Eigen::Index BodyContact::stiffness_columns(const A& a, const B& b, const BodyCandidates& candidates,
                                            Eigen::MatrixXd& columns_a, Eigen::MatrixXd& columns_b) {
  Eigen::Index needed = 0;  // most candidates touch nothing
  for (const BodyCandidate& candidate : candidates.all) needed += candidate.is_loaded() ? 3 : 0;
  const auto make_room = [needed](Eigen::Index rows, Eigen::MatrixXd& columns) {
    if (columns.rows() != rows || columns.cols() < needed) columns.resize(rows, 2 * needed);
  };
  make_room(a.unknowns(), columns_a);
  make_room(b.unknowns(), columns_b);
  Eigen::Index used = 0;
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    const BodyCandidate& candidate = candidates.all[i];
    if (!candidate.is_loaded()) continue;
    const StiffnessFactors factors(candidate);
    for (int k = 0; k < factors.count; ++k, ++used) {
      a.set_column(candidate, factors.columns.col(k), columns_a.col(used));
      b.set_surface_column(candidates, i, factors.columns.col(k), columns_b.col(used));
    }
  }
  return used;
}

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/contact/own_search.h"
#include "runtime/sim/contact/touching_surface.h"

namespace exmat::runtime {

/// What a vertex that is inside another body remembers from step to step.
struct HeldBodyContact {
  int vertex = 0;
  double gap = 0;                                     ///< at the end of the last step [m]
  double normal_force = 0;                            ///< likewise [N]
  Eigen::Vector3d stretch = Eigen::Vector3d::Zero();  ///< of the tangential spring, frame of the other body [m]
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();   ///< of the side that it came in by, frame of the other body
  double overlap = 0;                                 ///< that is not released yet [m]
};

/// A vertex of one body that may touch the surface of another in this step. Its law is that of contact_law.h with the
/// place of the vertex from the surface's material point y in place of its place in the world; point and normal are
/// those of the beginning of the step.
struct BodyCandidate : ContactCandidate {
  Eigen::Vector3d rest = Eigen::Vector3d::Zero();         ///< of y, frame of the other body [m]
  Eigen::Vector3d surface_arm = Eigen::Vector3d::Zero();  ///< y - position of the other body [m]; last evaluation
};

/// Candidates of a pair of bodies, one's vertices against the other's surface. Grows where more are met than before.
struct BodyCandidates {
  std::vector<BodyCandidate> all;
  RowMatrix basis;  ///< 3 of `all` x r and more, rows of the basis at each y
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
  double farther = -1;       ///< what the bodies may have moved by for that to hold [m]
  int served = 0;            ///< steps, by the last search
  int without = 0;           ///< so many more steps look for themselves: the last search did not serve enough
  std::vector<Found> found;  ///< in ascending order
  // Where the bodies were.
  Placement a_in_b;  ///< a in the frame of b
  Eigen::VectorXd q_a, q_b;

  OwnSearch own;  ///< of a body with itself: scratch
};

/// One body of a pair: what it is, where, and how it moves.
struct TouchingBody {
  const ContactSet& set;
  const TouchingSurface& touching;
  BodyPose pose;
  BodyVelocity velocity;
};

/// A search for the candidates of a step.
struct CandidateSearch {
  double time_step = 0;                      ///< [s]
  double margin = 0;                         ///< from the surface, outside [m]
  bool anew = false;                         ///< there is no last step
  const std::vector<HeldBodyContact>& held;  ///< vertices that were inside in the last step
  SurfaceShape& shape;                       ///< that of b, placed
  NearVertices& near;                        ///< found by earlier searches; the candidates are the same without
};

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

  /// Adds forces, torques, potential and touching vertices to those of either body; the potential to a's alone. `way`:
  /// how far vertices and surface have gone, at most, from where they were when set_clearances() was called [m].
  void evaluate(const ContactSet& set, const BodyPose& a, const BodyPose& b, double way, BodyCandidates& candidates,
                ContactSums& sums_a, ContactSums& sums_b) const noexcept;

  /// After the first evaluation: vertices that touch nothing are not looked at as long as they cannot have come near.
  void set_clearances(const BodyPose& a, const BodyPose& b, BodyCandidates& candidates) const noexcept;

  /// W alone [J].
  double potential(const ContactSet& set, const BodyPose& a, const BodyPose& b, double way,
                   const BodyCandidates& candidates) const noexcept;

  void refresh_friction(BodyCandidates& candidates, FrictionChange& change) const noexcept;

  /// -df/dx = J^T K J at the poses, column by column: sqrt(w) J^T d of either body [(rigid + r) x columns], about
  /// world axes as ContactSet::add_stiffness() has them. `rigid` of each is 6 or 0. Returns the number of columns.
  static Eigen::Index stiffness_columns(const ContactSet& set, int rigid_a, int rigid_b, const BodyPose& a,
                                        const BodyPose& b, const BodyCandidates& candidates, Eigen::MatrixXd& columns_a,
                                        Eigen::MatrixXd& columns_b);

  /// What has to be remembered of the last evaluation.
  void commit(const BodyPose& a, const BodyPose& b, const BodyCandidates& candidates,
              std::vector<HeldBodyContact>& held) const;

 private:
  ContactLaw law_;
};

}  // namespace exmat::runtime

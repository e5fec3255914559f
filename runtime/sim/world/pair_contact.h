#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "runtime/sim/contact/body_contact.h"
#include "runtime/sim/world/pair_attachment.h"
#include "runtime/sim/world/world_body.h"

namespace exmat::runtime {

/// Memory of two bodies' contacts from step to step.
struct HeldPair {
  int first = 0, second = 0;                           ///< bodies, first < second
  std::array<std::vector<HeldBodyContact>, 2> held{};  ///< the first's vertices, the second's vertices
  double energy = 0;                                   ///< springs of all contacts at the end of the last step [J]
  double account = 0;  ///< the most that they may hold where the next step begins [J]; not finite: what they do hold

  /// True if some vertices have not left what they overlapped at the start.
  bool overlaps() const noexcept { return overlap(held[0]) || overlap(held[1]); }
};

/// A vertex of one body that touched the surface of another, or of its own, at the end of a step.
struct BodyTouch {
  int body = 0, other = 0;                             ///< numbers in the world
  int vertex = 0;                                      ///< vertex of the body's object
  double depth = 0;                                    ///< [m]; negative where damping alone acts
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< the vertex, world [m]
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< unit, away from the other
  Eigen::Vector3d force = Eigen::Vector3d::Zero();     ///< on the body [N]; the other has its negative
};

/// Two bodies that may touch in a step, or a body that may touch itself: each one's vertices against the other's
/// surface, with half of the law. Two bodies that are attached to each other are a pair, too, without contacts.
///
/// A pair keeps an account of its energy: what its contacts took from the bodies and have not given back. Where a step
/// begins vertices come in and normals turn, so that springs would hold what nobody put into them: those that push are
/// softened for the step until they hold no more than the account. What overlaps at the start adds what is released of
/// it. docs/step_in_detail.md, "Energy of contacts".
class PairContact {
 public:
  /// Forgets the contacts of earlier bodies.
  void forget() noexcept {
    for (NearVertices& near : near_) {
      near.radius = -1;
      near.without = 0;
    }
  }
  /// Bodies and what they remember; nothing is met yet.
  void reset(int first, int second, const HeldPair* held);
  /// After that: an attachment of the body of this side to the other.
  void attach(Attachment& attachment, int side, const WorldBody& first, const WorldBody& second);

  /// Its bodies are called by these numbers from now on.
  void number(int first, int second) noexcept { bodies_ = {first, second}; }
  /// True for a body with itself: contacts of the first side alone, and without coupling.
  bool is_own() const noexcept { return bodies_[0] == bodies_[1]; }
  int body(int side) const noexcept { return bodies_[static_cast<std::size_t>(side)]; }
  bool touched() const noexcept {  ///< in the last step
    return held_ != nullptr && !(held_->held[0].empty() && held_->held[1].empty());
  }
  bool empty() const noexcept {
    return candidates_[0].all.empty() && candidates_[1].all.empty() && attachment_count_ == 0;
  }
  std::span<PairAttachment> attachments() noexcept { return {attachments_.data(), attachment_count_}; }
  std::span<const PairAttachment> attachments() const noexcept { return {attachments_.data(), attachment_count_}; }

  /// The candidates of one side's vertices; the other's surface is placed. `margin` [m].
  void gather(const ContactLaw& law, int side, const WorldBody& own, WorldBody& other, double margin);

  /// After gather() of both sides: the account, by which springs are softened. Releasing overlaps adds to it.
  void begin_account() noexcept;
  /// After the step, evaluated at its end: what it has done to the account; `parted` is the velocity of the first's
  /// centre of mass against the second's, less what it was where the step began [m/s]. `converged`: the bodies go as
  /// the forces say.
  void end_account(const WorldBody& first, const WorldBody& second, const Eigen::Vector3d& parted,
                   bool converged) noexcept;
  void scale_account(double share) noexcept { account_ *= share; }
  double account() const noexcept { return account_; }            ///< [J]
  double start_energy() const noexcept { return start_energy_; }  ///< springs at the start of the step [J]
  double spring_energy() const noexcept;                          ///< at the last evaluation [J]
  double attached_energy() const noexcept;                        ///< likewise that of the springs of attachments
  /// The step was not taken: the pair remembers what it did before.
  void abandon() noexcept { is_abandoned_ = true; }

  // At the iterates of the bodies.

  void evaluate(const WorldBody& first, const WorldBody& second);
  double potential(const WorldBody& first, const WorldBody& second) noexcept;
  const ContactSums& sums(int side) const noexcept { return sums_[static_cast<std::size_t>(side)]; }
  /// Adds what the springs of attachments do to a side's body.
  void add_springs(int side, ContactSums& sums) const noexcept;

  /// Stiffness as products of columns, about world axes.
  void set_columns(const WorldBody& first, const WorldBody& second);
  /// Adds the stiffness of one side's own unknowns about world axes, lower triangle.
  void add_stiffness(int side, Eigen::MatrixXd& stiffness) const;
  /// After that: the stiffness between the unknowns of the two, `x` of each.
  void set_coupling(const WorldBody& first, const Eigen::VectorXd& x_first, const WorldBody& second,
                    const Eigen::VectorXd& x_second);
  const Eigen::MatrixXd& coupling() const noexcept { return coupling_; }  ///< first's unknowns x second's

  // With one of the two in full space, or both; coupling() is empty then.

  /// Subtracts the forces on a side's body, in full space, from its gradient. Returns the square of their norm [N^2].
  double add_forces(int side, WorldBody& own) const;
  /// Adds what pushes the vertices of such a body to its blocks.
  void add_blocks(int side, WorldBody& own) const;
  /// After set_coupling(): how far `x` moves the two along the columns, of each of them once for both.
  void set_ways(const WorldBody& first, const Eigen::Ref<const Eigen::VectorXd>& x_first, const WorldBody& second,
                const Eigen::Ref<const Eigen::VectorXd>& x_second);
  /// After that: adds to the product of the Hessian with this x the part of a side's body; of a reduced one that of the
  /// other's x alone.
  void add_product(int side, const WorldBody& body, Eigen::Ref<Eigen::VectorXd> product) const;

  void refresh_friction(FrictionChange& change) noexcept;

  /// Torque to add on either body [N m], if both move freely, so that the angular momentum of the two stays what it is:
  /// forces act at points that are apart by the gap and the slip, and momenta are taken about centres of mass that go
  /// on during the step by `way_first` and `way_second` [m].
  Eigen::Vector3d torque_correction(const WorldBody& first, const Eigen::Vector3d& way_first, const WorldBody& second,
                                    const Eigen::Vector3d& way_second) const noexcept;

  /// Adds those of one side's vertices, those of `own`; the numbers are of the world.
  void read_touches(int side, const WorldBody& own, int number, int other, std::vector<BodyTouch>& touches) const;

  /// The contacts alone, into `held`.
  void commit(const WorldBody& first, const WorldBody& second, HeldPair& held) const;

 private:
  /// Calls work(at, is_vertex) for each list of candidates that a side's body is part of: by its vertices, or by y.
  template <class Work>
  void for_parts(int side, const Work& work) const {
    const auto at = static_cast<std::size_t>(side);
    work(at, /*is_vertex=*/true);
    work(is_own() ? at : 1 - at, /*is_vertex=*/false);
  }
  /// Calls work(candidate, place, share) for each vertex of a side's body that a loaded candidate pushes.
  template <class Work>
  void for_full(int side, const FullMember& member, const Work& work) const;
  void set_directions();
  void add_spring_columns();
  /// Bound on the way of vertices of one and the surface of the other since the first evaluation [m].
  double way_since_first(const WorldBody& first, const WorldBody& second) const noexcept;

  std::array<int, 2> bodies_{};
  const HeldPair* held_ = nullptr;
  ContactLaw half_;
  double account_ = 0, start_energy_ = 0, released_ = 0;
  bool is_abandoned_ = false;
  bool has_first_ = false;  // evaluation; where the bodies were in it
  std::array<Placement, 2> first_{};
  std::array<Eigen::VectorXd, 2> first_q_;
  std::vector<PairAttachment> attachments_;  // the first of them, those of the step
  std::size_t attachment_count_ = 0;
  std::array<NearVertices, 2> near_{};
  std::array<BodyCandidates, 2> candidates_;  // vertices of the first, of the second
  std::array<ContactSums, 2> sums_;           // of the first, of the second
  // Columns of the candidates of each, of the side's body and of the other.
  std::array<Eigen::MatrixXd, 2> own_columns_, other_columns_;
  std::array<Eigen::Index, 2> used_{};
  /// Direction in a column, times the root of its stiffness, and its candidate.
  struct Direction {
    Eigen::Vector3d direction;
    std::size_t candidate;
  };
  // Columns with a body in full space: the directions, and the ways of the vertex and against it of y.
  std::array<std::vector<Direction>, 2> directions_;
  std::array<Eigen::Matrix2Xd, 2> ways_;
  Eigen::MatrixXd coupling_;
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/core/decompositions.h"
#include "runtime/sim/solver/conditions.h"
#include "runtime/sim/solver/newton.h"
#include "runtime/sim/world/island_momenta.h"
#include "runtime/sim/world/pair_contact.h"

namespace exmat::runtime {

/// An attachment between two bodies of an island that is a condition.
struct HardAttachment {
  const PairContact* pair = nullptr;
  PairAttachment* attachment = nullptr;
};

/// Kinetic, elastic and potential energy of bodies together, and that of springs between them [J].
struct IslandEnergy {
  double kinetic = 0, total = 0;
};

/// Energy of an island where a step begins [J].
struct IslandStart {
  IslandEnergy bodies;
  double springs = 0;     ///< energy of all contacts between them
  double accounts = 0;    ///< the most that these may ever give back
  bool isolated = false;  ///< nothing but gravity, they themselves and obstacles that stand still changes their energy
  double obstacles = 0;   ///< energy of the springs of obstacles
};

/// Scratch of the steps of islands; grows, holds nothing from step to step.
struct IslandWorkspace {
  NewtonWorkspace newton;
  Eigen::VectorXd x;
  Eigen::VectorXd trial;                         ///< another start
  std::vector<PotentialEvaluation> evaluations;  ///< one per body
  std::vector<PotentialValue> values;            ///< one per body, then one per pair
  std::vector<Eigen::VectorXd> unknowns;         ///< one per body
  Eigen::VectorXd right;  ///< right-hand side of conjugate gradients, where bodies are in full space
  IslandBegin begin;
  IslandStart start;
  std::vector<FrameMomenta> from_others;  ///< force and torque of other bodies on each

  // Linear solutions.
  Eigen::MatrixXd dense;  ///< all unknowns of a small island, lower triangle
  AlignedArray factor, right_side;
  Eigen::VectorXd residual, preconditioned, direction, product;

  std::vector<HardAttachment> hard;  ///< those whose conditions follow, in their order, two blocks for each
  std::vector<int> framed;           ///< bodies that frames hold by conditions, which follow these, a block for each
  Conditions conditions;
  Eigen::MatrixXd mobility;  ///< one for each: see settle()
  Eigen::PartialPivLU<Eigen::MatrixXd> mobility_factor;
};

/// The pairs that a body of an island is in.
struct Incidence {
  int pair = 0;  ///< index in the island's pairs
  int side = 0;  ///< which of the pair's bodies it is
};

/// Bodies that touch in a step and the contacts between them: what one step of all of them minimises, the sum of their
/// own potentials and that of the contacts, in the unknowns of all. For newton_minimise. Small islands are factorised;
/// larger ones, and those with bodies in full space, solve by conjugate gradients, preconditioned by the factors of the
/// bodies' own Hessians or what stands for them. Hard attachments of bodies to each other and to frames are Conditions,
/// whose A are the bodies' own Hessians. Sums are taken in the order of bodies and pairs, whatever the number of
/// threads.
class IslandProblem {
 public:
  static constexpr bool kSeeksLowest = true;

  /// Bodies after start_contact(). `incidences[i]` are those of body i.
  IslandProblem(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                std::span<const std::vector<Incidence>> incidences, int threads, IslandWorkspace& workspace);

  /// True if attachments hold some of its bodies by conditions.
  bool has_hard() const noexcept { return workspace_.conditions.conditions() > 0; }

  /// With hard attachments: the Hessian at the first iterate `x`, factorised, and x where they hold. False where
  /// nothing leads there.
  bool begin(Eigen::VectorXd& x, NewtonReport& report) noexcept;

  /// As PairAttachment::loosen(), of all hard attachments.
  void loosen(Eigen::Index most);

  PotentialEvaluation evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) noexcept;
  PotentialEvaluation evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept;
  PotentialValue value(Eigen::VectorXd& x) noexcept;
  void hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& hessian) noexcept;
  void accept(PotentialEvaluation& evaluation) noexcept;

  bool factorise() noexcept;
  void shift(double share) noexcept;  ///< the Hessians of the bodies, each by its own diagonal
  void solve(Eigen::Map<Eigen::VectorXd>& x) noexcept;

  double rough_tolerance() const noexcept;  ///< see minimise_with_friction()

  int conjugate_gradients() const noexcept { return conjugate_gradients_; }  ///< iterations so far

 private:
  WorldBody& body(std::size_t i) const noexcept { return *bodies_[i]; }
  const WorldBody& first(const PairContact& pair) const noexcept;
  const WorldBody& second(const PairContact& pair) const noexcept;
  void place(const Eigen::VectorXd& x) noexcept;
  void collect_hard();
  template <class Use>
  void for_framed(const Use& use) const;
  double set_conditions(const Eigen::VectorXd& x) noexcept;
  void set_condition_directions() noexcept;
  bool hold(Eigen::VectorXd& x) noexcept;
  double take_condition_forces(Eigen::VectorXd& gradient) noexcept;
  PotentialEvaluation evaluate_all(const Eigen::VectorXd& x, bool is_first, Eigen::VectorXd& gradient) noexcept;
  PotentialEvaluation finish_full(std::size_t i, PotentialEvaluation evaluation) const noexcept;
  void assemble() noexcept;
  void assemble_dense() noexcept;
  void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& product) const noexcept;
  void precondition(const Eigen::VectorXd& residual, Eigen::VectorXd& result) noexcept;
  bool project() noexcept;
  void solve_by_gradients(Eigen::Map<Eigen::VectorXd>& x) noexcept;

  std::span<WorldBody* const> bodies_;
  std::span<PairContact* const> pairs_;
  std::span<const std::vector<Incidence>> incidences_;
  int threads_;
  IslandWorkspace& workspace_;
  Eigen::Index unknowns_ = 0;
  double tolerance_;        ///< tolerance of Newton's method
  double force_scale_ = 0;  ///< of the last evaluation
  bool has_full_, is_projected_ = false;
  bool is_dense_ = false;
  int conjugate_gradients_ = 0;
};

/// Solves a step of the bodies of an island, from BodyStep's begin() on. Their states stay, and the report is Newton's,
/// the same for all of them.
NewtonReport begin_island_step(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                               std::span<const std::vector<Incidence>> incidences, int threads,
                               IslandWorkspace& workspace);
/// Takes that step, whatever came out, up to the bodies' reports; they fall asleep together.
NewtonReport end_island_step(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                             std::span<const std::vector<Incidence>> incidences, NewtonReport newton,
                             IslandWorkspace& workspace);

}  // namespace exmat::runtime

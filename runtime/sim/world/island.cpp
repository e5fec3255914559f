#include "runtime/sim/world/island.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/sim/step/attached_problem.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/sleep.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/for_all.h"

namespace exmat::runtime {
namespace {

constexpr Eigen::Index kDenseUnknowns = 160;  // a factorisation of more takes longer than conjugate gradients
constexpr double kSolutionError = 1e-3;       // of conjugate gradients, in the norm of the preconditioner
// Where Newton's method is about to end: this share of the residual that it ends at, and no more than kLeastExact.
constexpr double kShareOfLimit = 0.3, kLeastExact = 0.1;
// Normal forces are known well enough for friction (kSameFriction) long before the residual has come to its limit.
constexpr double kRoughTolerance = 0.03;
constexpr int kMostGradients = 400;
constexpr int kSureIterations = 8;  // of Newton's method: bodies at rest take fewer
// Likewise where bodies step in all vertices: each of their iterations costs as much as many of others.
constexpr double kFullSolutionError = 0.03;

bool has_full(std::span<WorldBody* const> bodies) noexcept {
  return std::ranges::any_of(bodies, [](const WorldBody* own) { return own->full != nullptr; });
}

/// Those of the first body, or of the first in full space.
const NewtonSettings& newton_of(std::span<WorldBody* const> bodies) noexcept {
  for (const WorldBody* const own : bodies)
    if (own->full) return own->scene().space.newton;
  return bodies.front()->scene().newton;
}

}  // namespace

IslandProblem::IslandProblem(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                             std::span<const std::vector<Incidence>> incidences, int threads,
                             IslandWorkspace& workspace)
    : bodies_(bodies),
      pairs_(pairs),
      incidences_(incidences),
      threads_(threads),
      workspace_(workspace),
      tolerance_(newton_of(bodies).tolerance),
      has_full_(has_full(bodies)) {
  workspace.unknowns.resize(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    body(i).offset = unknowns_;
    workspace.unknowns[i].resize(body(i).unknowns());
    unknowns_ += body(i).unknowns();
  }
  collect_hard();
  is_dense_ = unknowns_ <= kDenseUnknowns && !has_full_ && !has_hard();
  workspace.newton.resize_vectors(unknowns_);
  workspace.x.resize(unknowns_);
  workspace.evaluations.resize(bodies.size());
  workspace.values.resize(bodies.size() + pairs.size());
  for (Eigen::VectorXd* vector :
       {&workspace.residual, &workspace.preconditioned, &workspace.direction, &workspace.product})
    vector->resize(unknowns_);
  if (!is_dense_) return;
  workspace.dense.resize(unknowns_, unknowns_);
  if (workspace.factor.size() < unknowns_ * padded(unknowns_)) {
    workspace.factor = AlignedArray(unknowns_ * padded(unknowns_));
    workspace.right_side = AlignedArray(unknowns_);
  }
}

const WorldBody& IslandProblem::first(const PairContact& pair) const noexcept {
  return body(static_cast<std::size_t>(pair.body(0)));
}
const WorldBody& IslandProblem::second(const PairContact& pair) const noexcept {
  return body(static_cast<std::size_t>(pair.body(1)));
}

/// x of each body, and its placement and q there.
void IslandProblem::place(const Eigen::VectorXd& x) noexcept {
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    workspace_.unknowns[i] = x.segment(body(i).offset, body(i).unknowns());
    if (!body(i).full) body(i).placement = body(i).problem->place(workspace_.unknowns[i]);
  });
}

/// Calls use(body, its block of conditions) for those that frames hold.
template <class Use>
void IslandProblem::for_framed(const Use& use) const {
  for (std::size_t k = 0; k < workspace_.framed.size(); ++k)
    use(body(static_cast<std::size_t>(workspace_.framed[k])),
        workspace_.conditions.blocks[2 * workspace_.hard.size() + k]);
}

/// Hard attachments, and a block of conditions for either body of each, or for all frames of a body.
void IslandProblem::collect_hard() {
  workspace_.hard.clear();
  for (PairContact* const pair : pairs_)
    for (PairAttachment& own : pair->attachments())
      if (own.conditions() > 0) workspace_.hard.push_back({pair, &own});
  workspace_.framed.clear();
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (!body(i).full && holds_hard(body(i).state.attachments)) workspace_.framed.push_back(static_cast<int>(i));
  Conditions& conditions = workspace_.conditions;
  conditions.blocks.resize(2 * workspace_.hard.size() + workspace_.framed.size());
  Eigen::Index count = 0;
  for (std::size_t k = 0; k < workspace_.hard.size(); ++k) {
    const auto& [pair, own] = workspace_.hard[k];
    for (const int side : {0, 1}) {
      ConditionBlock& block = conditions.blocks[2 * k + static_cast<std::size_t>(side)];
      const WorldBody& held = body(static_cast<std::size_t>(pair->body(side)));
      block.offset = held.offset;
      block.first = count;
      block.directions.setZero(held.unknowns(), own->conditions());
    }
    count += own->conditions();
  }
  for_framed([&](const WorldBody& held, ConditionBlock& block) {
    block.offset = held.offset;
    block.first = count;
    block.directions.setZero(held.unknowns(), held.near().held.conditions());
    count += held.near().held.conditions();
  });
  conditions.resize(count);
}

void IslandProblem::loosen(Eigen::Index most) {
  for (const HardAttachment& hard : workspace_.hard) hard.attachment->loosen(most);
  collect_hard();
}

/// At x; returns how far the bodies are from the origin [m].
double IslandProblem::set_conditions(const Eigen::VectorXd& x) noexcept {
  place(x);
  double extent = 0;
  for (std::size_t k = 0; k < workspace_.hard.size(); ++k) {
    const auto& [pair, own] = workspace_.hard[k];
    own->evaluate(first(*pair), second(*pair));
    for (const int side : {0, 1}) {
      const auto index = static_cast<std::size_t>(pair->body(side));
      const WorldBody& held = body(index);
      ConditionBlock& block = workspace_.conditions.blocks[2 * k + static_cast<std::size_t>(side)];
      block.gradients = own->gradients(side).leftCols(own->conditions());
      if (held.rigid() > 0) {
        const Eigen::Matrix3d turn = held.model.frame->turn_to_world(workspace_.unknowns[index], held.placement);
        for (Eigen::Index i = 0; i < own->conditions(); ++i) {
          const Eigen::Vector3d turned = turn.transpose() * block.gradients.block<3, 1>(3, i);
          block.gradients.block<3, 1>(3, i) = turned;
        }
      }
      workspace_.conditions.violation.segment(block.first, own->conditions()) =
          own->violation().head(own->conditions());
      extent = std::max(extent, held.placement.position.norm());
    }
  }
  for_framed([&](WorldBody& held, ConditionBlock& block) {
    AttachmentWorkspace& own = held.near().held;
    const Eigen::VectorXd own_x = x.segment(held.offset, held.unknowns());
    runtime::set_conditions(held.state.attachments, *held.model.frame, own_x, held.pose(), own);
    block.gradients = own.gradients();
    workspace_.conditions.violation.segment(block.first, own.conditions()) = own.violation;
    extent = std::max(extent, held.placement.position.norm());
  });
  return extent;
}

void IslandProblem::set_condition_directions() noexcept {
  const auto set = [](WorldBody& held, ConditionBlock& block) {
    NewtonWorkspace& factors = held.near().newton;
    Eigen::Map<Eigen::VectorXd> column(factors.direction.data(), block.gradients.rows());
    for (Eigen::Index i = 0; i < block.gradients.cols(); ++i) {
      column = block.gradients.col(i);
      kernels().cholesky_solve(factors.factor.data(), column.size(), factors.direction.data());
      block.directions.col(i) = column;
    }
  };
  for (std::size_t k = 0; k < 2 * workspace_.hard.size(); ++k) {
    const PairContact& pair = *workspace_.hard[k / 2].pair;
    set(body(static_cast<std::size_t>(pair.body(static_cast<int>(k % 2)))), workspace_.conditions.blocks[k]);
  }
  for_framed(set);
  workspace_.conditions.factorise();
}

bool IslandProblem::hold(Eigen::VectorXd& x) noexcept {
  return !has_hard() ||
         workspace_.conditions.hold(x, [this](const Eigen::VectorXd& there) { return set_conditions(there); });
}

/// After the bodies were evaluated: the gradient of the Lagrangian, and loads of the attachments on the bodies. Returns
/// the size of these in the units of the residual.
double IslandProblem::take_condition_forces(Eigen::VectorXd& gradient) noexcept {
  if (!has_hard()) return 0;
  Conditions& conditions = workspace_.conditions;
  conditions.subtract_forces(gradient);
  double squares = 0;
  for (std::size_t k = 0; k < workspace_.hard.size(); ++k) {
    const auto& [pair, own] = workspace_.hard[k];
    const auto multipliers = conditions.multipliers.segment(conditions.blocks[2 * k].first, own->conditions());
    own->set_multipliers(multipliers);
    for (const int side : {0, 1}) {
      WorldBody& held = body(static_cast<std::size_t>(pair->body(side)));
      own->add_load(side, held.near().held.sums);
      const Eigen::MatrixXd& gradients = conditions.blocks[2 * k + static_cast<std::size_t>(side)].gradients;
      squares += std::pow(held.model.frame->residual_of(multipliers.head<3>()), 2) +
                 gradients.bottomRows(held.state.q.size()).lazyProduct(multipliers).squaredNorm();
    }
  }
  for_framed([&](WorldBody& held, const ConditionBlock& block) {
    AttachmentWorkspace& own = held.near().held;
    own.multipliers = conditions.multipliers.segment(block.first, own.conditions());
    add_condition_forces(held.state.attachments, held.pose(), own);
    squares += std::pow(held.model.frame->residual_of(own.sums.force), 2) +
               block.gradients.bottomRows(held.state.q.size()).lazyProduct(own.multipliers).squaredNorm();
  });
  return std::sqrt(squares);
}

bool IslandProblem::begin(Eigen::VectorXd& x, NewtonReport& report) noexcept {
  if (!has_hard()) return true;
  set_conditions(x);  // the directions are of an earlier x: it is not held yet
  evaluate_all(x, /*is_first=*/true, workspace_.newton.gradient);
  assemble();
  if (!detail::factorise(*this, workspace_.newton, report)) {
    ++report.projections;
    hessian(x, Tangent::kPositiveSemidefinite, workspace_.newton.hessian);
    if (!detail::factorise_shifted(*this, workspace_.newton, report)) return false;
  }
  return hold(x) && x.allFinite();
}

/// Gradient of a body in full space with what pairs add.
PotentialEvaluation IslandProblem::finish_full(std::size_t i, PotentialEvaluation evaluation) const noexcept {
  WorldBody& own = body(i);
  double squares = 0, stiffness = 0;
  for (const auto& [index, side] : incidences_[i]) {
    const PairContact& pair = *pairs_[static_cast<std::size_t>(index)];
    squares += pair.add_forces(side, own);
    stiffness += pair.sums(side).stiffness;
    evaluation.potential.value += pair.sums(side).potential;
    evaluation.potential.magnitude += pair.sums(side).potential;
  }
  evaluation.force_scale += std::sqrt(squares) + kPlaceRounding * own.full->reach() * stiffness / tolerance_;
  return evaluation;
}

PotentialEvaluation IslandProblem::evaluate_all(const Eigen::VectorXd& x, bool is_first,
                                                Eigen::VectorXd& gradient) noexcept {
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    Eigen::VectorXd& own = workspace_.unknowns[i];
    own = x.segment(body(i).offset, body(i).unknowns());
    if (body(i).full) {
      workspace_.evaluations[i] = body(i).full->evaluate(own, /*started=*/is_first);
      body(i).placement = body(i).full->placement();
      return;
    }
    workspace_.evaluations[i] = body(i).problem->evaluate_alone(own, is_first);
    body(i).placement = body(i).problem->place(own);
  });
  for_all(pairs_.size(), threads_, [&](std::size_t p) { pairs_[p]->evaluate(first(*pairs_[p]), second(*pairs_[p])); });
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    WorldBody& own = body(i);
    if (own.full) {
      workspace_.evaluations[i] = finish_full(i, workspace_.evaluations[i]);
      gradient.segment(own.offset, own.unknowns()) = own.full->gradient();
      return;
    }
    for (const auto& [pair, side] : incidences_[i]) {
      own.near().contact.add(pairs_[static_cast<std::size_t>(pair)]->sums(side));
      pairs_[static_cast<std::size_t>(pair)]->add_springs(side, own.near().held.sums);
    }
    Eigen::VectorXd& part = own.near().newton.gradient;
    workspace_.evaluations[i] = own.problem->finish(workspace_.unknowns[i], workspace_.evaluations[i], part);
    gradient.segment(own.offset, own.unknowns()) = part;
  });
  PotentialEvaluation sum;
  double squares = 0;
  for (const PotentialEvaluation& evaluation : workspace_.evaluations) {
    sum.potential.value += evaluation.potential.value;
    sum.potential.magnitude += evaluation.potential.magnitude;
    squares += evaluation.force_scale * evaluation.force_scale;
  }
  sum.force_scale = force_scale_ = std::sqrt(squares) + take_condition_forces(gradient);
  return sum;
}

PotentialEvaluation IslandProblem::evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient,
                                            Eigen::MatrixXd& /*hessian*/) noexcept {
  const bool held = hold(x);
  PotentialEvaluation evaluation = evaluate_all(x, /*is_first=*/true, gradient);
  if (!held) evaluation.potential.value = kNowhere;
  for (WorldBody* const own : bodies_)
    if (!own->full) evaluation.potential.value += own->model.frame->accept_rigid(own->workspace.frame);
  assemble();
  return evaluation;
}

PotentialEvaluation IslandProblem::evaluate(Eigen::VectorXd& x, Eigen::VectorXd& gradient) noexcept {
  const bool held = hold(x);
  PotentialEvaluation evaluation = evaluate_all(x, /*is_first=*/false, gradient);
  if (!held) evaluation.potential.value = kNowhere;
  return evaluation;
}

PotentialValue IslandProblem::value(Eigen::VectorXd& x) noexcept {
  if (!hold(x)) return {kNowhere, 0};
  const std::size_t bodies = bodies_.size();
  for_all(bodies, threads_, [&](std::size_t i) {
    Eigen::VectorXd& own = workspace_.unknowns[i];
    own = x.segment(body(i).offset, body(i).unknowns());
    if (body(i).full) {
      workspace_.values[i] = body(i).full->value(own);
      body(i).placement = body(i).full->placement();
      return;
    }
    workspace_.values[i] = body(i).problem->value(own);
    body(i).placement = body(i).problem->place(own);
  });
  for_all(pairs_.size(), threads_, [&](std::size_t p) {
    const double potential = pairs_[p]->potential(first(*pairs_[p]), second(*pairs_[p]));
    workspace_.values[bodies + p] = {potential, std::abs(potential)};
  });
  PotentialValue sum;
  for (const PotentialValue& value : workspace_.values) {
    sum.value += value.value;
    sum.magnitude += value.magnitude;
  }
  return sum;
}

void IslandProblem::hessian(const Eigen::VectorXd& x, Tangent tangent, Eigen::MatrixXd& /*hessian*/) noexcept {
  has_hard() ? static_cast<void>(set_conditions(x)) : place(x);
  is_projected_ = tangent != Tangent::kExact;
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    if (body(i).full)
      body(i).full->start(workspace_.unknowns[i], tangent);
    else
      body(i).problem->evaluate_elastic_hessian(body(i).pose(), tangent);
  });
  assemble();
}

void IslandProblem::accept(PotentialEvaluation& evaluation) noexcept {
  for (WorldBody* const own : bodies_)
    if (!own->full) own->problem->accept(evaluation);
}

/// Own Hessians of the bodies, in their own workspaces, and the couplings of the pairs, at the poses of the last
/// evaluation.
void IslandProblem::assemble() noexcept {
  for_all(pairs_.size(), threads_,
          [&](std::size_t p) { pairs_[p]->set_columns(first(*pairs_[p]), second(*pairs_[p])); });
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    WorldBody& own = body(i);
    if (own.full) {
      own.full->begin_blocks();
      for (const auto& [pair, side] : incidences_[i]) pairs_[static_cast<std::size_t>(pair)]->add_blocks(side, own);
      own.full->end_blocks();
      return;
    }
    own.problem->start_stiffness(own.pose());
    for (const auto& [pair, side] : incidences_[i])
      pairs_[static_cast<std::size_t>(pair)]->add_stiffness(side, own.near().stiffness);
    own.problem->finish_hessian(own.pose(), workspace_.unknowns[i], own.near().newton.hessian);
  });
  for_all(pairs_.size(), threads_, [&](std::size_t p) {
    const auto x_of = [&](int side) -> const Eigen::VectorXd& {
      return workspace_.unknowns[static_cast<std::size_t>(pairs_[p]->body(side))];
    };
    pairs_[p]->set_coupling(first(*pairs_[p]), x_of(0), second(*pairs_[p]), x_of(1));
  });
}

void IslandProblem::assemble_dense() noexcept {
  Eigen::MatrixXd& A = workspace_.dense;
  A.setZero();
  for (const WorldBody* const own : bodies_)
    A.block(own->offset, own->offset, own->unknowns(), own->unknowns()) = own->near().newton.hessian;
  for (const PairContact* const pair : pairs_) {
    if (pair->is_own()) continue;
    const WorldBody &a = first(*pair), &b = second(*pair);
    A.block(b.offset, a.offset, b.unknowns(), a.unknowns()) += pair->coupling().transpose();
  }
}

bool IslandProblem::factorise() noexcept {
  if (is_dense_) {
    assemble_dense();
    return kernels().cholesky(workspace_.dense.data(), unknowns_, unknowns_, workspace_.factor.data());
  }
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    if (body(i).full) {
      workspace_.values[i].value = 1;
      return;
    }
    NewtonWorkspace& own = body(i).near().newton;
    const Eigen::Index size = own.hessian.rows();
    const bool positive = kernels().cholesky(own.hessian.data(), size, size, own.factor.data());
    workspace_.values[i].value = positive ? 1 : 0;
  });
  const bool positive = std::all_of(workspace_.values.begin(), workspace_.values.begin() + std::ssize(bodies_),
                                    [](const PotentialValue& own) { return own.value > 0; });
  if (positive && has_hard()) set_condition_directions();
  return positive;
}

void IslandProblem::shift(double share) noexcept {
  for (WorldBody* const own : bodies_)
    if (!own->full) shift_diagonal(share, own->near().newton.hessian);
}

double IslandProblem::rough_tolerance() const noexcept { return has_full_ ? tolerance_ : kRoughTolerance; }

void IslandProblem::solve(Eigen::Map<Eigen::VectorXd>& x) noexcept {
  if (!is_dense_) return solve_by_gradients(x);
  std::copy(x.begin(), x.end(), workspace_.right_side.data());
  kernels().cholesky_solve(workspace_.factor.data(), unknowns_, workspace_.right_side.data());
  x = Eigen::Map<const Eigen::VectorXd>(workspace_.right_side.data(), unknowns_);
}

void IslandProblem::multiply(const Eigen::VectorXd& x, Eigen::VectorXd& product) const noexcept {
  const auto of = [&x](const WorldBody& own) { return x.segment(own.offset, own.unknowns()); };
  const auto in_full_space = [this](const PairContact& pair) { return first(pair).full || second(pair).full; };
  if (has_full_)
    for_all(pairs_.size(), threads_, [&](std::size_t p) {
      PairContact& pair = *pairs_[p];
      if (in_full_space(pair)) pair.set_ways(first(pair), of(first(pair)), second(pair), of(second(pair)));
    });
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    const WorldBody& own = body(i);
    auto part = product.segment(own.offset, own.unknowns());
    if (own.full)
      own.full->multiply(of(own), part);
    else
      part.noalias() = own.near().newton.hessian.selfadjointView<Eigen::Lower>() * of(own);
    for (const auto& [index, side] : incidences_[i]) {
      const PairContact& pair = *pairs_[static_cast<std::size_t>(index)];
      if (in_full_space(pair)) {
        pair.add_product(side, own, part);
        continue;
      }
      if (pair.is_own()) continue;
      const auto theirs = of(side == 0 ? second(pair) : first(pair));
      if (side == 0)
        part.noalias() += pair.coupling() * theirs;
      else
        part.noalias() += pair.coupling().transpose() * theirs;
    }
  });
}

void IslandProblem::precondition(const Eigen::VectorXd& residual, Eigen::VectorXd& result) noexcept {
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    const WorldBody& own = body(i);
    if (own.full) {
      own.full->precondition(residual.segment(own.offset, own.unknowns()), result.segment(own.offset, own.unknowns()));
      return;
    }
    NewtonWorkspace& factors = body(i).near().newton;
    Eigen::Map<Eigen::VectorXd> part(factors.direction.data(), own.unknowns());
    part = residual.segment(own.offset, own.unknowns());
    kernels().cholesky_solve(factors.factor.data(), own.unknowns(), factors.direction.data());
    result.segment(own.offset, own.unknowns()) = part;
  });
  if (has_hard()) workspace_.conditions.make_tangent(result);
}

/// Tangents of bodies in full space become positive semi-definite. False where they are.
bool IslandProblem::project() noexcept {
  if (!has_full_ || is_projected_) return false;
  is_projected_ = true;
  for_all(bodies_.size(), threads_, [&](std::size_t i) {
    if (body(i).full) body(i).full->start(workspace_.unknowns[i], Tangent::kPositiveSemidefinite);
  });
  return true;
}

/// Conjugate gradients. Where the matrix is not positive definite they return the iterate before: a direction of
/// descent in any case. Bodies in full space multiply in single precision: forces are taken over their norm.
void IslandProblem::solve_by_gradients(Eigen::Map<Eigen::VectorXd>& x) noexcept {
  const double force = x.norm(), size = has_full_ ? force : 1;
  if (has_full_) {
    workspace_.right = x / size;
    x = workspace_.right;
  }
  Eigen::VectorXd &residual = workspace_.residual, &z = workspace_.preconditioned, &p = workspace_.direction,
                  &product = workspace_.product;
  residual = x;
  precondition(residual, z);
  p = z;
  x.setZero();
  double square = residual.dot(z);
  const double needed = kShareOfLimit * tolerance_ * force_scale_ / force;
  const double error = has_full_ ? kFullSolutionError : std::clamp(needed, kSolutionError, kLeastExact);
  const double enough = error * error * square;
  for (int iteration = 0; iteration < kMostGradients && square > enough; ++iteration) {
    multiply(p, product);
    ++conjugate_gradients_;
    const double curvature = p.dot(product);
    if (!(curvature > 0)) {
      if (project()) {
        x = size * workspace_.right;
        return solve_by_gradients(x);
      }
      if (iteration == 0) x = p;
      break;
    }
    const double length = square / curvature;
    x += length * p;
    residual -= length * product;
    precondition(residual, z);
    const double next = residual.dot(z);
    p = z + next / square * p;
    square = next;
  }
  if (has_full_) x *= size;
}

namespace {

/// Friction of all contacts of an island follows the normal forces of its solution.
double refresh_friction(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs) noexcept {
  FrictionChange change;
  for (WorldBody* const own : bodies) {
    if (own->full)
      own->near().contact.refresh_friction(change);
    else
      own->contact().refresh_friction(own->near().contact, change);
  }
  for (PairContact* const pair : pairs) pair->refresh_friction(change);
  return change.relative();
}

/// Starts the elastic potential of a body: of a reduced one at q, of one in full space at its part of x.
void start_at(WorldBody& own, const Eigen::VectorXd& x, const Eigen::VectorXd& q) noexcept {
  if (own.full)
    own.full->start(x.segment(own.offset, own.unknowns()), Tangent::kExact);
  else
    own.step->potential().start(q);
}

/// Minimises with friction as it follows, from workspace.x; that of the first round begins where the elastic potential
/// was started.
NewtonReport minimise(IslandProblem& problem, std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                      int threads, IslandWorkspace& workspace) noexcept {
  NewtonReport total;
  if (!problem.begin(workspace.x, total)) {
    total.status = NewtonStatus::kStagnated;
    return total;
  }
  const auto restart = [&] {
    for_all(bodies.size(), threads, [&](std::size_t i) { start_at(*bodies[i], workspace.x, bodies[i]->near().q); });
  };
  const auto refresh = [&] { return refresh_friction(bodies, pairs); };
  const NewtonBegin begin = problem.has_hard() ? NewtonBegin::kFactor : NewtonBegin::kHessian;
  add(minimise_with_friction(problem, newton_of(bodies), workspace.x, workspace.newton, restart, refresh, begin),
      total);
  return total;
}

/// The unknowns of a body that stays where it is.
void stay(WorldBody& body, Eigen::Ref<Eigen::VectorXd> x) noexcept {
  if (body.full) return body.full->stay(x);
  x.setZero();
  if (body.rigid() == 0) return;
  Eigen::VectorXd& own = body.near().x;
  own = x;
  x.head<3>() = body.model.frame->placement(body.state.frame).position - body.problem->place(own).position;
}

void stay(std::span<WorldBody* const> bodies, Eigen::VectorXd& x) noexcept {
  for (WorldBody* const own : bodies) stay(*own, x.segment(own->offset, own->unknowns()));
}

/// True if a search may have ended at a minimum that is none of the bodies': it took long, or they go so far in the
/// step that they would be deep in each other.
bool is_doubtful(const NewtonReport& newton, std::span<WorldBody* const> bodies) noexcept {
  return newton.iterations > kSureIterations || std::ranges::any_of(bodies, [](const WorldBody* own) {
           const double way = own->scene().time_step * own->start_velocity.norm();
           return way > kFast * own->surface.bound(own->state.q).radius;
         });
}

/// True if the potential is higher at workspace.x than where the bodies stand. The bodies are at workspace.x then.
bool is_above_start(IslandProblem& problem, std::span<WorldBody* const> bodies, IslandWorkspace& workspace) noexcept {
  workspace.trial = workspace.x;
  stay(bodies, workspace.trial);
  const PotentialValue start = problem.value(workspace.trial);
  return problem.value(workspace.x).value > start.value + kNearRounding * start.magnitude;
}

/// Where the body would go without the others, or, if it touched one of them or an obstacle in the last step, as fast
/// as it is: contacts that hold a body go on to do so.
void start_search(WorldBody& body, std::span<PairContact* const> pairs, std::span<const Incidence> incidences,
                  Eigen::Ref<Eigen::VectorXd> x) noexcept {
  if (body.full) {
    x = body.full->first_iterate();
    return;
  }
  x = body.near().x;
  const bool touched = std::ranges::any_of(incidences, [&](const Incidence& incidence) {
    const PairContact& pair = *pairs[static_cast<std::size_t>(incidence.pair)];
    return !pair.is_own() && pair.touched();
  });
  if (body.rigid() == 0 || !(touched || body.state.contacts.count > 0)) return;
  const Eigen::Vector3d end =
      body.model.frame->placement(body.state.frame).position + body.scene().time_step * body.start_velocity;
  x.head<3>() = end - body.problem->place(body.near().x).position;
}

/// Minimises from start_search(). If that leads nowhere, or to a minimum that lies above where they stand, as between
/// bodies that would be deep in each other, from where they stand: there the potential is the energy that they have. A
/// solution that is still above that is none.
NewtonReport solve_island(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                          std::span<const std::vector<Incidence>> incidences, int threads, IslandWorkspace& workspace) {
  IslandProblem problem(bodies, pairs, incidences, threads, workspace);
  for (std::size_t i = 0; i < bodies.size(); ++i)
    start_search(*bodies[i], pairs, incidences[i], workspace.x.segment(bodies[i]->offset, bodies[i]->unknowns()));
  NewtonReport total = minimise(problem, bodies, pairs, threads, workspace);
  // Where bodies would go without each other may be so far from the conditions of attachments that nothing leads back.
  bool again = total.status == NewtonStatus::kIterationLimit || total.status == NewtonStatus::kStagnated ||
               (total.status == NewtonStatus::kNonFinite && problem.has_hard());
  if (total.status == NewtonStatus::kConverged && is_doubtful(total, bodies))
    again = is_above_start(problem, bodies, workspace);
  const auto minimise_from_rest = [&] {
    stay(bodies, workspace.x);
    for (WorldBody* const own : bodies) start_at(*own, workspace.x, own->state.q);
    add(minimise(problem, bodies, pairs, threads, workspace), total);
  };
  if (again) {
    minimise_from_rest();
    if (total.status == NewtonStatus::kConverged && is_above_start(problem, bodies, workspace))
      total.status = NewtonStatus::kAboveStart;
  }
  // Patches that are pressed flat have no rotation that conditions could hold.
  for (const Eigen::Index conditions : {3, 0}) {
    if (!problem.has_hard() || (total.status != NewtonStatus::kNonFinite && workspace.x.allFinite())) break;
    problem.loosen(conditions);
    minimise_from_rest();
    if (total.status == NewtonStatus::kConverged) total.status = NewtonStatus::kStagnated;
  }
  for (WorldBody* const own : bodies)
    if (!own->full) own->near().x = workspace.x.segment(own->offset, own->unknowns());
  return total;
}

IslandEnergy energy_of(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs) noexcept {
  IslandEnergy sum;
  for (const PairContact* const pair : pairs) sum.total += pair->attached_energy();
  for (const WorldBody* const own : bodies) {
    const Energies energy = own->energies();
    sum.kinetic += energy.kinetic;
    sum.total += energy.total();
  }
  return sum;
}

IslandStart start_accounts(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs) noexcept {
  IslandStart start{energy_of(bodies, pairs)};
  for (PairContact* const pair : pairs) {
    pair->begin_account();
    start.springs += pair->start_energy();
    start.accounts += pair->account();
  }
  return start;
}

/// True if nothing but gravity, what they do to each other and obstacles that stand still change the energy of the
/// bodies.
bool is_isolated(std::span<WorldBody* const> bodies) noexcept {
  return std::ranges::all_of(bodies, [](const WorldBody* own) {
    const bool driven = own->full ? own->full->is_driven() : own->model.frame->is_driven();
    return !driven && is_isolated(own->scene(), own->state, own->near().contact);
  });
}

/// Energy of the springs of obstacles where the step has led [J], which becomes the bodies' accounts.
double end_obstacles(std::span<WorldBody* const> bodies) noexcept {
  double sum = 0;
  for (WorldBody* const own : bodies) {
    double& account = own->state.contacts.account;
    account = own->near().contact.end_energy(own->model.frame->placement(own->state.frame).position);
    sum += account;
  }
  return sum;
}

/// After a step that did not converge, or that ends with more energy than there is: the bodies have the momenta that
/// they have to have, if nothing else touches them, and together no more energy than `allowed` [J].
void limit_energy(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs, const IslandBegin& begin,
                  bool isolated, double allowed) noexcept {
  const IslandEnergy now = energy_of(bodies, pairs);
  const auto evaluate = [&] {  // what pairs remember is of where the bodies are
    for (PairContact* const pair : pairs)
      pair->evaluate(*bodies[static_cast<std::size_t>(pair->body(0))],
                     *bodies[static_cast<std::size_t>(pair->body(1))]);
  };
  if (begin.is_alone) {
    if (take_momenta(bodies, begin, allowed - (now.total - now.kinetic))) evaluate();
    return;
  }
  if (!(now.total > allowed)) return;
  if (isolated && now.total - now.kinetic > allowed) {
    go_back(bodies, begin);
    return evaluate();
  }
  if (!(now.kinetic > 0)) return;
  const double share = std::max(0.0, 1 - (now.total - allowed) / now.kinetic);
  for (WorldBody* const own : bodies) own->limit_kinetic_energy(share);
}

/// Ends the accounts of the pairs after a step. `closed`: they never gain more together than the bodies have lost, as
/// where nothing else acts; `obstacles`: what the springs of these hold now [J].
void end_accounts(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs, const IslandStart& start,
                  double obstacles, bool closed, bool converged) noexcept {
  double sum = 0;
  for (PairContact* const pair : pairs) {
    const WorldBody &first = *bodies[static_cast<std::size_t>(pair->body(0))],
                    &second = *bodies[static_cast<std::size_t>(pair->body(1))];
    const auto changed = [](const WorldBody& body) -> Eigen::Vector3d {
      return body.model.frame->velocity(body.state.frame).linear - body.start_velocity;
    };
    pair->end_account(first, second, changed(first) - changed(second), converged);
    sum += pair->account();
  }
  if (!closed) return;
  const double lost = start.bodies.total + start.obstacles - energy_of(bodies, pairs).total - obstacles;
  const double most = std::max(0.0, start.accounts + lost);
  if (sum > most)
    for (PairContact* const pair : pairs) pair->scale_account(most / sum);
}

/// The centre of mass goes exactly as the momentum, and the momentum as the forces have it, so that what the residual
/// of Newton's method leaves of force would leave hard attachments open: their forces f become such that they close,
/// and stay equal and opposite. Of the centres alone, x of attachment k moves against y by sum_j W_kj f_j, W of the
/// masses. Of the frames that hold a body the first one has it all.
void settle(std::span<WorldBody* const> bodies, IslandWorkspace& workspace) noexcept {
  const auto pairs = std::ssize(workspace.hard), count = pairs + std::ssize(workspace.framed);
  if (count == 0) return;
  /// Body and sign of either end of an attachment; a frame has no body.
  const auto end_of = [&](Eigen::Index k, int side) {
    if (k >= pairs) return std::pair(side == 0 ? workspace.framed[static_cast<std::size_t>(k - pairs)] : -1, 1.0);
    const HardAttachment& own = workspace.hard[static_cast<std::size_t>(k)];
    return std::pair(own.pair->body(side), own.attachment->sign(side));
  };
  const auto mobility_of = [&](int number) {
    const WorldBody& own = *bodies[static_cast<std::size_t>(number)];
    const double dt = own.scene().time_step;
    return own.rigid() > 0 ? dt * dt / own.model.frame->inertia_of_momenta()->mass() : 0;
  };
  Eigen::MatrixXd& W = workspace.mobility;
  W.setZero(count, count + 3);  // and how far each is open
  for (Eigen::Index k = 0; k < count; ++k) {
    for (const int side : {0, 1}) {
      const auto [number, sign] = end_of(k, side);
      const double mobility = number < 0 ? 0 : mobility_of(number);
      if (mobility == 0) continue;
      const WorldBody& held = *bodies[static_cast<std::size_t>(number)];
      const Eigen::Vector3d lacking = held.model.frame->force_of(held.near().x, held.workspace.frame) -
                                      held.near().contact.force - held.near().held.sums.force;
      W.row(k).tail<3>() += sign * mobility * lacking.transpose();
      for (Eigen::Index j = 0; j < count; ++j)
        for (const int its : {0, 1})
          if (const auto [other, its_sign] = end_of(j, its); other == number) W(k, j) += sign * its_sign * mobility;
    }
    W(k, k) = W(k, k) > 0 ? W(k, k) * (1 + kRedundant) : 1;
  }
  workspace.mobility_factor.compute(W.leftCols(count));
  const Eigen::MatrixXd forces = workspace.mobility_factor.solve(W.rightCols<3>());
  for (Eigen::Index k = pairs; k < count; ++k) {
    WorldBody& held = *bodies[static_cast<std::size_t>(workspace.framed[static_cast<std::size_t>(k - pairs)])];
    add_hard_force(held.state.attachments, held.pose(), forces.row(k), held.near().held);
  }
  for (Eigen::Index k = 0; k < pairs; ++k) {
    const HardAttachment& own = workspace.hard[static_cast<std::size_t>(k)];
    const auto sums = [&](int side) -> ContactSums& {
      return bodies[static_cast<std::size_t>(own.pair->body(side))]->near().held.sums;
    };
    own.attachment->add_force(forces.row(k), sums(0), sums(1));
  }
}

}  // namespace

NewtonReport begin_island_step(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                               std::span<const std::vector<Incidence>> incidences, int threads,
                               IslandWorkspace& workspace) {
  double pushed = 0;
  for (const WorldBody* const body : bodies) pushed = std::max(pushed, body->travel);
  for_all(bodies.size(), threads, [&](std::size_t i) {
    WorldBody& own = *bodies[i];
    own.start_velocity = own.model.frame->velocity(own.state.frame).linear;
    if (own.full) {
      if (!own.full->begin(own.scene(), pushed)) own.full->fail();
      return;
    }
    own.step.emplace(own.model, own.scene(), own.state, own.workspace);
    own.step->begin(/*touches_others=*/true, pushed);
    if (own.step->prepare()) {
      start_contact(own.model, own.scene(), own.state, own.workspace);
    } else {
      own.near().x.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    own.problem.emplace(own.model, own.state, own.step->potential(), own.workspace);
  });
  workspace.start = start_accounts(bodies, pairs);
  workspace.start.isolated = is_isolated(bodies);
  if (workspace.start.isolated)
    for (const WorldBody* const own : bodies)
      workspace.start.obstacles += own->near().contact.start_energy(own->state.contacts);
  return solve_island(bodies, pairs, incidences, threads, workspace);
}

NewtonReport end_island_step(std::span<WorldBody* const> bodies, std::span<PairContact* const> pairs,
                             std::span<const std::vector<Incidence>> incidences, NewtonReport newton,
                             IslandWorkspace& workspace) {
  const IslandStart& start = workspace.start;
  const bool converged = newton.status == NewtonStatus::kConverged;
  if (converged) settle(bodies, workspace);
  begin_of(bodies, workspace.begin);
  workspace.from_others.resize(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    WorldBody& own = *bodies[i];
    Eigen::Vector3d torque = own.full ? Eigen::Vector3d(0, 0, 0) : own.near().contact.torque;
    FrameMomenta others;
    for (const auto& [index, side] : incidences[i]) {
      const PairContact& pair = *pairs[static_cast<std::size_t>(index)];
      const WorldBody &a = *bodies[static_cast<std::size_t>(pair.body(0))],
                      &b = *bodies[static_cast<std::size_t>(pair.body(1))];
      const auto way = [](const WorldBody& body) -> Eigen::Vector3d {
        return body.placement.position - body.model.frame->placement(body.state.frame).position;
      };
      torque += pair.torque_correction(a, way(a), b, way(b));
      if (!own.full) continue;
      torque += pair.sums(side).torque;
      others.linear += pair.sums(side).force;
    }
    others.angular = torque;
    workspace.from_others[i] = others;
    if (!own.full) finish_contact(own.model, own.state, converged, torque, own.workspace);
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    WorldBody& own = *bodies[i];
    if (!own.full) {
      own.report = own.step->take(newton);
      continue;
    }
    own.report =
        own.full->finish(newton.status, workspace.x.segment(own.offset, own.unknowns()), workspace.from_others[i]);
    add_newton_report(newton, own.report);
    own.placement.rotation = own.model.frame->placement(own.state.frame).rotation;
    for (const auto& [index, side] : incidences[i])
      own.report.contacts += pairs[static_cast<std::size_t>(index)]->sums(side).touching;
    own.report.contact_force += workspace.from_others[i].linear;
  }
  const auto is_finite = [](const WorldBody* own) { return (own->report.status & kStepNonFinite) == 0; };
  if (std::ranges::all_of(bodies, is_finite)) {
    const double springs = end_obstacles(bodies), obstacles = start.isolated ? springs : 0;
    const double allowed =
        start.bodies.total + start.obstacles - obstacles + (converged ? start.accounts : start.springs);
    const double rounding =
        kEnergyRounding * (std::abs(start.bodies.total) + start.bodies.kinetic + start.obstacles + obstacles);
    const bool gains = start.isolated && energy_of(bodies, pairs).total > allowed + rounding;
    if (!converged || gains) limit_energy(bodies, pairs, workspace.begin, start.isolated, allowed);
    // The torque that attachments have for the angular momentum may give a little energy: to take it away is no fault.
    if (gains && std::ranges::all_of(pairs, [](const PairContact* pair) { return pair->attachments().empty(); }))
      newton.status = NewtonStatus::kStagnated;
    end_accounts(bodies, pairs, start, obstacles, start.isolated || !converged, converged && !gains);
    for (PairContact* const pair : pairs)
      for (PairAttachment& own : pair->attachments())
        own.end(*bodies[static_cast<std::size_t>(pair->body(0))], *bodies[static_cast<std::size_t>(pair->body(1))]);
  } else {
    for (PairContact* const pair : pairs) pair->abandon();
  }
  bool rest = true;
  for (WorldBody* const own : bodies) {
    if (!own->full)
      own->report = own->step->report();
    else if (!own->state.q.allFinite() || !own->state.v.allFinite())  // by what limited the energy
      own->report.status |= kStepNonFinite;
    if (newton.status == NewtonStatus::kStagnated) own->report.status |= kStepStagnated;
    rest = rests(own->model, own->scene(), own->report, own->state) && rest;
  }
  if (rest)
    for (WorldBody* const own : bodies) {
      if (own->full)
        put_full_to_sleep(own->model, own->state, own->workspace);
      else
        put_to_sleep(own->model, own->state, own->workspace);
    }
  return newton;
}

}  // namespace exmat::runtime

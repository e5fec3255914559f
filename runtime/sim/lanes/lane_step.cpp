#include "runtime/sim/lanes/lane_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "runtime/sim/lanes/fetch_ahead.h"
#include "runtime/sim/step/body_step.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/divided_step.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/sleep.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {
namespace {
constexpr double kInfinity = std::numeric_limits<double>::infinity();
}  // namespace

/// One step of a few bodies. Newton's method is that of newton_minimise() on the potential of IncrementalPotential,
/// which it leaves to step() wherever it takes a turn that whole steps with exact Hessians do not.
class LaneStep {
 public:
  LaneStep(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace,
           std::span<const LaneBody> next) noexcept
      : model_(model),
        bodies_(bodies),
        next_(next),
        workspace_(workspace),
        elements_(model.internal_force.cubature()),
        forms_(workspace.forms_),
        start_(vectors(forms_.start)),
        q_(vectors(workspace.q_)),
        previous_(vectors(workspace.previous_)),
        trial_(vectors(workspace.trial_)),
        gradient_(vectors(workspace.gradient_)),
        trial_gradient_(vectors(workspace.trial_gradient_)),
        internal_(vectors(workspace.internal_)),
        direction_(vectors(workspace.direction_)),
        linear_(vectors(workspace.linear_)),
        frozen_(vectors(workspace.frozen_)),
        next_frozen_(vectors(workspace.next_frozen_)),
        offset_(vectors(workspace.offset_)),
        external_(vectors(forms_.external)),
        velocity_centre_(vectors(forms_.velocity_centre)),
        acceleration_centre_(vectors(forms_.acceleration_centre)) {
    for (std::size_t l = 0; l < bodies.size(); ++l)
      own_[l] = bodies[l].workspace != nullptr ? bodies[l].workspace : &workspace.bodies_[l];
  }

  void take(std::span<StepReport> reports) noexcept {
    begin();
    if (any([](std::size_t) { return true; })) {
      gather();
      choose_first_iterate();
      find_targets();
      prepare();
      start_contacts();
      minimise();
    }
    for (std::size_t l = 0; l < bodies_.size(); ++l) {
      const LaneBody& body = bodies_[l];
      Workspace& own = *own_[l];
      if (alone_[l] || has_no_solution(reports_[l], body.scene->newton)) {
        reports[l] = step(model_, *body.scene, *body.state, own);
        continue;
      }
      if (meets(l)) {
        finish_contact(model_, *body.state, reports_[l].status == NewtonStatus::kConverged, own.near->contact.torque,
                       own);
      } else {
        own.q = q_.row(static_cast<Eigen::Index>(l)).matrix();
        frames().take(static_cast<Eigen::Index>(l), own);
      }
      steps_[l]->potential().set_elastic_energy(energy_[static_cast<Eigen::Index>(l)]);
      reports[l] = steps_[l]->finish(reports_[l]);
    }
  }

 private:
  enum class Hessian { kEvaluated, kFactorised, kStale };

  /// Leaves out the unknowns of frames.
  LaneNumbers dot(const LaneVectors& a, const LaneVectors& b) const noexcept {
    return runtime::dot(model_.modes(), a.data(), b.data());
  }
  LaneNumbers norm(const LaneVectors& a) const noexcept { return dot(a, a).sqrt(); }

  LaneVectors vectors(AlignedArray& array) const { return {array.data(), kLanes, model_.modes()}; }

  // Flops of all that still run: lanes that do not are no work that anybody wants.
  double flops(double of_one) const noexcept {
    int running = 0;
    for (std::size_t l = 0; l < bodies_.size(); ++l) running += runs(l);
    return running * of_one;
  }
  double force_flops() const noexcept { return model_.internal_force.force_flops(); }
  double all_flops() const noexcept { return force_flops() + elements_.lanes_stiffness_flops(); }
  LaneFrames& frames() const noexcept { return workspace_.frames_; }
  std::span<Workspace* const> own() const noexcept { return std::span(own_).first(bodies_.size()); }
  Profile* profile() const noexcept { return own_.front()->profile; }

  /// True for a body near obstacles, after start_contacts().
  bool meets(std::size_t l) const noexcept { return l < bodies_.size() && contacts_[l].has_value(); }
  /// The unknowns of all lanes: r modes, then those of frames near obstacles.
  Eigen::Index unknowns() const noexcept { return model_.modes() + rigid_; }
  LaneVectors rigid(AlignedArray& array) const { return {array.data() + model_.modes() * kLanes, kLanes, rigid_}; }

  bool runs(std::size_t l) const noexcept { return l < bodies_.size() && !alone_[l] && !done_[l]; }

  template <class Work>
  void each(Work work) noexcept {
    for (std::size_t l = 0; l < bodies_.size(); ++l)
      if (runs(l)) work(l, static_cast<Eigen::Index>(l));
  }

  /// One of those whose turn comes next, beside arithmetic: all at once would keep what is read now waiting.
  void fetch_next() noexcept {
    if (fetched_ < next_.size()) fetch_ahead(*next_[fetched_++].state);
  }

  /// External forces, obstacles near, forms of the integrators.
  void begin() noexcept {
    for (std::size_t l = 0; l < bodies_.size(); ++l) {
      const LaneBody& body = bodies_[l];
      alone_[l] = sleeps(model_, *body.scene, *body.state);
      if (alone_[l]) continue;
      first_awake_ = std::min(l, first_awake_);
      steps_[l].emplace(model_, *body.scene, *body.state, *own_[l]);
      steps_[l]->begin(/*touches_others=*/false);
    }
  }

  /// The unknowns of bodies near obstacles. Those of frames are zero in other lanes, with a Hessian of one.
  void start_contacts() noexcept {
    each([&](std::size_t l, Eigen::Index lane) {
      if (!steps_[l]->is_near()) return;
      const LaneBody& body = bodies_[l];
      Workspace& own = *own_[l];
      own.q = q_.row(lane).matrix();
      start_contact(model_, *body.scene, *body.state, own);
      contacts_[l].emplace(model_, *body.state, steps_[l]->potential(), own);
      frames().begin_contact(lane);
      rigid_ = model_.frame->rigid_unknowns();
    });
    for (AlignedArray* const array : {&workspace_.q_, &workspace_.gradient_, &workspace_.trial_gradient_})
      rigid(*array).setZero();
    each([&](std::size_t l, Eigen::Index lane) {
      if (meets(l)) rigid(workspace_.q_).row(lane) = own_[l]->near->x.head(rigid_).transpose().array();
    });
  }

  /// Lanes without a body, or with one that sleeps, repeat the first that is awake.
  void gather() noexcept {
    for (std::size_t l = 0; l < static_cast<std::size_t>(kLanes); ++l) {
      const std::size_t from = steps_[l] ? l : first_awake_;
      const auto lane = static_cast<Eigen::Index>(l);
      const StepScene& scene = *bodies_[from].scene;
      const State& state = *bodies_[from].state;
      forms_.set(lane, scene, state, *own_[from]);
      frames().set_problem(lane, *own_[from]);
      for (Eigen::Index c = 0; c < model_.modes(); ++c) trial_(lane, c) = state.q[c] + scene.time_step * state.v[c];
      tolerance_[lane] = scene.newton.tolerance;
      energy_at_start_[lane] = state.elastic_energy;
    }
    external_norm_ = norm(external_);
    frames().begin(forms_.velocity_factor, velocity_centre_);
  }

  /// See choose_first_iterate() of BodyStep: no result depends on which of the two is evaluated first.
  void choose_first_iterate() noexcept {
    const StageTimer timer(profile(), Stage::kInternalForce, flops(all_flops()));
    const auto inertia_and_load = [&](const LaneVectors& q) {
      offset_ = q - acceleration_centre_;
      return LaneNumbers(0.5 * forms_.acceleration_factor * dot(offset_, offset_) - dot(external_, q));
    };
    const LaneNumbers inertia = inertia_and_load(trial_), at_start = energy_at_start_ + inertia_and_load(start_);
    const bool begins_with_predictor = workspace_.predictor_was_lower_;
    q_ = trial_;
    if (begins_with_predictor) evaluate_stiffness(energy_);
    const auto is_decided = [&](std::size_t l) {
      const auto lane = static_cast<Eigen::Index>(l);
      return is_one_iterate(lane) ||
             (begins_with_predictor && are_clearly_apart(energy_[lane] + inertia[lane], at_start[lane], energy_[lane]));
    };
    LaneNumbers energy = LaneNumbers::Zero();
    if (any([&](std::size_t l) { return !is_decided(l); }))
      elements_.lanes_energy(trial_.data(), workspace_.elastic_scratch_.data(), energy.data());
    workspace_.predictor_was_lower_ = true;
    each([&](std::size_t l, Eigen::Index lane) {
      if (is_one_iterate(lane)) return;
      const double elastic = is_decided(l) ? energy_[lane] : energy[lane];
      if (elastic + inertia[lane] <= at_start[lane]) return;
      start_searches_[l] = 1;
      workspace_.predictor_was_lower_ = false;
      q_.row(lane) = start_.row(lane);
    });
    if (!begins_with_predictor || !workspace_.predictor_was_lower_) evaluate_stiffness(energy_);
  }

  /// True if the predictor is where the step begins.
  bool is_one_iterate(Eigen::Index lane) const noexcept { return (trial_.row(lane) == start_.row(lane)).all(); }

  bool finds_targets_side_by_side() const noexcept {
    return std::ranges::all_of(workspace_.examples_, &LaneExamples::finds_targets);
  }

  void evaluate_stiffness(LaneNumbers& energy) noexcept {
    fetch_next();
    elements_.lanes_force_and_stiffness(q_.data(), bodies_.front().scene->precision, workspace_.elastic_scratch_.data(),
                                        energy.data(), internal_.data(), workspace_.stiffness_.data());
  }

  /// Finds the targets of lanes whose numbers are finite; the others are left to step().
  void find_targets() noexcept {
    each([&](std::size_t l, Eigen::Index lane) { alone_[l] = !std::isfinite(energy_[lane]); });
    fetch_next();
    if (finds_targets_side_by_side()) {
      for (std::size_t i = 0; i < bodies_.front().scene->examples.size(); ++i) find_targets_side_by_side(i);
      return;
    }
    each([&](std::size_t l, Eigen::Index lane) {
      Workspace& own = *own_[l];
      own.q = q_.row(lane).matrix();
      if (!steps_[l]->find_targets()) alone_[l] = true;
      for (std::size_t i = 0; i < own.examples.size(); ++i)
        workspace_.examples_[i].pull().row(lane) = own.examples[i].target;
    });
  }

  /// Finds the targets of the i-th example force.
  void find_targets_side_by_side(std::size_t i) noexcept {
    if (!any([&](std::size_t l) { return acts(bodies_[l].scene->examples[i]); })) return;
    LaneExamples& examples = workspace_.examples_[i];
    {
      const StageTimer timer(profile(), Stage::kWeights);
      examples.find_weights(model_.examples[i], q_.data());
      each([&](std::size_t l, Eigen::Index lane) {
        const ExampleSettings& settings = bodies_[l].scene->examples[i];
        if (!acts(settings)) return;
        if (settings.given_weights.size() > 0)
          examples.give_weights(lane, settings.given_weights);
        else
          examples.apply_bias(lane, settings.bias);
        own_[l]->examples[i].weights = examples.weights().row(lane);
      });
    }
    const StageTimer timer(profile(), Stage::kTarget);
    fetch_next();
    examples.find_targets(model_.examples[i]);
  }

  /// The quadratic form A and its gradient at q_n, as IncrementalPotential::prepare().
  void prepare() noexcept {
    fetch_next();
    kernels().lanes_prepare(forms_.arrays(), workspace_.stiffness_.data(), offset_.data(), workspace_.quadratic_.data(),
                            linear_.data(), rounding_.data());
    rounding_ *= IncrementalPotential::kForceRounding;
    for (std::size_t i = 0; i < bodies_.front().scene->examples.size(); ++i) add_example_force(i);
    if (!frames().exert_forces()) return;
    frozen_.setZero();
    next_frozen_.setZero();
  }

  /// See prepare_example_forces(): k (q_n - q_c) = k q_n - c_kappa c_v q_v.
  void add_example_force(std::size_t i) noexcept {
    LaneNumbers factor = LaneNumbers::Zero(), damping = LaneNumbers::Zero();
    each([&](std::size_t l, Eigen::Index lane) {
      const ExampleSettings& settings = bodies_[l].scene->examples[i];
      if (!is_filtered(settings)) return;
      factor[lane] = linear_stiffness(settings);
      damping[lane] = settings.damping * forms_.velocity_factor[lane];
    });
    const LaneNumbers stiffness = factor + damping;
    if ((stiffness == 0).all()) return;
    offset_ = start_.colwise() * stiffness - velocity_centre_.colwise() * damping;
    workspace_.examples_[i].add_force(model_.examples[i], factor, stiffness, workspace_.offset_, workspace_.linear_,
                                      workspace_.quadratic_);
  }

  Eigen::Map<LaneNumbers> entry(AlignedArray& matrices, Eigen::Index i, Eigen::Index j) const noexcept {
    return Eigen::Map<LaneNumbers>(matrices.data() + lane_entry(i, j));
  }

  /// Value, its magnitude, force scale and gradient at x of the energies and forces there, of the chosen. The forces of
  /// frames are those at x in the gradient, those frozen in the value.
  void assemble(AlignedArray& at, const LaneNumbers& chosen, AlignedArray& gradient_at) noexcept {
    fetch_next();
    const LaneVectors x = vectors(at);
    LaneVectors gradient = vectors(gradient_at);
    Eigen::Array<double, kLanes, kLaneSums> sums;
    kernels().lanes_assemble(forms_.arrays(), x.data(), workspace_.quadratic_.data(), linear_.data(), internal_.data(),
                             offset_.data(), gradient.data(), sums.data());
    const LaneNumbers square = 0.5 * sums.col(0), slope = sums.col(1);
    there_.value = there_.energy + square + slope;
    there_.magnitude = there_.energy.abs() + square.abs() + slope.abs();
    there_.scale = external_norm_ + sums.col(2).sqrt() + forms_.acceleration_factor * sums.col(3).sqrt() +
                   rounding_ * sums.col(4).sqrt() / tolerance_;
    there_.residual = sums.col(5).sqrt();
    each_meeting(chosen, [&](std::size_t l, Eigen::Index lane) { place(l, lane, at); });
    if (frames().exert_forces()) {
      there_.value += dot(frozen_, offset_);
      const LaneNumbers found = frames().update(own(), chosen, meeting(), x, next_frozen_);
      each([&](std::size_t, Eigen::Index lane) {
        if (chosen[lane] != 0 && found[lane] == 0) there_.value[lane] = kInfinity;
      });
      gradient += next_frozen_;
      there_.residual = norm(gradient);
    }
    each_meeting(chosen, [&](std::size_t l, Eigen::Index lane) { touch(l, lane, gradient_at); });
  }

  /// The chosen of those near obstacles.
  template <class Work>
  void each_meeting(const LaneNumbers& chosen, Work work) noexcept {
    each([&](std::size_t l, Eigen::Index lane) {
      if (meets(l) && chosen[lane] != 0) work(l, lane);
    });
  }

  BodyPose pose(std::size_t l) const noexcept { return {placements_[l], own_[l]->near->q}; }

  /// Puts a body near obstacles, and its frame, where a lane's unknowns have it.
  void place(std::size_t l, Eigen::Index lane, const AlignedArray& at) noexcept {
    Workspace& own = *own_[l];
    Eigen::VectorXd& x = own.near->x;
    for (Eigen::Index k = 0; k < rigid_; ++k) x[k] = at[(model_.modes() + k) * kLanes + lane];
    for (Eigen::Index c = 0; c < model_.modes(); ++c) x[rigid_ + c] = at[c * kLanes + lane] - start_(lane, c);
    placements_[l] = contacts_[l]->place(x);
  }

  /// Adds what obstacles and the motion of the frame do there.
  void touch(std::size_t l, Eigen::Index lane, AlignedArray& gradient_at) noexcept {
    ContactProblemWorkspace& own = *own_[l]->near;
    LaneVectors gradient = vectors(gradient_at);
    own.gradient_q = gradient.row(lane).matrix();
    contacts_[l]->evaluate_outside(pose(l));
    Eigen::VectorXd& whole = own.newton.trial_gradient;
    const PotentialEvaluation found =
        contacts_[l]->finish(own.x, {{there_.value[lane], there_.magnitude[lane]}, there_.scale[lane]}, whole);
    there_.value[lane] = found.potential.value;
    there_.magnitude[lane] = found.potential.magnitude;
    there_.scale[lane] = found.force_scale;
    there_.residual[lane] = whole.norm();
    gradient.row(lane) = whole.tail(model_.modes()).transpose().array();
    rigid(gradient_at).row(lane) = whole.head(rigid_).transpose().array();
  }

  /// Adds the same to a lane's Hessian at the iterate, where its last evaluation was.
  void stiffen(std::size_t l, Eigen::Index lane, AlignedArray& hessians) noexcept {
    ContactProblemWorkspace& own = *own_[l]->near;
    Eigen::Matrix3d turn;
    if (rigid_ > 0) turn = model_.frame->turn_to_world(own.x, placements_[l]);
    model_.contact->sum_squares(static_cast<int>(rigid_), rigid_ > 0 ? &turn : nullptr, pose(l), own.contact);
    const double* const squares = own.contact.squares.data();
    const Eigen::Index width = padded(unknowns());
    for (Eigen::Index i = 0; i < unknowns(); ++i) {
      double* const row = hessians.data() + lane_entry(i, 0) + lane;
      for (Eigen::Index j = 0; j <= i; ++j) row[lane_entry(0, j)] += squares[j * width + i];
    }
  }

  /// 1 for those near obstacles.
  LaneNumbers meeting() const noexcept {
    LaneNumbers numbers;
    for (std::size_t l = 0; l < static_cast<std::size_t>(kLanes); ++l)
      numbers[static_cast<Eigen::Index>(l)] = meets(l) ? 1 : 0;
    return numbers;
  }

  /// 1 for those that still run.
  LaneNumbers running() const noexcept {
    LaneNumbers numbers;
    for (std::size_t l = 0; l < static_cast<std::size_t>(kLanes); ++l)
      numbers[static_cast<Eigen::Index>(l)] = runs(l) ? 1 : 0;
    return numbers;
  }

  /// Takes the frozen forces of what was last assembled, of the chosen.
  void accept(const LaneNumbers& chosen) noexcept {
    if (frames().exert_forces()) {
      const LaneNumbers change = dot(next_frozen_, offset_) - dot(frozen_, offset_);
      there_.value = (chosen != 0).select(there_.value + change, there_.value);
      kernels().lanes_take(model_.modes(), chosen.data(), next_frozen_.data(), frozen_.data());
    }
    each_meeting(chosen, [&](std::size_t l, Eigen::Index lane) {
      there_.value[lane] += model_.frame->accept_rigid(own_[l]->frame);
    });
  }

  /// Factors of the Hessians of those that have none, from `stiffness_`.
  void factorise() noexcept {
    const Eigen::Index modes = model_.modes(), size = unknowns();
    const StageTimer timer(profile(), Stage::kSolve, flops(static_cast<double>(size * size * size) / 3));
    // No factor is to be kept where all need one.
    const bool keeps = any(Hessian::kFactorised);
    fetch_next();
    AlignedArray& factor = keeps ? workspace_.new_factor_ : workspace_.factor_;
    kernels().lanes_sum(lane_triangle(modes) / kLanes, workspace_.stiffness_.data(), workspace_.quadratic_.data(),
                        factor.data());
    LaneNumbers fresh = running();
    each([&](std::size_t l, Eigen::Index lane) {
      if (state_[l] == Hessian::kFactorised) fresh[lane] = 0;
    });
    if (frames().exert_forces()) frames().add_stiffness(own(), fresh, meeting(), factor);
    if (rigid_ > 0) frames().set_rigid_rows(own(), meeting(), factor);
    each_meeting(fresh, [&](std::size_t l, Eigen::Index lane) { stiffen(l, lane, factor); });
    kernels().lanes_cholesky(factor.data(), size);
    each([&](std::size_t l, Eigen::Index lane) {
      if (fresh[lane] == 0) return;
      ++reports_[l].factorisations;
      alone_[l] = !std::isfinite(entry(factor, size - 1, size - 1)[lane]);
    });
    if (keeps)
      kernels().lanes_take(lane_triangle(size) / kLanes, fresh.data(), factor.data(), workspace_.factor_.data());
  }

  void find_direction() noexcept {
    const Eigen::Index size = unknowns();
    const StageTimer timer(profile(), Stage::kSolve, flops(2.0 * static_cast<double>(size * size)));
    direction_ = -gradient_;
    rigid(workspace_.direction_) = -rigid(workspace_.gradient_);
    fetch_next();
    kernels().lanes_cholesky_solve(workspace_.factor_.data(), size, direction_.data());
    if (frames().exert_forces()) add_gyroscopic_terms();
    slope_ = runtime::dot(size, gradient_.data(), direction_.data());
  }

  /// As solve_direction() of newton.h; a part that is not weak is left to step(). Near obstacles there is none.
  void add_gyroscopic_terms() noexcept {
    const LaneNumbers ratios = frames().gyroscopic_ratios(own());
    LaneNumbers terms = LaneNumbers::Zero();
    each([&](std::size_t l, Eigen::Index lane) {
      if (meets(l)) return;
      if (IncrementalPotential::is_weak(ratios[lane]))
        terms[lane] = IncrementalPotential::gyroscopic_terms(ratios[lane]);
      else
        alone_[l] = true;
    });
    const auto most = static_cast<int>(terms.maxCoeff());
    for (int term = 0; term < most; ++term) {
      const LaneNumbers chosen = (terms > term).cast<double>();
      trial_ = direction_;
      frames().gyroscopic_products(own(), chosen, trial_, offset_);
      trial_gradient_ = -gradient_ - offset_;
      kernels().lanes_cholesky_solve(workspace_.factor_.data(), unknowns(), trial_gradient_.data());
      kernels().lanes_take(model_.modes(), chosen.data(), trial_gradient_.data(), direction_.data());
    }
  }

  bool is_low_enough(std::size_t l, Eigen::Index lane) const noexcept {
    if (below_rounding_[l]) return true;
    const Eigen::VectorXd unused;
    const PotentialValue start{here_.value[lane], here_.magnitude[lane]},
        end{there_.value[lane], there_.magnitude[lane]};
    const SearchLine<Eigen::VectorXd> line{unused, unused, unused, start, slope_[lane]};
    return line.is_low_enough(1, end) || line.is_lower_by_slope(end, slope_there_[lane]) ||
           there_.residual[lane] <= 0.5 * reports_[l].residual;
  }

  /// After a minimisation near obstacles, as minimise_with_friction(): true where no other one follows.
  bool ends_rounds(std::size_t l) noexcept {
    NewtonReport& total = totals_[l];
    add(reports_[l], total);
    const bool is_settled = model_.contact->refresh_friction(own_[l]->near->contact) <= kSameFriction;
    if (is_settled || ++rounds_[l] == kFrictionRounds) {
      reports_[l] = total;
      return true;
    }
    if (total.factorisations > 0)
      state_[l] = total.status == NewtonStatus::kConverged ? Hessian::kFactorised : Hessian::kStale;
    return false;
  }

  /// Begins other rounds where the last ones of the chosen ended.
  void begin_rounds(const LaneNumbers& chosen) noexcept {
    there_.energy = energy_;
    assemble(workspace_.q_, chosen, workspace_.trial_gradient_);
    const LaneNumbers residual = there_.residual;
    accept(chosen);
    each_meeting(chosen, [&](std::size_t l, Eigen::Index lane) {
      take_evaluation(lane);
      reports_[l] = {};
      reports_[l].residual = residual[lane];
      unchecked_from_[l] = kInfinity;
    });
    kernels().lanes_take(unknowns(), chosen.data(), trial_gradient_.data(), gradient_.data());
  }

  void take_evaluation(Eigen::Index lane) noexcept {
    here_.value[lane] = there_.value[lane];
    here_.magnitude[lane] = there_.magnitude[lane];
    here_.scale[lane] = there_.scale[lane];
  }

  void end_where_there_is_reason() noexcept {
    for (;;) {
      const LaneNumbers again = end_rounds();
      if ((again == 0).all()) return;
      begin_rounds(again);
    }
  }

  /// 1 for those that begin another round.
  LaneNumbers end_rounds() noexcept {
    LaneNumbers returned = LaneNumbers::Zero(), again = returned;
    each([&](std::size_t l, Eigen::Index lane) {
      NewtonReport& report = reports_[l];
      if (std::isfinite(unchecked_from_[l]) && !(report.residual <= unchecked_from_[l])) {
        if (meets(l)) {  // its contacts would have to go back, too
          alone_[l] = true;
          return;
        }
        q_.row(lane) = previous_.row(lane);
        energy_[lane] = previous_energy_[lane];
        report.residual = unchecked_from_[l];
        returned[lane] = 1;
        report.status = NewtonStatus::kStagnated;
        done_[l] = true;
        return;
      }
      PotentialEvaluation here;
      here.potential.value = here_.value[lane];
      here.force_scale = report.force_scale = here_.scale[lane];
      const auto reason = reason_to_end(report, bodies_[l].scene->newton, here, unchecked_from_[l]);
      if (!reason) return;
      if (*reason == NewtonStatus::kNonFinite) {
        alone_[l] = true;
        return;
      }
      report.status = *reason;
      done_[l] = !meets(l) || ends_rounds(l);
      if (!done_[l]) again[lane] = 1;
    });
    if (frames().exert_forces() && (returned != 0).any()) frames().update(own(), returned, meeting(), q_, next_frozen_);
    return again;
  }

  template <class Condition>
  bool any(Condition holds) const noexcept {
    for (std::size_t l = 0; l < bodies_.size(); ++l)
      if (runs(l) && holds(l)) return true;
    return false;
  }

  bool any(Hessian state) const noexcept {
    return any([&](std::size_t l) { return state_[l] == state; });
  }

  void minimise() noexcept {
    there_.energy = energy_;
    assemble(workspace_.q_, running(), workspace_.gradient_);
    const LaneNumbers residual = there_.residual;
    accept(running());
    each([&](std::size_t l, Eigen::Index lane) {
      reports_[l].residual = residual[lane];
      reports_[l].line_search_evaluations = start_searches_[l];
      unchecked_from_[l] = kInfinity;
      state_[l] = Hessian::kEvaluated;
    });
    here_ = there_;
    for (;;) {
      end_where_there_is_reason();
      const bool stale = any(Hessian::kStale);
      if (!stale && !any(Hessian::kEvaluated) && !any(Hessian::kFactorised)) return;
      if (stale) {
        const StageTimer timer(profile(), Stage::kInternalForce, flops(all_flops()));
        evaluate_stiffness(there_.energy);
      }
      if (stale || any(Hessian::kEvaluated)) factorise();
      iterate();
    }
  }

  void iterate() noexcept {
    find_direction();
    each([&](std::size_t l, Eigen::Index lane) {
      if (!std::isfinite(slope_[lane]) || slope_[lane] >= 0) alone_[l] = true;
      below_rounding_[l] = std::abs(slope_[lane]) <= kRounding * here_.magnitude[lane];
      unchecked_from_[l] = below_rounding_[l] ? reports_[l].residual : kInfinity;
    });
    kernels().lanes_sum(unknowns(), q_.data(), direction_.data(), trial_.data());
    const LaneNumbers ended = 1 - running();
    kernels().lanes_take(unknowns(), ended.data(), q_.data(), trial_.data());
    {
      const StageTimer timer(profile(), Stage::kInternalForce, flops(force_flops()));
      fetch_next();
      elements_.lanes_force(trial_.data(), workspace_.elastic_scratch_.data(), there_.energy.data(), internal_.data());
      assemble(workspace_.trial_, running(), workspace_.trial_gradient_);
    }
    slope_there_ = runtime::dot(unknowns(), trial_gradient_.data(), direction_.data());
    LaneNumbers taken = LaneNumbers::Zero();
    each([&](std::size_t l, Eigen::Index lane) {
      if (!is_low_enough(l, lane)) {
        alone_[l] = true;
        return;
      }
      taken[lane] = 1;
    });
    accept(taken);
    each([&](std::size_t l, Eigen::Index lane) {
      NewtonReport& report = reports_[l];
      previous_energy_[lane] = energy_[lane];
      energy_[lane] = there_.energy[lane];
      take_evaluation(lane);
      ++report.iterations;
      const double before = report.residual;
      report.residual = there_.residual[lane];
      const NewtonSettings& settings = bodies_[l].scene->newton;
      state_[l] = factor_serves(settings, before, report.residual, settings.tolerance * here_.scale[lane])
                      ? Hessian::kFactorised
                      : Hessian::kStale;
    });
    for (const auto& [from, to] : {std::pair(&q_, &previous_), {&trial_, &q_}, {&trial_gradient_, &gradient_}})
      kernels().lanes_take(unknowns(), taken.data(), from->data(), to->data());
  }

  struct Evaluation {
    LaneNumbers energy, value, magnitude, scale, residual;
  };

  const Model& model_;
  std::span<const LaneBody> bodies_, next_;
  LaneWorkspace& workspace_;
  const ReducedElasticity& elements_;
  LaneForms& forms_;
  LaneVectors start_, q_, previous_, trial_, gradient_, trial_gradient_, internal_, direction_, linear_, frozen_,
      next_frozen_, offset_, external_, velocity_centre_, acceleration_centre_;
  std::array<Workspace*, kLanes> own_{};
  std::array<std::optional<BodyStep>, kLanes> steps_;
  std::array<std::optional<ContactProblem>, kLanes> contacts_;
  std::array<Placement, kLanes> placements_;
  Eigen::Index rigid_ = 0;
  std::array<int, kLanes> rounds_{};
  std::array<NewtonReport, kLanes> totals_;
  std::array<bool, kLanes> alone_{}, done_{}, below_rounding_{};
  std::size_t first_awake_ = kLanes, fetched_ = 0;
  std::array<int, kLanes> start_searches_{};
  std::array<double, kLanes> unchecked_from_{};
  std::array<Hessian, kLanes> state_{};
  std::array<NewtonReport, kLanes> reports_;
  LaneNumbers tolerance_, energy_at_start_;
  LaneNumbers rounding_, energy_, previous_energy_, slope_, slope_there_, external_norm_;
  Evaluation here_, there_;
};

void step_in_lanes(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace,
                   std::span<StepReport> reports, std::span<const LaneBody> next) noexcept {
  LaneStep(model, bodies, workspace, next).take(reports);
}

}  // namespace exmat::runtime

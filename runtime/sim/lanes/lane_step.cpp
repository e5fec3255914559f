#include "runtime/sim/lanes/lane_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "runtime/sim/step/body_step.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

LaneNumbers dot(const LaneVectors& a, const LaneVectors& b) {
  LaneNumbers sum = LaneNumbers::Zero();
  for (Eigen::Index c = 0; c < a.cols(); ++c) sum += a.col(c) * b.col(c);
  return sum;
}

LaneNumbers norm(const LaneVectors& a) { return dot(a, a).sqrt(); }

LaneNumbers distance(const LaneVectors& a, const LaneVectors& b) {
  LaneNumbers sum = LaneNumbers::Zero();
  for (Eigen::Index c = 0; c < a.cols(); ++c) sum += (a.col(c) - b.col(c)).square();
  return sum.sqrt();
}

void set_lane(LaneVectors& vectors, Eigen::Index lane, const Eigen::VectorXd& own) { vectors.row(lane) = own; }

}  // namespace

bool can_step_side_by_side(const Model& model, const StepScene& scene) noexcept {
  if (model.internal_force.polynomial() || scene.meets_bodies) return false;
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    const ExampleSettings& examples = scene.examples[i];
    if (elastic_factor(examples) > 0) return false;
    if (is_filtered(examples) && !model.examples[i].filter.is_symmetric()) return false;
  }
  return true;
}

LaneWorkspace::LaneWorkspace(const Model& model, const StepScene& scene, std::size_t bodies)
    : bodies_(bodies, Workspace(model, scene)) {
  if (std::cmp_less(bodies, kFewestLanes)) return;
  scratch_ = AlignedArray(lane_scratch(model.modes()));
  const Eigen::Index modes = model.modes();
  for (AlignedArray* vectors :
       {&start_, &q_, &previous_, &trial_, &gradient_, &trial_gradient_, &internal_, &direction_, &linear_, &frozen_,
        &next_frozen_, &offset_, &product_, &external_, &acceleration_centre_})
    *vectors = AlignedArray(modes * kLanes);
  for (AlignedArray* matrices : {&quadratic_, &stiffness_, &hessian_, &factor_, &new_factor_})
    *matrices = AlignedArray(lane_triangle(modes));
  of_frame_.setZero(modes, modes);
}

void LaneWorkspace::set_profile(Profile* profile) {
  for (Workspace& body : bodies_) body.profile = profile;
}

/// One step of a few bodies. Newton's method is that of newton_minimise() on the potential of IncrementalPotential,
/// which it leaves to step() wherever it takes a turn that whole steps with exact Hessians do not.
class LaneStep {
 public:
  LaneStep(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace) noexcept
      : model_(model),
        bodies_(bodies),
        workspace_(workspace),
        elements_(model.internal_force.cubature()),
        start_(vectors(workspace.start_)),
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
        product_(vectors(workspace.product_)),
        external_(vectors(workspace.external_)),
        acceleration_centre_(vectors(workspace.acceleration_centre_)) {}

  void take(std::span<StepReport> reports) noexcept {
    begin();
    choose_first_iterate();
    find_targets();
    prepare();
    minimise();
    for (std::size_t l = 0; l < bodies_.size(); ++l) {
      const LaneBody& body = bodies_[l];
      Workspace& own = workspace_.bodies_[l];
      if (alone_[l]) {
        reports[l] = step(model_, *body.scene, *body.state, own);
        continue;
      }
      own.q = q_.row(static_cast<Eigen::Index>(l)).matrix();
      steps_[l]->potential().set_elastic_energy(energy_[static_cast<Eigen::Index>(l)]);
      reports[l] = steps_[l]->finish(reports_[l]);
    }
  }

 private:
  enum class Hessian { kEvaluated, kFactorised, kStale };

  LaneVectors vectors(AlignedArray& array) const { return {array.data(), kLanes, model_.modes()}; }

  // Of all that still run: lanes that do not are no work that anybody wants.
  double flops(double of_one) const noexcept {
    int running = 0;
    for (std::size_t l = 0; l < bodies_.size(); ++l) running += runs(l);
    return running * of_one;
  }
  double force_flops() const noexcept { return model_.internal_force.force_flops(); }
  double stiffness_flops() const noexcept { return model_.internal_force.stiffness_flops(); }
  Profile* profile() const noexcept { return workspace_.bodies_.front().profile; }

  bool runs(std::size_t l) const noexcept { return l < bodies_.size() && !alone_[l] && !done_[l]; }

  template <class Work>
  void each(Work work) noexcept {
    for (std::size_t l = 0; l < bodies_.size(); ++l)
      if (runs(l)) work(l, static_cast<Eigen::Index>(l));
  }

  /// External forces, obstacles near, forms of the integrators. Lanes without a body repeat the first one's.
  void begin() noexcept {
    const Eigen::Index modes = model_.modes();
    for (std::size_t l = 0; l < static_cast<std::size_t>(kLanes); ++l) {
      const std::size_t from = l < bodies_.size() ? l : 0;
      const auto lane = static_cast<Eigen::Index>(l);
      const StepScene& scene = *bodies_[from].scene;
      const State& state = *bodies_[from].state;
      Workspace& own = workspace_.bodies_[from];
      if (l < bodies_.size()) {
        steps_[l].emplace(model_, scene, *bodies_[l].state, own);
        steps_[l]->begin(/*touches_others=*/false);
        alone_[l] = steps_[l]->is_near();
      }
      set_lane(start_, lane, state.q);
      set_lane(external_, lane, own.external_force);
      set_lane(acceleration_centre_, lane, own.form.acceleration_centre);
      for (Eigen::Index c = 0; c < modes; ++c) trial_(lane, c) = state.q[c] + scene.time_step * state.v[c];
      acceleration_factor_[lane] = own.form.acceleration_factor;
      velocity_factor_[lane] = own.form.velocity_factor;
      stiffness_damping_[lane] = scene.stiffness_damping;
      mass_damping_[lane] = scene.mass_damping;
      tolerance_[lane] = scene.newton.tolerance;
      energy_at_start_[lane] = state.elastic_energy;
    }
  }

  /// See choose_first_iterate() of BodyStep: energies alone tell which, so that stiffness is evaluated once.
  void choose_first_iterate() noexcept {
    const StageTimer timer(profile(), Stage::kInternalForce, flops(force_flops() + stiffness_flops()));
    elements_.lanes_energy(trial_.data(), energy_.data());
    const auto inertia_and_load = [&](const LaneVectors& q) {
      return LaneNumbers(0.5 * acceleration_factor_ * distance(q, acceleration_centre_).square() - dot(external_, q));
    };
    const LaneNumbers predicted = energy_ + inertia_and_load(trial_),
                      at_start = energy_at_start_ + inertia_and_load(start_);
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      const bool as_predicted = predicted[lane] <= at_start[lane] || (trial_.row(lane) == start_.row(lane)).all();
      q_.row(lane) = as_predicted ? trial_.row(lane) : start_.row(lane);
      start_searches_[static_cast<std::size_t>(lane)] = as_predicted ? 0 : 1;
    }
    elements_.lanes_force_and_stiffness(q_.data(), workspace_.scratch_.data(), energy_.data(), internal_.data(),
                                        workspace_.stiffness_.data());
  }

  void find_targets() noexcept {
    each([&](std::size_t l, Eigen::Index lane) {
      Workspace& own = workspace_.bodies_[l];
      own.q = q_.row(lane).matrix();
      alone_[l] = !own.q.allFinite() || !steps_[l]->find_targets();
    });
  }

  /// The quadratic form A and its gradient at q_n, as IncrementalPotential::prepare().
  void prepare() noexcept {
    const Eigen::Index modes = model_.modes();
    const double* stiffness = workspace_.stiffness_.data();
    linear_ = -external_;
    for (Eigen::Index c = 0; c < modes; ++c)
      linear_.col(c) += acceleration_factor_ * (start_.col(c) - acceleration_centre_.col(c));
    for (std::size_t l = 0; l < static_cast<std::size_t>(kLanes); ++l) {
      const StepForm& form = workspace_.bodies_[l < bodies_.size() ? l : 0].form;
      const auto lane = static_cast<Eigen::Index>(l);
      offset_.row(lane) = form.velocity_factor * (start_.row(lane) - form.velocity_centre.transpose().array());
    }
    kernels().lanes_symmetric_product(stiffness, modes, offset_.data(), product_.data());
    const LaneNumbers damping = stiffness_damping_ * velocity_factor_;
    for (Eigen::Index c = 0; c < modes; ++c)
      linear_.col(c) += mass_damping_ * offset_.col(c) + stiffness_damping_ * product_.col(c);
    rounding_.setZero();
    for (Eigen::Index i = 0; i < modes; ++i) {
      rounding_ += entry(workspace_.stiffness_, i, i).abs();
      for (Eigen::Index j = 0; j <= i; ++j)
        entry(workspace_.quadratic_, i, j) = damping * entry(workspace_.stiffness_, i, j);
    }
    rounding_ *= IncrementalPotential::kForceRounding;
    for (std::size_t i = 0; i < bodies_.front().scene->examples.size(); ++i) add_example_force(i);
    for (Eigen::Index i = 0; i < modes; ++i)
      entry(workspace_.quadratic_, i, i) += acceleration_factor_ + velocity_factor_ * mass_damping_;
    frozen_.setZero();
    next_frozen_.setZero();
  }

  void add_example_force(std::size_t i) noexcept {
    LaneNumbers factor = LaneNumbers::Zero();
    offset_.setZero();
    each([&](std::size_t l, Eigen::Index lane) {
      if (!is_filtered(bodies_[l].scene->examples[i])) return;
      const ExampleForce& example = workspace_.bodies_[l].examples[i].force;
      factor[lane] = example.stiffness;
      offset_.row(lane) = example.stiffness * (start_.row(lane) - example.centre.transpose().array());
      linear_.row(lane) -= example.pull.transpose().array();
    });
    const Eigen::MatrixXd& filter = model_.examples[i].filter.matrix();  // symmetric
    const Eigen::Index modes = model_.modes();
    kernels().lanes_matrix_product(filter.data(), modes, modes, filter.outerStride(), offset_.data(), product_.data());
    linear_ += product_;
    for (Eigen::Index r = 0; r < modes; ++r)
      for (Eigen::Index c = 0; c <= r; ++c) entry(workspace_.quadratic_, r, c) += factor * filter(c, r);
  }

  Eigen::Map<LaneNumbers> entry(AlignedArray& matrices, Eigen::Index i, Eigen::Index j) const noexcept {
    return Eigen::Map<LaneNumbers>(matrices.data() + lane_entry(i, j));
  }

  /// Value, its magnitude, force scale and gradient at x of the energies and forces there. The forces of frames are
  /// those at x in the gradient, those frozen in the value.
  void assemble(const LaneVectors& x, LaneVectors& gradient) noexcept {
    const Eigen::Index modes = model_.modes();
    offset_ = x - start_;
    kernels().lanes_symmetric_product(workspace_.quadratic_.data(), modes, offset_.data(), product_.data());
    gradient = internal_ + linear_ + product_;
    const LaneNumbers square = 0.5 * dot(offset_, product_), slope = dot(linear_, offset_);
    there_.value = there_.energy + square + slope;
    there_.magnitude = there_.energy.abs() + square.abs() + slope.abs();
    there_.scale = norm(external_) + norm(internal_) + acceleration_factor_ * distance(x, acceleration_centre_) +
                   rounding_ * norm(x) / tolerance_;
    if (!model_.frame->exerts_forces()) return;
    there_.value += dot(frozen_, offset_);
    each([&](std::size_t l, Eigen::Index lane) {
      if (!update_frame_force(l, x)) there_.value[lane] = kInfinity;
      gradient.row(lane) += next_frozen_.row(lane);
    });
  }

  bool update_frame_force(std::size_t l, const LaneVectors& x) noexcept {
    Workspace& own = workspace_.bodies_[l];
    const auto lane = static_cast<Eigen::Index>(l);
    own.q = x.row(lane).matrix();
    const bool found = model_.frame->update_force(own.q, own.form.velocity_factor, own.form.velocity_centre, own.frame);
    next_frozen_.row(lane) = -model_.frame->force(own.frame)->transpose().array();
    return found;
  }

  /// Takes the frozen forces of what was last assembled.
  void accept(Eigen::Index lane) noexcept {
    if (!model_.frame->exerts_forces()) return;
    const double change = ((next_frozen_.row(lane) - frozen_.row(lane)) * offset_.row(lane)).sum();
    frozen_.row(lane) = next_frozen_.row(lane);
    there_.value[lane] += change;
  }

  /// Factors of the Hessians of those that have none, from `stiffness_`.
  void factorise() noexcept {
    const Eigen::Index modes = model_.modes();
    const StageTimer timer(profile(), Stage::kSolve, flops(static_cast<double>(modes * modes * modes) / 3));
    double* hessian = workspace_.hessian_.data();
    for (std::ptrdiff_t i = 0; i < lane_triangle(modes); ++i)
      hessian[i] = workspace_.stiffness_[i] + workspace_.quadratic_[i];
    if (model_.frame->exerts_forces())
      each([&](std::size_t l, Eigen::Index) {
        if (state_[l] != Hessian::kFactorised) add_frame_stiffness(l);
      });
    // Where all need one, none is to be kept.
    AlignedArray& factor = any(Hessian::kFactorised) ? workspace_.new_factor_ : workspace_.factor_;
    kernels().lanes_cholesky(hessian, modes, factor.data());
    each([&](std::size_t l, Eigen::Index lane) {
      if (state_[l] == Hessian::kFactorised) return;
      ++reports_[l].factorisations;
      const double last = entry(factor, modes - 1, modes - 1)[lane];
      if (!std::isfinite(last)) {
        alone_[l] = true;
        return;
      }
      if (&factor == &workspace_.factor_) return;
      for (std::ptrdiff_t i = lane; i < lane_triangle(modes); i += kLanes) workspace_.factor_[i] = factor[i];
    });
  }

  void add_frame_stiffness(std::size_t l) noexcept {
    Eigen::MatrixXd& part = workspace_.of_frame_;
    const auto lane = static_cast<Eigen::Index>(l);
    part.setZero();
    model_.frame->add_stiffness(workspace_.bodies_[l].form.velocity_factor, workspace_.bodies_[l].frame, part);
    for (Eigen::Index j = 0; j < part.cols(); ++j)
      for (Eigen::Index i = j; i < part.rows(); ++i) entry(workspace_.hessian_, i, j)[lane] += part(i, j);
  }

  /// Newton's direction, and its slope.
  void find_direction() noexcept {
    const Eigen::Index modes = model_.modes();
    const StageTimer timer(profile(), Stage::kSolve, flops(2.0 * static_cast<double>(modes * modes)));
    direction_ = -gradient_;
    kernels().lanes_cholesky_solve(workspace_.factor_.data(), modes, direction_.data());
    if (model_.frame->exerts_forces()) add_gyroscopic_terms();
    slope_ = dot(gradient_, direction_);
  }

  /// As solve_direction() of newton.h; a part that is not weak is left to step().
  void add_gyroscopic_terms() noexcept {
    std::array<int, kLanes> terms{};
    int most = 0;
    each([&](std::size_t l, Eigen::Index) {
      if (steps_[l]->potential().gyroscopic() != nullptr) {
        alone_[l] = true;
        return;
      }
      terms[l] = steps_[l]->potential().gyroscopic_terms();
      most = std::max(most, terms[l]);
    });
    for (int term = 0; term < most; ++term) {
      trial_ = direction_;
      direction_ = -gradient_;
      each([&](std::size_t l, Eigen::Index lane) {
        if (term >= terms[l]) return;
        Workspace& own = workspace_.bodies_[l];
        own.q = trial_.row(lane).matrix();
        direction_.row(lane) -= steps_[l]->potential().gyroscopic_product(own.q).transpose().array();
      });
      kernels().lanes_cholesky_solve(workspace_.factor_.data(), model_.modes(), direction_.data());
      each([&](std::size_t l, Eigen::Index lane) {
        if (term >= terms[l]) direction_.row(lane) = trial_.row(lane);
      });
    }
  }

  bool is_low_enough(std::size_t l, Eigen::Index lane) const noexcept {
    if (below_rounding_[l]) return true;
    const Eigen::VectorXd unused;
    const PotentialValue start{here_.value[lane], here_.magnitude[lane]},
        end{there_.value[lane], there_.magnitude[lane]};
    const SearchLine<Eigen::VectorXd> line{unused, unused, unused, start, slope_[lane]};
    return line.is_low_enough(1, end) || line.is_lower_by_slope(end, slope_there_[lane]) ||
           residual_there_[lane] <= 0.5 * reports_[l].residual;
  }

  void end_where_there_is_reason() noexcept {
    each([&](std::size_t l, Eigen::Index lane) {
      NewtonReport& report = reports_[l];
      if (std::isfinite(unchecked_from_[l]) && !(report.residual <= unchecked_from_[l])) {
        q_.row(lane) = previous_.row(lane);
        energy_[lane] = previous_energy_[lane];
        report.residual = unchecked_from_[l];
        if (model_.frame->exerts_forces()) update_frame_force(l, q_);
        report.status = NewtonStatus::kStagnated;
        done_[l] = true;
        return;
      }
      PotentialEvaluation here;
      here.potential.value = here_.value[lane];
      here.force_scale = here_.scale[lane];
      const auto reason = reason_to_end(report, bodies_[l].scene->newton, here, unchecked_from_[l]);
      if (!reason) return;
      if (*reason == NewtonStatus::kNonFinite) {
        alone_[l] = true;
      } else {
        report.status = *reason;
        done_[l] = true;
      }
    });
  }

  bool any(Hessian state) const noexcept {
    for (std::size_t l = 0; l < bodies_.size(); ++l)
      if (runs(l) && state_[l] == state) return true;
    return false;
  }

  void minimise() noexcept {
    there_.energy = energy_;
    assemble(q_, gradient_);
    const LaneNumbers residual = norm(gradient_);
    each([&](std::size_t l, Eigen::Index lane) {
      accept(lane);
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
        const StageTimer timer(profile(), Stage::kInternalForce, flops(force_flops() + stiffness_flops()));
        elements_.lanes_force_and_stiffness(q_.data(), workspace_.scratch_.data(), there_.energy.data(),
                                            internal_.data(), workspace_.stiffness_.data());
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
    trial_ = q_ + direction_;
    for (std::size_t l = 0; l < static_cast<std::size_t>(kLanes); ++l)
      if (!runs(l)) trial_.row(static_cast<Eigen::Index>(l)) = q_.row(static_cast<Eigen::Index>(l));
    {
      const StageTimer timer(profile(), Stage::kInternalForce, flops(force_flops()));
      elements_.lanes_force(trial_.data(), there_.energy.data(), internal_.data());
      assemble(trial_, trial_gradient_);
    }
    residual_there_ = norm(trial_gradient_);
    slope_there_ = dot(trial_gradient_, direction_);
    each([&](std::size_t l, Eigen::Index lane) {
      if (!is_low_enough(l, lane)) {
        alone_[l] = true;
        return;
      }
      accept(lane);
      NewtonReport& report = reports_[l];
      previous_.row(lane) = q_.row(lane);
      previous_energy_[lane] = energy_[lane];
      q_.row(lane) = trial_.row(lane);
      gradient_.row(lane) = trial_gradient_.row(lane);
      energy_[lane] = there_.energy[lane];
      here_.value[lane] = there_.value[lane];
      here_.magnitude[lane] = there_.magnitude[lane];
      here_.scale[lane] = there_.scale[lane];
      ++report.iterations;
      const double before = report.residual;
      report.residual = residual_there_[lane];
      const NewtonSettings& settings = bodies_[l].scene->newton;
      state_[l] = detail::factor_serves(settings, before, report.residual, settings.tolerance * here_.scale[lane])
                      ? Hessian::kFactorised
                      : Hessian::kStale;
    });
  }

  struct Evaluation {
    LaneNumbers energy, value, magnitude, scale;
  };

  const Model& model_;
  std::span<const LaneBody> bodies_;
  LaneWorkspace& workspace_;
  const ReducedElasticity& elements_;
  LaneVectors start_, q_, previous_, trial_, gradient_, trial_gradient_, internal_, direction_, linear_, frozen_,
      next_frozen_, offset_, product_, external_, acceleration_centre_;
  std::array<std::optional<BodyStep>, kLanes> steps_;
  std::array<bool, kLanes> alone_{}, done_{}, below_rounding_{};
  std::array<int, kLanes> start_searches_{};
  std::array<double, kLanes> unchecked_from_{};
  std::array<Hessian, kLanes> state_{};
  std::array<NewtonReport, kLanes> reports_;
  LaneNumbers acceleration_factor_, velocity_factor_, stiffness_damping_, mass_damping_, tolerance_, energy_at_start_;
  LaneNumbers rounding_, energy_, previous_energy_, slope_, slope_there_, residual_there_;
  Evaluation here_, there_;
};

void step_side_by_side(const Model& model, std::span<const LaneBody> bodies, LaneWorkspace& workspace,
                       std::span<StepReport> reports) noexcept {
  if (std::ssize(bodies) >= kFewestLanes) {
    LaneStep(model, bodies, workspace).take(reports);
    return;
  }
  for (std::size_t l = 0; l < bodies.size(); ++l)
    reports[l] = step(model, *bodies[l].scene, *bodies[l].state, workspace.body(l));
}

}  // namespace exmat::runtime

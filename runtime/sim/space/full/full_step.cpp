#include "runtime/sim/space/full/full_step.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace exmat::runtime {
namespace {

constexpr double kMostPredicted = 0.5;  // of an edge, that an unchecked predictor moves a vertex by
constexpr double kSlow = 0.1;           // of the residual: tangents that leave more are evaluated again
constexpr double kForcing = 0.3;        // of what is left to the tolerance, that a direction is solved to

FullWorkspace::Linear make_linear(const FullSpace& space, const StepScene& scene, double time_scale) {
  const double c_v = 1 / time_scale;
  const double mass = c_v * c_v + scene.mass_damping * c_v, stiffness = 1 + scene.stiffness_damping * c_v;
  double filter = 0;
  if (!scene.examples.empty()) filter = scene.examples.front().stiffness + scene.examples.front().damping * c_v;
  FullWorkspace::Linear linear{FullPreconditioner(space, mass, stiffness, filter), {}, static_cast<float>(filter)};
  for (Eigen::Index k = 0; k < space.entries(); ++k)
    linear.matrix.push_back(static_cast<float>(mass * space.mass_value(k) + stiffness * space.variance_value(k)));
  return linear;
}

double largest_move(const Eigen::VectorXd& field) {
  return std::sqrt(field.reshaped(4, field.size() / 4).colwise().squaredNorm().maxCoeff());
}

bool jumps(const StepScene& scene, const State& state) {
  if (state.begins_anew || scene.begins_anew) return true;
  const double midpoint = state.time + 0.5 * scene.time_step;
  return std::ranges::any_of(scene.forces, [&](const ScriptedForce& force) {
    return force.acts_at(midpoint) != force.acts_at(midpoint - scene.time_step);
  });
}

}  // namespace

const char* unsupported(const FullSpace& space, const StepScene& scene) noexcept {
  if (scene.integrator == Integrator::kNewmark) return "Newmark's integrator";
  if (!scene.obstacles.empty()) return "obstacles";
  if (scene.carrier) return "a motion that carries the body";
  if (scene.sleep.energy > 0) return "sleep";
  if (scene.examples.size() > 1) return "more than one example force";
  const bool acts_example = std::ranges::any_of(scene.examples, acts);
  if (acts_example && scene.examples.front().elastic) return "an elastic example force";
  if (acts_example && space.functions() == 0) return "an example force, since the space has no filter";
  const bool damped = scene.mass_damping > 0 || scene.stiffness_damping > 0;
  if (!space.is_clamped() && (damped || acts_example)) return "damping or example force of a free body";
  return nullptr;
}

FullWorkspace::FullWorkspace(const FullSpace& space, const StepScene& scene, const FullAccuracy& of)
    : accuracy(of),
      first(make_linear(space, scene, scene.time_step)),
      second(scene.integrator == Integrator::kBdf2 ? make_linear(space, scene, 2 * scene.time_step / 3) : first),
      form{0, 0, Eigen::VectorXd::Zero(space.size()), Eigen::VectorXd::Zero(space.size())},
      potential(space),
      external(form.velocity_centre),
      d(Eigen::VectorXd::Zero(space.field_size())),
      gradient(d),
      direction(d),
      trial(d),
      trial_gradient(d),
      residual(space.field_size()),
      solved(residual),
      search(residual),
      image(residual),
      sum(residual),
      coefficients(3 * space.filter().stride) {}

FullStep::FullStep(const FullSpace& space, const StepScene& scene, State& state, FullWorkspace& workspace) noexcept
    : space_(space),
      scene_(scene),
      state_(state),
      workspace_(workspace),
      potential_(space, scene, workspace.form, workspace.potential) {}

void FullStep::gather_external_force() noexcept {
  Eigen::VectorXd& external = workspace_.external;
  external = state_.applied_force;
  external.noalias() += space_.gravity_load() * scene_.gravity;
  const double midpoint = state_.time + 0.5 * scene_.time_step;
  for (const ScriptedForce& force : scene_.forces)
    if (force.acts_at(midpoint)) external += force.force;
}

void FullStep::begin() noexcept {
  anew_ = jumps(scene_, state_);
  gather_external_force();
  const StepHistory history{state_.q, state_.v, state_.q_previous, state_.v, state_.v_previous};
  const bool second_order = scene_.integrator == Integrator::kBdf2 && !anew_;
  if (second_order)
    bdf2_form(history, scene_.time_step, workspace_.form);
  else
    backward_euler_form(history, scene_.time_step, workspace_.form);
  linear_ = second_order ? &workspace_.second : &workspace_.first;
  potential_.begin(state_.q, workspace_.external);
  choose_first_iterate();
}

void FullStep::choose_first_iterate() noexcept {
  Eigen::VectorXd& d = workspace_.d;
  space_.to_field(state_.v, d);
  if (!is_checked()) {
    space_.to_field(state_.v_previous, workspace_.trial);
    d = 1.5 * d - 0.5 * workspace_.trial;
  }
  d *= scene_.time_step;
  predicted_ = is_checked() || (!anew_ && largest_move(d) <= kMostPredicted * space_.edge());
  const double at_start = is_checked() ? potential_.undamped_at_start(state_.elastic_energy) : 0;
  if (!predicted_) d.setZero();
  potential_.evaluate_elements(d, FullPotential::Tangents::kExact, true);
  if (!is_checked() || potential_.undamped() <= at_start || d.isZero(0)) return;
  ++report_.line_search_evaluations;
  predicted_ = false;
  d.setZero();
  potential_.evaluate_elements(d, FullPotential::Tangents::kExact, true);
}

void FullStep::first_iterate(Eigen::VectorXd& u) const noexcept {
  space_.from_field(workspace_.d, u);
  u += state_.q;
}

// Preconditioned conjugate gradients from 0, of the gradient over its norm: forces of a body that comes to rest would
// be too small for single precision.
FullStep::Outcome FullStep::find_direction(double tolerance) noexcept {
  const Kernels& run = kernels();
  FullWorkspace& work = workspace_;
  const MeshArrays mesh = space_.arrays();
  const MeshFilter<float> filter = space_.rounded_filter();
  auto residual = work.residual.vector(), solved = work.solved.vector(), search = work.search.vector(),
       image = work.image.vector(), sum = work.sum.vector();
  const double size = work.gradient.norm();
  residual = (work.gradient * (-1 / size)).cast<float>();
  linear_->preconditioner.solve(run, work.residual, work.solved, work.coefficients);
  search = solved;
  sum.setZero();
  float square = residual.dot(solved);
  const float limit = static_cast<float>(tolerance * tolerance) * square;
  for (int iteration = 1;; ++iteration) {
    run.mesh_product(mesh, linear_->matrix.data(), work.potential.tangents.data(), work.search.data(),
                     work.image.data());
    if (linear_->filter_stiffness > 0) {
      run.mesh_rounded_coefficients(filter, work.search.data(), work.coefficients.data());
      run.mesh_add_rounded_functions(filter, linear_->filter_stiffness, work.coefficients.data(), work.image.data());
    }
    const float curvature = search.dot(image);
    if (!(curvature > 0)) {
      if (!projected_) return Outcome::kIndefinite;
      if (iteration == 1) sum = solved;
      break;
    }
    ++report_.cg_iterations;
    const float length = square / curvature;
    sum += length * search;
    if (iteration >= work.accuracy.iterations) break;
    residual -= length * image;
    linear_->preconditioner.solve(run, work.residual, work.solved, work.coefficients);
    const float next = residual.dot(solved);
    if (!(next > limit)) break;
    search = solved + next / square * search;
    square = next;
  }
  work.direction = sum.cast<double>() * size;
  return Outcome::kFound;
}

// Damping by a stiffness that had to be projected would feed energy in.
void FullStep::project() noexcept {
  ++report_.projections;
  projected_ = tangents_are_current_ = true;
  potential_.evaluate_elements(workspace_.d, FullPotential::Tangents::kProjected, at_first_iterate_);
  here_ = potential_.gradient_there(workspace_.d, workspace_.gradient);
}

bool FullStep::is_short() const noexcept {
  return !is_checked() && predicted_ && at_first_iterate_ &&
         largest_move(workspace_.direction) <= workspace_.accuracy.unchecked_move * space_.edge();
}

// Along the direction; false where nothing lowers the potential.
bool FullStep::move() noexcept {
  FullWorkspace& work = workspace_;
  const SearchLine<Eigen::VectorXd> line{work.d, work.gradient, work.direction, here_.potential,
                                         work.gradient.dot(work.direction)};
  PotentialEvaluation there;
  const bool below_rounding = line.below_rounding();
  unchecked_from_ = below_rounding ? report_.residual : std::numeric_limits<double>::infinity();
  if (below_rounding) {
    // The potential cannot tell the two points apart, yet the gradient can: go on for as long as it falls.
    work.trial = work.d + work.direction;
    there = potential_.evaluate(work.trial, work.trial_gradient);
    if (!(work.trial_gradient.norm() <= report_.residual)) return false;
  } else if (!search_line(potential_, line, {work.trial, work.trial_gradient, there},
                          report_.line_search_evaluations)) {
    return false;
  }
  work.d.swap(work.trial);
  work.gradient.swap(work.trial_gradient);
  here_ = there;
  at_first_iterate_ = tangents_are_current_ = false;
  return true;
}

NewtonStatus FullStep::minimise() noexcept {
  FullWorkspace& work = workspace_;
  here_ = potential_.gradient_there(work.d, work.gradient);
  NewtonReport newton;
  newton.residual = report_.residual = work.gradient.norm();
  unchecked_from_ = std::numeric_limits<double>::infinity();
  // A coarse tolerance would leave the body beside its equilibrium for good.
  const NewtonSettings at_least_one{scene_.newton.max_iterations, 0};
  for (;;) {
    newton.residual = report_.residual;
    newton.iterations = report_.newton_iterations;
    const NewtonSettings& settings = is_checked() || !at_first_iterate_ ? scene_.newton : at_least_one;
    if (const auto reason = reason_to_end(newton, settings, here_, unchecked_from_)) return *reason;
    const double left = settings.tolerance * here_.force_scale / report_.residual;
    if (find_direction(std::max(work.accuracy.tolerance, kForcing * left)) == Outcome::kIndefinite) {
      project();
      report_.residual = work.gradient.norm();
      continue;
    }
    if (is_short()) {
      work.d += work.direction;
      ++report_.newton_iterations;
      return NewtonStatus::kConverged;
    }
    const double before = report_.residual;
    const bool moved = move();
    if (moved) {
      ++report_.newton_iterations;
      report_.residual = work.gradient.norm();
      if (report_.residual <= kSlow * before || report_.residual <= scene_.newton.tolerance * here_.force_scale)
        continue;
    } else if (tangents_are_current_) {
      potential_.evaluate_elements(work.d, FullPotential::Tangents::kNone, false);
      return NewtonStatus::kStagnated;
    }
    projected_ = false;
    tangents_are_current_ = true;
    potential_.evaluate_elements(work.d, FullPotential::Tangents::kExact, false);
    if (!moved) here_ = potential_.gradient_there(work.d, work.gradient);
  }
}

void FullStep::solve() noexcept { status_ = minimise(); }

const FullReport& FullStep::finish() noexcept {
  if (status_ == NewtonStatus::kIterationLimit) report_.status |= kStepIterationLimit;
  if (status_ == NewtonStatus::kStagnated) report_.status |= kStepStagnated;
  if (status_ == NewtonStatus::kNonFinite || !workspace_.d.allFinite()) {
    report_.status |= kStepNonFinite;
    return report_;
  }
  const StepForm& form = workspace_.form;
  state_.q_previous = state_.q;
  state_.v_previous = state_.v;
  // In q - q_v the digits of d are kept.
  Eigen::VectorXd& d = workspace_.external;
  space_.from_field(workspace_.d, d);
  state_.v = form.velocity_factor * (d + (state_.q - form.velocity_centre));
  state_.a = form.acceleration_factor * (d + (state_.q - form.acceleration_centre));
  state_.q += d;
  state_.elastic_energy = potential_.elastic_energy();
  ++state_.step;
  state_.time = static_cast<double>(state_.step) * scene_.time_step;
  state_.begins_anew = false;
  return report_;
}

FullReport step(const FullSpace& space, const StepScene& scene, State& state, FullWorkspace& workspace) noexcept {
  FullStep one(space, scene, state, workspace);
  one.begin();
  one.solve();
  return one.finish();
}

State make_state(const FullSpace& space, const Eigen::VectorXd& u, const Eigen::VectorXd& v, FullWorkspace& workspace) {
  State state;
  state.q = state.q_previous = u;
  state.v = state.v_previous = v;
  state.a = state.applied_force = Eigen::VectorXd::Zero(space.size());
  energies(space, {}, state, workspace);
  return state;
}

State make_state(const FullSpace& space, FullWorkspace& workspace) {
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(space.size());
  return make_state(space, rest, rest, workspace);
}

Energies energies(const FullSpace& space, const StepScene& scene, State& state, FullWorkspace& workspace) noexcept {
  // Elasticity at q, and the inertia of c_a = 1 and q_a = q - v.
  StepForm& form = workspace.form;
  form.velocity_factor = form.acceleration_factor = 1;
  form.velocity_centre = state.q;
  form.acceleration_centre = state.q - state.v;
  const StepScene bare;
  FullPotential potential(space, bare, form, workspace.potential);
  workspace.external.setZero();
  potential.begin(state.q, workspace.external);
  workspace.d.setZero();
  potential.evaluate_elements(workspace.d, FullPotential::Tangents::kNone, false);
  state.elastic_energy = potential.elastic_energy();
  const double kinetic = potential.undamped() - potential.elastic_energy();
  return {kinetic, state.elastic_energy, -(space.gravity_load() * scene.gravity).dot(state.q)};
}

}  // namespace exmat::runtime

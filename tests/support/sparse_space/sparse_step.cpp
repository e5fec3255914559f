#include "tests/support/sparse_space/sparse_step.h"

#include <algorithm>
#include <utility>

#include "common/core/timer.h"
#include "precompute/full_space/target_update.h"

namespace exmat::precompute {
namespace {

using runtime::NewtonReport;
using runtime::NewtonStatus;

bool pushes(const VertexForceConfig& force, double time) { return force.start <= time && time < force.end; }

}  // namespace

void SparseStep::gather_external_force() {
  const double midpoint = state_.time + 0.5 * scene_.time_step;
  Eigen::VectorXd forces = Eigen::VectorXd::Zero(3 * model_.rest.rows());
  for (const VertexForceConfig& force : scene_.forces)
    if (pushes(force, midpoint))
      for (const std::int64_t vertex : force.vertices) forces.segment<3>(3 * vertex) += force.force;
  terms_.external_force = model_.system.restrict(forces) + model_.gravity_load * scene_.gravity + state_.applied_force;
}

// The first step, one after contact, and one that a force begins or ends with have no smooth past.
bool SparseStep::begins_anew() const {
  const double midpoint = state_.time + 0.5 * scene_.time_step;
  return state_.begins_anew || std::ranges::any_of(scene_.forces, [&](const VertexForceConfig& force) {
           return pushes(force, midpoint) != pushes(force, midpoint - scene_.time_step);
         });
}

bool SparseStep::find_contacts() {
  if (!model_.contacts || scene_.obstacles.empty()) return false;
  const double dt = scene_.time_step;
  const auto capacity = scene_.obstacles.size() * static_cast<std::size_t>(model_.contacts->vertices());
  if (state_.contacts.held.size() < capacity) state_.contacts.held.resize(capacity);
  contacts_ = model_.contacts->begin(scene_.obstacles, static_cast<double>(state_.step + 1) * dt, dt, state_.q,
                                     state_.v, dt * dt * scene_.gravity.norm(), state_.contacts);
  if (contacts_.candidates.empty()) return false;
  terms_.contacts = &contacts_;
  return true;
}

void SparseStep::set_form(Integrator integrator) {
  if (integrator == Integrator::kNewmark)
    runtime::newmark_form(history(), begins_anew() ? start_acceleration() : state_.a, scene_.time_step, terms_.form);
  else if (integrator == Integrator::kBdf2 && !begins_anew())
    runtime::bdf2_form(history(), scene_.time_step, terms_.form);
  else
    runtime::backward_euler_form(history(), scene_.time_step, terms_.form);
}

// u_v by the formulas of the velocity's centre, of the deformations at the beginning and one step before.
void SparseStep::set_rate_centre(Integrator integrator) {
  if (!model_.frame) {
    terms_.rate_centre = terms_.form.velocity_centre;
    return;
  }
  const Deformation start(model_, state_.q);
  terms_.rate_centre = start.u();
  if (integrator == Integrator::kNewmark)
    terms_.rate_centre += 0.5 * scene_.time_step * start.rate(state_.v);
  else if (integrator == Integrator::kBdf2 && !begins_anew())
    terms_.rate_centre = (4 * start.u() - Deformation(model_, state_.q_previous).u()) / 3;
}

// Acceleration at the beginning of the step, by the equation of motion.
Eigen::VectorXd SparseStep::start_acceleration() {
  Eigen::VectorXd internal;
  LowerTriangle stiffness;
  model_.elasticity.force_and_stiffness(state_.q, runtime::Tangent::kExact, internal, stiffness);
  const Deformation start(model_, state_.q);
  const Eigen::VectorXd rate = start.rate(state_.v);
  const Eigen::VectorXd bending = start.to_frame(stiffness.selfadjointView<Eigen::Lower>() * start.to_world(rate));
  Eigen::VectorXd deforming = scene_.stiffness_damping * bending;
  deforming += scene_.mass_damping * (model_.system.mass * rate);
  update_targets(state_.q);
  for (const ExampleTerm& term : terms_.examples) {
    if (term.elasticity != nullptr) {
      Eigen::VectorXd pull;
      term.elasticity->force(state_.q - term.target, pull);
      internal += term.settings->stiffness * pull;
    }
    if (runtime::is_filtered(*term.settings))
      deforming += term.examples->filter(runtime::linear_stiffness(*term.settings) * (start.u() - term.target) +
                                         term.settings->damping * rate);
  }
  if (!workspace_.mass) {
    LowerTriangle mass = model_.elasticity.pattern();
    mass.coeffs() = model_.mass_values;
    workspace_.mass = std::make_unique<SupernodalCholesky>(mass);
    workspace_.mass->factorise(mass);
  }
  return workspace_.mass->solve(terms_.external_force - internal - start.force(deforming));
}

bool SparseStep::acts(std::size_t group) const {
  return group < scene_.examples.size() && runtime::acts(scene_.examples[group]);
}

void SparseStep::update_targets(const Eigen::VectorXd& q) {
  const Timer timer;
  terms_.examples.clear();
  report_.inverted_tets = 0;
  examples_ = state_.examples;
  std::optional<Deformation> deformation;
  for (std::size_t group = 0; group < model_.examples.size(); ++group) {
    if (!acts(group)) continue;
    if (!deformation) deformation.emplace(model_, q);
    const FullSpaceExamples& examples = model_.examples[group];
    examples_[group] = next_target(model_, group, scene_.examples[group], state_.examples[group], deformation->u(),
                                   workspace_.examples[group].target, report_);
    ExampleTerm& term = terms_.examples.emplace_back();
    term.examples = &examples;
    term.settings = &scene_.examples[group];
    term.target = target_displacement(model_, group, examples_[group]);
    if (runtime::elastic_factor(scene_.examples[group]) > 0) term.elasticity = undeformed(group, term.target);
  }
  report_.target_seconds += timer.seconds();
}

// The elasticity of which the target [f] is the undeformed shape.
const MeshElasticity* SparseStep::undeformed(std::size_t group, const Eigen::VectorXd& target) {
  auto& elasticity = workspace_.examples[group].elasticity;
  if (!elasticity) {
    elasticity = model_.elasticity;
    if (const auto shares = model_.examples[group].tet_shares()) elasticity->set_shares(*shares);
  }
  const Eigen::VectorXd displacement = model_.system.extend(target);
  const VertexArray shape = model_.rest + displacement.reshaped<Eigen::RowMajor>(model_.rest.rows(), 3);
  report_.inverted_tets += elasticity->set_undeformed(shape);
  return &*elasticity;
}

// The step to the predictor q_n + dt v_n or none, whichever has the lower potential.
void SparseStep::choose_first_iterate() {
  d_ = scene_.time_step * state_.v;
  if (potential_->start(d_) <= potential_->potential_at_start() || d_.isZero(0)) return;
  ++report_.line_search_evaluations;
  d_.setZero();
  potential_->start(d_);
}

void SparseStep::refresh_friction(runtime::FrictionChange& change) {
  if (terms_.contacts == nullptr) return;
  for (runtime::ContactCandidate& candidate : contacts_.candidates)
    change.refresh(contacts_.obstacles[static_cast<std::size_t>(candidate.obstacle)].obstacle->friction, candidate);
}

void SparseStep::add(const NewtonReport& newton) {
  report_.newton_iterations += newton.iterations;
  report_.line_search_evaluations += newton.line_search_evaluations;
  report_.factorisations += newton.factorisations;
  report_.projections += newton.projections;
  report_.residual = newton.residual;
}

void SparseStep::commit() {
  const runtime::StepForm& form = terms_.form;
  state_.q_previous = state_.q;
  state_.v_previous = state_.v;
  state_.v = form.velocity_factor * (d_ + (state_.q - form.velocity_centre));
  state_.a = form.acceleration_factor * (d_ + (state_.q - form.acceleration_centre));
  state_.q += d_;
  state_.elastic_energy = potential_->elastic_energy();
  ++state_.step;
  state_.time = static_cast<double>(state_.step) * scene_.time_step;
  state_.begins_anew = terms_.contacts != nullptr;
  state_.contacts.count = 0;
  state_.contacts.first_step = false;
  if (terms_.contacts != nullptr) {
    model_.contacts->commit(state_.q, contacts_, state_.contacts);
    report_.contacts = contacts_.touching;
    report_.contact_force = contacts_.total_force;
  }
  state_.examples = std::move(examples_);
}

bool SparseStep::begin() {
  gather_external_force();
  const Integrator integrator = find_contacts() ? Integrator::kBackwardEuler : scene_.integrator;
  set_form(integrator);
  set_rate_centre(integrator);
  potential_.emplace(model_, scene_, state_, terms_);
  choose_first_iterate();
  if (!d_.allFinite()) report_.status |= runtime::kStepNonFinite;
  if (!(report_.status & runtime::kStepNonFinite)) update_targets(state_.q + d_);
  if (report_.status & runtime::kStepNonFinite) return false;
  potential_->prepare();
  return true;
}

const SparseReport& SparseStep::finish(NewtonStatus status) {
  if (status == NewtonStatus::kNonFinite || !d_.allFinite()) report_.status |= runtime::kStepNonFinite;
  if (status == NewtonStatus::kIterationLimit) report_.status |= runtime::kStepIterationLimit;
  if (status == NewtonStatus::kStagnated) report_.status |= runtime::kStepStagnated;
  if (!(report_.status & runtime::kStepNonFinite)) commit();
  return report_;
}

}  // namespace exmat::precompute

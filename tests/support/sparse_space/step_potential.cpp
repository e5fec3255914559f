#include "tests/support/sparse_space/step_potential.h"

#include <algorithm>
#include <cmath>

namespace exmat::precompute {

using runtime::PotentialEvaluation;
using runtime::PotentialValue;

Deformation::Deformation(const SparseModel& model, const Eigen::VectorXd& q)
    : frame_(model.frame ? &*model.frame : nullptr), u_(q) {
  if (frame_ == nullptr) return;
  placement_ = frame_->place(q);
  u_ = frame_->deformation(*placement_);
}

StepPotential::StepPotential(const SparseModel& model, const FullSpaceScene& scene, const FullSpaceState& state,
                             const StepTerms& terms)
    : model_(model),
      scene_(scene),
      state_(state),
      terms_(terms),
      damped_(scene.mass_damping > 0 || scene.stiffness_damping > 0),
      reach_(model.rest.cwiseAbs().maxCoeff() + state.q.lpNorm<Eigen::Infinity>()) {}

bool StepPotential::filters() const { return std::ranges::any_of(scene_.examples, runtime::is_filtered); }

// k = kappa + c_kappa c_v; kappa is 0 of an elastic force.
double StepPotential::filter_stiffness(const ExampleTerm& term) const {
  return runtime::linear_stiffness(*term.settings) + term.settings->damping * terms_.form.velocity_factor;
}

double StepPotential::inertia_and_load(const Eigen::VectorXd& d) const {
  const Eigen::VectorXd offset = d + (state_.q - terms_.form.acceleration_centre);
  return 0.5 * terms_.form.acceleration_factor * offset.dot(model_.system.mass * offset) - terms_.external_force.dot(d);
}

double StepPotential::start(const Eigen::VectorXd& d) {
  const Eigen::VectorXd q = state_.q + d;
  elastic_energy_ = model_.elasticity.force_and_stiffness(q, runtime::Tangent::kExact, internal_force_, stiffness_);
  stiffness_is_current_ = true;
  if (deforms() && at_first_iterate_) first_.emplace(model_, q);
  return elastic_energy_ + inertia_and_load(d);
}

double StepPotential::potential_at_start() const {
  return state_.elastic_energy + inertia_and_load(Eigen::VectorXd::Zero(state_.q.size()));
}

void StepPotential::prepare() {
  const auto& form = terms_.form;
  linear_ =
      form.acceleration_factor * (model_.system.mass * (state_.q - form.acceleration_centre)) - terms_.external_force;
  if (!deforms()) return;
  start_deformation_ = Deformation(model_, state_.q).u();
  deformation_linear_.setZero(state_.q.size());
  const Eigen::VectorXd rate = form.velocity_factor * (start_deformation_ - terms_.rate_centre);
  if (damped_) {
    damping_ = scene_.stiffness_damping * stiffness_;
    damping_.coeffs() += scene_.mass_damping * model_.mass_values.array();
    deformation_linear_ += damping_product(rate);
  }
  // k (u_n - u_c) = kappa u_n + c_kappa u'.
  for (const ExampleTerm& term : terms_.examples)
    if (runtime::is_filtered(*term.settings))
      deformation_linear_ +=
          term.examples->filter(runtime::linear_stiffness(*term.settings) * (start_deformation_ - term.target) +
                                term.settings->damping * rate);
}

Eigen::VectorXd StepPotential::damping_product(const Eigen::VectorXd& u) const {
  return first_->to_frame(damping_.selfadjointView<Eigen::Lower>() * first_->to_world(u));
}

// sum k P u.
Eigen::VectorXd StepPotential::filtered(const Eigen::VectorXd& u) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(u.size());
  for (const ExampleTerm& term : terms_.examples)
    if (runtime::is_filtered(*term.settings)) sum += filter_stiffness(term) * term.examples->filter(u);
  return sum;
}

// c_v D u + sum k P u.
Eigen::VectorXd StepPotential::deformation_product(const Eigen::VectorXd& u) const {
  Eigen::VectorXd product = Eigen::VectorXd::Zero(u.size());
  if (damped_) product += terms_.form.velocity_factor * damping_product(u);
  if (filters()) product += filtered(u);
  return product;
}

PotentialValue StepPotential::sum(double elastic, double contact, const Eigen::VectorXd& d,
                                  const Eigen::VectorXd& inertia, const Eigen::VectorXd& change) const {
  PotentialValue total{elastic + contact + 0.5 * d.dot(inertia) + linear_.dot(d), elastic + contact};
  total.magnitude += (0.5 * inertia.cwiseAbs() + linear_.cwiseAbs()).dot(d.cwiseAbs());
  // Positions are rounded, and forces do work on that.
  total.magnitude += reach_ * internal_force_.lpNorm<1>();
  if (terms_.contacts != nullptr) total.magnitude += reach_ * terms_.contacts->force.lpNorm<1>();
  total.magnitude += reach_ * example_force_.lpNorm<1>();
  if (!deforms()) return total;
  const Eigen::VectorXd product = deformation_product(change);
  total.value += 0.5 * change.dot(product) + deformation_linear_.dot(change);
  const double reach = model_.frame ? reach_ : 0;
  total.magnitude +=
      (0.5 * product.cwiseAbs() + deformation_linear_.cwiseAbs()).dot((change.array().abs() + reach).matrix());
  return total;
}

PotentialValue StepPotential::value(const Eigen::VectorXd& d) const {
  const Eigen::VectorXd q = state_.q + d;
  const Eigen::VectorXd inertia = terms_.form.acceleration_factor * (model_.system.mass * d);
  const Eigen::VectorXd change = deforms() ? Deformation(model_, q).u() - start_deformation_ : Eigen::VectorXd();
  const double contact = terms_.contacts != nullptr ? model_.contacts->potential(q, *terms_.contacts) : 0;
  return sum(model_.elasticity.energy(q) + elastic_example_energy(q), contact, d, inertia, change);
}

double StepPotential::elastic_example_energy(const Eigen::VectorXd& q) const {
  double energy = 0;
  for (const ExampleTerm& term : terms_.examples)
    if (term.elasticity != nullptr) energy += term.settings->stiffness * term.elasticity->energy(q - term.target);
  return energy;
}

// Into example_force_; returns the energy.
double StepPotential::elastic_example_force(const Eigen::VectorXd& q) {
  double energy = 0;
  const bool any = std::ranges::any_of(terms_.examples, [](const auto& term) { return term.elasticity != nullptr; });
  if (any) example_force_.setZero(q.size());
  for (const ExampleTerm& term : terms_.examples) {
    if (term.elasticity == nullptr) continue;
    Eigen::VectorXd force;
    energy += term.settings->stiffness * term.elasticity->force(q - term.target, force);
    example_force_ += term.settings->stiffness * force;
  }
  return energy;
}

PotentialEvaluation StepPotential::evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) {
  elastic_energy_ = model_.elasticity.force(state_.q + d, internal_force_);
  stiffness_is_current_ = false;
  return evaluate_first(d, gradient);
}

PotentialEvaluation StepPotential::evaluate_first(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) {
  const Eigen::VectorXd q = state_.q + d;
  const Eigen::VectorXd inertia = terms_.form.acceleration_factor * (model_.system.mass * d);
  gradient = internal_force_ + linear_ + inertia;
  double contact = 0;
  Eigen::VectorXd change;
  if (deforms()) {
    here_.emplace(model_, q);
    change = here_->u() - start_deformation_;
    gradient += here_->force(deformation_linear_ + deformation_product(change));
  }
  const double example_energy = elastic_example_force(q);
  if (example_force_.size() > 0) gradient += example_force_;
  PotentialEvaluation evaluation;
  evaluation.force_scale =
      terms_.external_force.norm() + internal_force_.norm() + (linear_ + inertia + terms_.external_force).norm();
  if (terms_.contacts != nullptr) {
    model_.contacts->evaluate(q, *terms_.contacts);
    gradient -= terms_.contacts->force;
    contact = terms_.contacts->potential;
    evaluation.force_scale += terms_.contacts->force.norm();
  }
  evaluation.potential = sum(elastic_energy_ + example_energy, contact, d, inertia, change);
  return evaluation;
}

void StepPotential::assemble(const Eigen::VectorXd& d, runtime::Tangent tangent) {
  if (!stiffness_is_current_ || tangent != runtime::Tangent::kExact)
    elastic_energy_ = model_.elasticity.force_and_stiffness(state_.q + d, tangent, internal_force_, stiffness_);
  stiffness_is_current_ = true;
  // Damping by a stiffness that had to be projected would feed energy in.
  if (tangent != runtime::Tangent::kExact && at_first_iterate_ && scene_.stiffness_damping > 0) prepare();
  hessian_ = stiffness_;
  hessian_.coeffs() += terms_.form.acceleration_factor * model_.mass_values.array();
  if (damped_) hessian_.coeffs() += terms_.form.velocity_factor * damping_.coeffs();
  for (const ExampleTerm& term : terms_.examples) {
    if (term.elasticity == nullptr) continue;
    LowerTriangle stiffness;
    Eigen::VectorXd unused;
    term.elasticity->force_and_stiffness(state_.q + d - term.target, tangent, unused, stiffness);
    hessian_.coeffs() += term.settings->stiffness * stiffness.coeffs();
  }
  if (terms_.contacts != nullptr) model_.contacts->add_stiffness(*terms_.contacts, hessian_);
}

Eigen::VectorXd StepPotential::product(const Eigen::VectorXd& x) const {
  Eigen::VectorXd result = hessian_.selfadjointView<Eigen::Lower>() * x;
  if (filters()) result += filter_product(x);
  return result;
}

Eigen::VectorXd StepPotential::filter_product(const Eigen::VectorXd& x) const {
  if (!filters()) return {};
  return here_->force(filtered(here_->rate(x)));
}

}  // namespace exmat::precompute

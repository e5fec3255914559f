#include "precompute/reference/step_potential.h"

#include <cmath>

namespace exmat::precompute {

using runtime::PotentialEvaluation;
using runtime::PotentialValue;

Deformation::Deformation(const FullSpaceModel& model, const Eigen::VectorXd& q)
    : frame_(model.frame ? &*model.frame : nullptr), u_(q) {
  if (frame_ == nullptr) return;
  placement_ = frame_->place(q);
  u_ = frame_->deformation(*placement_);
}

StepPotential::StepPotential(const FullSpaceModel& model, const FullSpaceScene& scene, const FullSpaceState& state,
                             const StepTerms& terms)
    : model_(model),
      scene_(scene),
      state_(state),
      terms_(terms),
      damped_(scene.mass_damping > 0 || scene.stiffness_damping > 0),
      skew_(terms.examples && !model.examples->symmetric()) {
  if (terms.examples)
    filter_stiffness_ = scene.examples->stiffness + scene.examples->damping * terms.form.velocity_factor;
}

double StepPotential::inertia_and_load(const Eigen::VectorXd& q) const {
  const Eigen::VectorXd offset = q - terms_.form.acceleration_centre;
  return 0.5 * terms_.form.acceleration_factor * offset.dot(model_.system.mass * offset) -
         terms_.external_force.dot(q - state_.q);
}

double StepPotential::start(const Eigen::VectorXd& first_iterate) {
  elastic_energy_ =
      model_.elasticity.force_and_stiffness(first_iterate, runtime::Tangent::kExact, internal_force_, stiffness_);
  stiffness_is_current_ = true;
  if (deforms()) first_.emplace(model_, first_iterate);
  return elastic_energy_ + inertia_and_load(first_iterate);
}

double StepPotential::potential_at_start() const { return state_.elastic_energy + inertia_and_load(state_.q); }

Eigen::VectorXd StepPotential::stiffness_product(const Eigen::VectorXd& x) const {
  return stiffness_.selfadjointView<Eigen::Lower>() * x;
}

void StepPotential::prepare() {
  const auto& form = terms_.form;
  linear_ =
      form.acceleration_factor * (model_.system.mass * (state_.q - form.acceleration_centre)) - terms_.external_force;
  frozen_.setZero(state_.q.size());
  next_frozen_ = frozen_;
  if (!deforms()) return;
  start_deformation_ = Deformation(model_, state_.q).u();
  deformation_linear_.setZero(state_.q.size());
  const Eigen::VectorXd rate = form.velocity_factor * (start_deformation_ - terms_.rate_centre);
  if (damped_) {
    damping_ = scene_.stiffness_damping * stiffness_;
    damping_.coeffs() += scene_.mass_damping * model_.mass_values.array();
    deformation_linear_ += damping_product(rate);
  }
  if (!terms_.examples) return;
  // k (u_n - u_c) = kappa u_n + c_kappa u'.
  const auto& settings = *scene_.examples;
  deformation_linear_ +=
      model_.examples->filter(settings.stiffness * (start_deformation_ - terms_.target) + settings.damping * rate);
}

Eigen::VectorXd StepPotential::damping_product(const Eigen::VectorXd& u) const {
  return first_->to_frame(damping_.selfadjointView<Eigen::Lower>() * first_->to_world(u));
}

// c_v D u + k P u.
Eigen::VectorXd StepPotential::deformation_product(const Eigen::VectorXd& u) const {
  Eigen::VectorXd product = Eigen::VectorXd::Zero(u.size());
  if (damped_) product += terms_.form.velocity_factor * damping_product(u);
  if (terms_.examples) product += filter_stiffness_ * model_.examples->filter(u);
  return product;
}

PotentialValue StepPotential::sum(double elastic, double contact, const Eigen::VectorXd& q,
                                  const Eigen::VectorXd& offset_product, const Eigen::VectorXd& change) const {
  const Eigen::VectorXd offset = q - state_.q;
  PotentialValue total;
  for (const double term : {elastic, contact, 0.5 * offset.dot(offset_product), linear_.dot(offset)}) {
    total.value += term;
    total.magnitude += std::abs(term);
  }
  if (!deforms()) return total;
  const double quadratic = 0.5 * change.dot(deformation_product(change));
  total.value += quadratic + (deformation_linear_ + frozen_).dot(change);
  total.magnitude += std::abs(quadratic) + std::abs(deformation_linear_.dot(change));
  return total;
}

PotentialValue StepPotential::value(const Eigen::VectorXd& q) const {
  const Eigen::VectorXd product = terms_.form.acceleration_factor * (model_.system.mass * (q - state_.q));
  const Eigen::VectorXd change = deforms() ? Deformation(model_, q).u() - start_deformation_ : Eigen::VectorXd();
  const double contact = terms_.contacts != nullptr ? model_.contacts->potential(q, *terms_.contacts) : 0;
  return sum(model_.elasticity.energy(q), contact, q, product, change);
}

PotentialEvaluation StepPotential::evaluate(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) {
  elastic_energy_ = model_.elasticity.force(q, internal_force_);
  stiffness_is_current_ = false;
  return evaluate_first(q, gradient);
}

PotentialEvaluation StepPotential::evaluate_first(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) {
  const auto& form = terms_.form;
  const Eigen::VectorXd product = form.acceleration_factor * (model_.system.mass * (q - state_.q));
  gradient = internal_force_ + linear_ + product;
  double contact = 0;
  Eigen::VectorXd change;
  if (deforms()) {
    here_.emplace(model_, q);
    change = here_->u() - start_deformation_;
    gradient += here_->force(deformation_linear_ + deformation_product(change));
    if (skew_)
      next_frozen_ =
          0.5 * filter_stiffness_ * (model_.examples->filter(change) - model_.examples->transposed_filter(change));
  }
  PotentialEvaluation evaluation;
  const Eigen::VectorXd inertia = linear_ + product + terms_.external_force;
  evaluation.force_scale = terms_.external_force.norm() + internal_force_.norm() + inertia.norm();
  if (terms_.contacts != nullptr) {
    model_.contacts->evaluate(q, *terms_.contacts);
    gradient -= terms_.contacts->force;
    contact = terms_.contacts->potential;
    evaluation.force_scale += terms_.contacts->force.norm();
  }
  evaluation.potential = sum(elastic_energy_, contact, q, product, change);
  return evaluation;
}

void StepPotential::accept(PotentialEvaluation& evaluation) {
  at_first_iterate_ = false;
  if (!skew_) return;
  const Eigen::VectorXd change = here_->u() - start_deformation_;
  evaluation.potential.value += (next_frozen_ - frozen_).dot(change);
  frozen_ = next_frozen_;
}

void StepPotential::assemble(const Eigen::VectorXd& q, runtime::Tangent tangent) {
  if (!stiffness_is_current_ || tangent != runtime::Tangent::kExact)
    elastic_energy_ = model_.elasticity.force_and_stiffness(q, tangent, internal_force_, stiffness_);
  stiffness_is_current_ = true;
  // Damping by a stiffness that had to be projected would feed energy in.
  if (tangent != runtime::Tangent::kExact && at_first_iterate_ && scene_.stiffness_damping > 0) prepare();
  hessian_ = stiffness_;
  hessian_.coeffs() += terms_.form.acceleration_factor * model_.mass_values.array();
  if (damped_) hessian_.coeffs() += terms_.form.velocity_factor * damping_.coeffs();
  if (terms_.contacts != nullptr) model_.contacts->add_stiffness(*terms_.contacts, hessian_);
}

Eigen::VectorXd StepPotential::product(const Eigen::VectorXd& x) const {
  Eigen::VectorXd result = hessian_.selfadjointView<Eigen::Lower>() * x;
  if (!terms_.examples) return result;
  const Eigen::VectorXd change = here_->rate(x);
  Eigen::VectorXd filtered = model_.examples->filter(change);
  if (skew_) filtered = 0.5 * (filtered + model_.examples->transposed_filter(change));
  return result + filter_stiffness_ * here_->force(filtered);
}

}  // namespace exmat::precompute

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
      skew_(terms.examples && !model.examples->symmetric()),
      reach_(model.rest.cwiseAbs().maxCoeff() + state.q.lpNorm<Eigen::Infinity>()) {
  if (terms.examples)
    filter_stiffness_ = scene.examples->stiffness + scene.examples->damping * terms.form.velocity_factor;
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

PotentialValue StepPotential::sum(double elastic, double contact, const Eigen::VectorXd& d,
                                  const Eigen::VectorXd& inertia, const Eigen::VectorXd& change) const {
  PotentialValue total{elastic + contact + 0.5 * d.dot(inertia) + linear_.dot(d), elastic + contact};
  total.magnitude += (0.5 * inertia.cwiseAbs() + linear_.cwiseAbs()).dot(d.cwiseAbs());
  // Positions are rounded, and forces do work on that.
  total.magnitude += reach_ * internal_force_.lpNorm<1>();
  if (terms_.contacts != nullptr) total.magnitude += reach_ * terms_.contacts->force.lpNorm<1>();
  if (terms_.example_elasticity != nullptr)
    total.magnitude += reach_ * scene_.example_elasticity * example_force_.lpNorm<1>();
  if (!deforms()) return total;
  const Eigen::VectorXd product = deformation_product(change), linear = deformation_linear_ + frozen_;
  total.value += 0.5 * change.dot(product) + linear.dot(change);
  const double reach = model_.frame ? reach_ : 0;
  total.magnitude += (0.5 * product.cwiseAbs() + linear.cwiseAbs()).dot((change.array().abs() + reach).matrix());
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
  if (terms_.example_elasticity == nullptr) return 0;
  return scene_.example_elasticity * terms_.example_elasticity->energy(q - terms_.target);
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
    if (skew_)
      next_frozen_ =
          0.5 * filter_stiffness_ * (model_.examples->filter(change) - model_.examples->transposed_filter(change));
  }
  double example_energy = 0;
  if (terms_.example_elasticity != nullptr) {
    const double share = scene_.example_elasticity;
    example_energy = share * terms_.example_elasticity->force(q - terms_.target, example_force_);
    gradient += share * example_force_;
  }
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

void StepPotential::accept(PotentialEvaluation& evaluation) {
  at_first_iterate_ = false;
  if (!skew_) return;
  const Eigen::VectorXd change = here_->u() - start_deformation_;
  evaluation.potential.value += (next_frozen_ - frozen_).dot(change);
  frozen_ = next_frozen_;
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
  if (terms_.example_elasticity != nullptr) {
    LowerTriangle stiffness;
    terms_.example_elasticity->force_and_stiffness(state_.q + d - terms_.target, tangent, example_force_, stiffness);
    hessian_.coeffs() += scene_.example_elasticity * stiffness.coeffs();
  }
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

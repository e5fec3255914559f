#include "runtime/sim/incremental_potential.h"

#include <cmath>

namespace exmat::runtime {
namespace {

PotentialValue& operator+=(PotentialValue& sum, const PotentialValue& term) {
  sum.value += term.value;
  sum.magnitude += term.magnitude;
  return sum;
}

PotentialValue term(double value) { return {value, std::abs(value)}; }

}  // namespace

IncrementalPotential::IncrementalPotential(const Model& model, const StepScene& scene, Workspace& workspace) noexcept
    : model_(model), scene_(scene), workspace_(workspace), examples_(runs_examples(model, scene)) {}

double IncrementalPotential::without_damping(const Eigen::VectorXd& q, double elastic_energy) const noexcept {
  const StepForm& form = workspace_.form;
  return 0.5 * form.acceleration_factor * (q - form.acceleration_centre).squaredNorm() + elastic_energy -
         workspace_.external_force.dot(q);
}

PotentialEvaluation IncrementalPotential::gradient_and_hessian(const Eigen::VectorXd& q, Eigen::VectorXd& gradient,
                                                               Eigen::MatrixXd& hessian) noexcept {
  {
    const StageTimer timer(workspace_.profile, Stage::kInternalForce);
    elastic_energy_ =
        model_.elasticity.force_and_stiffness(q, workspace_.elasticity, workspace_.internal_force, hessian);
  }
  freeze_damping(hessian);
  complete_hessian(hessian);
  return assemble(q, gradient);
}

PotentialEvaluation IncrementalPotential::gradient(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept {
  at_first_iterate_ = false;
  const StageTimer timer(workspace_.profile, Stage::kInternalForce);
  elastic_energy_ = model_.elasticity.force(q, workspace_.elasticity, workspace_.internal_force);
  return assemble(q, gradient);
}

void IncrementalPotential::hessian(const Eigen::VectorXd& q, Tangent tangent, Eigen::MatrixXd& hessian) noexcept {
  const StageTimer timer(workspace_.profile, Stage::kInternalForce);
  model_.elasticity.stiffness(q, tangent, workspace_.elasticity, hessian);
  // Damping by a stiffness that had to be projected would feed energy in.
  if (at_first_iterate_) freeze_damping(hessian);
  complete_hessian(hessian);
}

PotentialValue IncrementalPotential::value(const Eigen::VectorXd& q) noexcept {
  return sum_of_terms(q, model_.elasticity.energy(q, workspace_.elasticity), nullptr);
}

PotentialEvaluation IncrementalPotential::assemble(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept {
  gradient = workspace_.internal_force - workspace_.external_force;
  const PotentialValue potential = sum_of_terms(q, elastic_energy_, &gradient);
  workspace_.offset = q - workspace_.form.acceleration_centre;
  const double inertia = workspace_.form.acceleration_factor * workspace_.offset.norm();
  return {potential, workspace_.external_force.norm() + workspace_.internal_force.norm() + inertia};
}

PotentialValue IncrementalPotential::sum_of_terms(const Eigen::VectorXd& q, double elastic_energy,
                                                  Eigen::VectorXd* gradient) noexcept {
  const StepForm& form = workspace_.form;
  workspace_.offset = q - form.acceleration_centre;
  if (gradient != nullptr) *gradient += form.acceleration_factor * workspace_.offset;
  PotentialValue sum = term(0.5 * form.acceleration_factor * workspace_.offset.squaredNorm());
  sum += term(elastic_energy);
  sum += term(-workspace_.external_force.dot(q));
  if (scene_.mass_damping > 0 || scene_.stiffness_damping > 0) sum += add_damping(q, gradient);
  if (examples_) sum += add_examples(q, gradient);
  return sum;
}

PotentialValue IncrementalPotential::add_damping(const Eigen::VectorXd& q, Eigen::VectorXd* gradient) noexcept {
  const StepForm& form = workspace_.form;
  Eigen::VectorXd& offset = workspace_.offset;
  Eigen::VectorXd& product = workspace_.product;
  offset = q - form.velocity_centre;
  product = scene_.mass_damping * offset;
  if (scene_.stiffness_damping > 0) product.noalias() += workspace_.damping.selfadjointView<Eigen::Lower>() * offset;
  product *= form.velocity_factor;
  if (gradient != nullptr) *gradient += product;
  return term(0.5 * offset.dot(product));
}

PotentialValue IncrementalPotential::add_examples(const Eigen::VectorXd& q, Eigen::VectorXd* gradient) noexcept {
  const ExampleForce& example = workspace_.example_force;
  const ShapeFilter& filter = model_.examples->filter;
  Eigen::VectorXd& offset = workspace_.offset;
  Eigen::VectorXd& product = workspace_.product;
  offset = q - example.centre;
  product.noalias() = example.stiffness * (filter.matrix() * offset);
  PotentialValue sum = term(0.5 * offset.dot(product));
  sum += term(-example.pull.dot(q));
  if (gradient != nullptr) *gradient += product - example.pull;
  if (filter.is_symmetric()) return sum;
  if (gradient != nullptr) workspace_.skew_force.noalias() = example.stiffness * (filter.skew_part() * offset);
  sum += term(workspace_.skew_force.dot(q));
  return sum;
}

void IncrementalPotential::freeze_damping(const Eigen::MatrixXd& stiffness) noexcept {
  if (scene_.stiffness_damping > 0)
    workspace_.damping.triangularView<Eigen::Lower>() = scene_.stiffness_damping * stiffness;
}

void IncrementalPotential::complete_hessian(Eigen::MatrixXd& hessian) const noexcept {
  const StepForm& form = workspace_.form;
  hessian.diagonal().array() += form.acceleration_factor + form.velocity_factor * scene_.mass_damping;
  if (scene_.stiffness_damping > 0) hessian.triangularView<Eigen::Lower>() += form.velocity_factor * workspace_.damping;
  if (examples_)
    hessian.triangularView<Eigen::Lower>() +=
        workspace_.example_force.stiffness * model_.examples->filter.symmetric_part();
}

}  // namespace exmat::runtime

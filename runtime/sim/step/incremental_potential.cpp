#include "runtime/sim/step/incremental_potential.h"

#include <cmath>
#include <limits>

#include "runtime/sim/step/example_forces.h"

namespace exmat::runtime {
namespace {

constexpr double kSmallRatio = 0.1;  // of inertia: beyond it a factorisation costs less than the terms of a series
constexpr double kGyroscopicError = 1e-5;  // of a direction, by the terms that are left out

}  // namespace

IncrementalPotential::IncrementalPotential(const Model& model, const StepScene& scene, const State& state,
                                           Workspace& workspace) noexcept
    : model_(model), scene_(scene), state_(state), workspace_(workspace), frame_forces_(model.frame->exerts_forces()) {
  for (const ExampleSettings& examples : scene.examples) elastic_examples_ += elastic_factor(examples);
}

double IncrementalPotential::internal_flops(bool stiffness) const noexcept {
  double flops = model_.internal_force.force_flops() + (stiffness ? model_.internal_force.stiffness_flops() : 0);
  for (std::size_t i = 0; elastic_examples_ > 0 && i < scene_.examples.size(); ++i) {
    if (elastic_factor(scene_.examples[i]) == 0) continue;
    const ElementPotential& elements = model_.examples[i].elasticity->potential();
    flops += elements.force_flops() + (stiffness ? elements.stiffness_flops() : 0);
  }
  return flops;
}

double IncrementalPotential::inertia_and_load(const Eigen::VectorXd& q) const noexcept {
  const StepForm& form = workspace_.form;
  return 0.5 * form.acceleration_factor * (q - form.acceleration_centre).squaredNorm() -
         workspace_.external_force.dot(q);
}

double IncrementalPotential::start(const Eigen::VectorXd& first_iterate) noexcept {
  const StageTimer timer(workspace_.profile, Stage::kInternalForce, internal_flops(true));
  elastic_energy_ = model_.internal_force.force_and_stiffness(first_iterate, workspace_.elasticity,
                                                              workspace_.internal_force, workspace_.newton.hessian);
  // An elastic example is as stiff as the material, but for its factor.
  force_rounding_ = kForceRounding * (1 + elastic_examples_) * workspace_.newton.hessian.diagonal().cwiseAbs().sum();
  return elastic_energy_ + inertia_and_load(first_iterate);
}

double IncrementalPotential::potential_of_start(const Eigen::VectorXd& first_iterate) noexcept {
  const StageTimer timer(workspace_.profile, Stage::kInternalForce);
  return model_.internal_force.energy(first_iterate, workspace_.elasticity) + inertia_and_load(first_iterate);
}

double IncrementalPotential::potential_at_start() const noexcept {
  return state_.elastic_energy + inertia_and_load(state_.q);
}

/// A and its gradient g at q_n: value 1/2 x^T A x + g^T x, x = q - q_n. Differences from q_n keep the digits that
/// products with c_a would lose.
void IncrementalPotential::prepare() noexcept {
  at_first_iterate_ = true;
  const StepForm& form = workspace_.form;
  Eigen::MatrixXd& A = workspace_.quadratic;
  Eigen::VectorXd& g = workspace_.linear;
  const Eigen::Index modes = model_.modes();
  const double diagonal = form.acceleration_factor + form.velocity_factor * scene_.mass_damping;
  const auto symmetric = workspace_.newton.hessian.selfadjointView<Eigen::Lower>();

  g = form.acceleration_factor * (state_.q - form.acceleration_centre) - workspace_.external_force;
  workspace_.offset = form.velocity_factor * (state_.q - form.velocity_centre);
  if (scene_.mass_damping > 0) g += scene_.mass_damping * workspace_.offset;
  auto used = A.topRows(modes);
  if (scene_.stiffness_damping > 0) {
    g.noalias() += scene_.stiffness_damping * (symmetric * workspace_.offset);
    used = scene_.stiffness_damping * form.velocity_factor * workspace_.newton.hessian;
    used.triangularView<Eigen::StrictlyUpper>() = used.transpose();
  } else {
    used.setZero();
  }
  add_example_forces();
  A.diagonal().array() += diagonal;
  workspace_.frozen_force.setZero();
}

void IncrementalPotential::add_example_forces() noexcept {
  auto used = workspace_.quadratic.topRows(model_.modes());
  Eigen::VectorXd& g = workspace_.linear;
  for (std::size_t i = 0; i < scene_.examples.size(); ++i) {
    if (!is_filtered(scene_.examples[i])) continue;
    const ExampleForce& example = workspace_.examples[i].force;
    const Eigen::MatrixXd& filter = model_.examples[i].filter;
    used += example.stiffness * filter;
    workspace_.offset = example.stiffness * (state_.q - example.centre);
    g.noalias() += filter * workspace_.offset;
    g -= example.pull;
  }
}

PotentialEvaluation IncrementalPotential::evaluate(const Eigen::VectorXd& q, Eigen::VectorXd& gradient,
                                                   Eigen::MatrixXd& hessian) noexcept {
  PotentialEvaluation evaluation = assemble(q, gradient);
  accept(evaluation);
  add_quadratic(hessian);
  if (elastic_examples_ > 0) add_elastic_example_stiffness(model_, scene_, q, Tangent::kExact, workspace_, hessian);
  return evaluation;
}

PotentialEvaluation IncrementalPotential::evaluate(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept {
  const StageTimer timer(workspace_.profile, Stage::kInternalForce, internal_flops(false));
  at_first_iterate_ = false;
  elastic_energy_ = model_.internal_force.force(q, workspace_.elasticity, workspace_.internal_force);
  return assemble(q, gradient);
}

PotentialValue IncrementalPotential::value(const Eigen::VectorXd& q) noexcept {
  const StageTimer timer(workspace_.profile, Stage::kInternalForce, internal_flops(false));
  set_offset(q);
  double energy = model_.internal_force.energy(q, workspace_.elasticity);
  if (elastic_examples_ > 0) energy += elastic_example_energy(model_, scene_, q, workspace_);
  return quadratic(energy);
}

void IncrementalPotential::hessian(const Eigen::VectorXd& q, Tangent tangent, Eigen::MatrixXd& hessian) noexcept {
  const StageTimer timer(workspace_.profile, Stage::kInternalForce, internal_flops(true));
  model_.internal_force.stiffness(q, tangent, workspace_.elasticity, hessian);
  // Damping by a stiffness that had to be projected would feed energy in.
  if (at_first_iterate_ && scene_.stiffness_damping > 0) prepare();
  add_quadratic(hessian);
  if (elastic_examples_ > 0) add_elastic_example_stiffness(model_, scene_, q, tangent, workspace_, hessian);
}

void IncrementalPotential::accept(PotentialEvaluation& evaluation) noexcept {
  if (!frame_forces_) return;
  workspace_.frozen_force.swap(workspace_.next_frozen_force);
  evaluation.potential.value +=
      workspace_.frozen_force.dot(workspace_.offset) - workspace_.next_frozen_force.dot(workspace_.offset);
}

/// q - q_n and its product with A.
void IncrementalPotential::set_offset(const Eigen::VectorXd& q) noexcept {
  workspace_.offset = q - state_.q;
  const Eigen::MatrixXd& A = workspace_.quadratic;
  kernels().matrix_vector(A.data(), A.rows(), A.cols(), A.outerStride(), workspace_.offset.data(),
                          workspace_.product.data());
}

/// Potential and gradient at q from internal_force and elastic_energy_; leaves q - q_n in the workspace.
PotentialEvaluation IncrementalPotential::assemble(const Eigen::VectorXd& q, Eigen::VectorXd& gradient) noexcept {
  const StepForm& form = workspace_.form;
  set_offset(q);
  gradient = workspace_.internal_force + workspace_.linear + workspace_.product.head(q.size());
  double energy = elastic_energy_;
  if (elastic_examples_ > 0) energy += add_elastic_example_forces(model_, scene_, q, workspace_, gradient);
  const double inertia = form.acceleration_factor * (q - form.acceleration_centre).norm();
  // Elements deformed without stress, as those that StVK reflects, cancel to rounding: no residual comes below it.
  const double rounding = force_rounding_ * q.norm() / scene_.newton.tolerance;
  PotentialEvaluation evaluation{
      quadratic(energy), workspace_.external_force.norm() + workspace_.internal_force.norm() + inertia + rounding};
  if (frame_forces_) {
    if (!update_frozen_force(q)) evaluation.potential.value = std::numeric_limits<double>::infinity();
    gradient += workspace_.next_frozen_force;
  }
  return evaluation;
}

/// Writes the forces without a potential at q to next_frozen_force. False where the frame has no motion for it.
bool IncrementalPotential::update_frozen_force(const Eigen::VectorXd& q) noexcept {
  workspace_.next_frozen_force.setZero();
  const StepForm& form = workspace_.form;
  const bool found = model_.frame->update_force(q, form.velocity_factor, form.velocity_centre, workspace_.frame);
  workspace_.next_frozen_force -= *model_.frame->force(workspace_.frame);
  return found;
}

bool IncrementalPotential::is_weak(double ratio) noexcept { return ratio <= kSmallRatio; }

int IncrementalPotential::gyroscopic_terms(double ratio) noexcept {
  if (!is_weak(ratio)) return 0;  // since the factorisation it has grown beyond what the series is for
  double error = ratio;
  int terms = 0;
  for (; error > kGyroscopicError; error *= ratio) ++terms;
  return terms;
}

/// The antisymmetric part of the frame's forces, where it is not small beside c_a.
const Eigen::MatrixXd* IncrementalPotential::gyroscopic() const noexcept {
  const double factor = workspace_.form.velocity_factor;
  if (is_weak(model_.frame->gyroscopic_ratio(factor, workspace_.frame))) return nullptr;
  return model_.frame->gyroscopic(factor, workspace_.frame);
}

int IncrementalPotential::gyroscopic_terms() const noexcept {
  return gyroscopic_terms(model_.frame->gyroscopic_ratio(workspace_.form.velocity_factor, workspace_.frame));
}

const Eigen::VectorXd& IncrementalPotential::gyroscopic_product(const Eigen::VectorXd& x) const noexcept {
  return *model_.frame->gyroscopic_product(workspace_.form.velocity_factor, x, workspace_.frame);
}

/// Potential from offset and its product with A, with the elastic energy.
PotentialValue IncrementalPotential::quadratic(double elastic_energy) noexcept {
  const double square = 0.5 * workspace_.offset.dot(workspace_.product.head(workspace_.offset.size()));
  const double linear = workspace_.linear.dot(workspace_.offset);
  PotentialValue sum{elastic_energy + square + linear, std::abs(elastic_energy) + std::abs(square) + std::abs(linear)};
  if (frame_forces_) sum.value += workspace_.frozen_force.dot(workspace_.offset);
  return sum;
}

void IncrementalPotential::add_quadratic(Eigen::MatrixXd& hessian) const noexcept {
  hessian.triangularView<Eigen::Lower>() += workspace_.quadratic.topRows(hessian.rows());
  model_.frame->add_stiffness(workspace_.form.velocity_factor, workspace_.frame, hessian);
}

}  // namespace exmat::runtime

#include "runtime/sim/elasticity/reduced_elasticity.h"

namespace exmat::runtime {
namespace {

constexpr double kMostFlops = 0.7;  // of the elements': below it the polynomial is faster

}  // namespace

std::vector<LameParameters> cubature_lame(const CubatureData& cubature) {
  std::vector<LameParameters> lame;
  for (Eigen::Index j = 0; j < cubature.weights.size(); ++j)
    lame.push_back(lame_parameters(cubature.youngs_modulus[j], cubature.poisson_ratio[j]));
  return lame;
}

WeightedLame::WeightedLame(const Eigen::VectorXd& weighted_volumes, const std::vector<LameParameters>& lame)
    : mu(weighted_volumes.size()), lambda(weighted_volumes.size()) {
  for (Eigen::Index j = 0; j < weighted_volumes.size(); ++j) {
    const LameParameters& own = lame[static_cast<std::size_t>(j)];
    mu[j] = weighted_volumes[j] * own.mu;
    lambda[j] = weighted_volumes[j] * own.lambda;
  }
}

ReducedElasticity::ReducedElasticity(MaterialModel material, const RowMatrix& gradient,
                                     const Eigen::VectorXd& weighted_volumes, const std::vector<LameParameters>& lame,
                                     const RowMatrix& variance)
    : kind_(law_kind(material)), potential_(gradient), lame_(weighted_volumes, lame), variance_(variance) {
  if (material == MaterialModel::kStVenantKirchhoff && modes() <= kMostPolynomialModes &&
      StiffnessPolynomial::flops(modes()) < kMostFlops * potential_.stiffness_flops())
    polynomial_ = std::make_shared<LazyStiffnessPolynomial>();
}

ReducedElasticity::ReducedElasticity(MaterialModel material, const CubatureData& cubature)
    : ReducedElasticity(material, cubature.gradient, cubature.weights.cwiseProduct(cubature.volumes),
                        cubature_lame(cubature), cubature.variance) {}

void ReducedElasticity::prepare_lanes() const {
  if (!polynomial_) return;
  const auto count = elements();
  std::call_once(polynomial_->once, [&] {
    polynomial_->made.emplace(potential_.gradient(), Eigen::Map<const Eigen::VectorXd>(lame_.mu.data(), count),
                              Eigen::Map<const Eigen::VectorXd>(lame_.lambda.data(), count));
  });
}

void ReducedElasticity::lanes_force_and_stiffness(const double* q, Precision precision, double* scratch, double* energy,
                                                  double* force, double* stiffness) const noexcept {
  if (polynomial_) {
    potential_.lanes_force(law(), q, energy, force);
    polynomial_->made->evaluate_lanes(q, precision, stiffness);
  } else {
    potential_.lanes_force_and_stiffness(law(), q, precision, energy, force, stiffness);
  }
  variance_.add_lanes_force(q, scratch, energy, force);
  variance_.add_lanes_stiffness(stiffness);
}

double ReducedElasticity::lanes_stiffness_flops() const noexcept {
  return polynomial_ ? StiffnessPolynomial::flops(modes()) : potential_.stiffness_flops();
}

ElementLaw ReducedElasticity::law() const noexcept {
  ElementLaw law;
  law.kind = kind_;
  law.mu = lame_.mu.data();
  law.lambda = lame_.lambda.data();
  return law;
}

}  // namespace exmat::runtime

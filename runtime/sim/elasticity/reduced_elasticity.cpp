#include "runtime/sim/elasticity/reduced_elasticity.h"

namespace exmat::runtime {

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
                                     const Eigen::VectorXd& weighted_volumes, const std::vector<LameParameters>& lame)
    : kind_(law_kind(material)), potential_(gradient), lame_(weighted_volumes, lame) {}

ReducedElasticity::ReducedElasticity(MaterialModel material, const CubatureData& cubature)
    : ReducedElasticity(material, cubature.gradient, cubature.weights.cwiseProduct(cubature.volumes),
                        cubature_lame(cubature)) {}

ElementLaw ReducedElasticity::law() const noexcept {
  ElementLaw law;
  law.kind = kind_;
  law.mu = lame_.mu.data();
  law.lambda = lame_.lambda.data();
  return law;
}

}  // namespace exmat::runtime

#include "precompute/shape_space/filter_functions.h"

#include <cmath>

#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/projection.h"

namespace exmat::precompute {

FilterFunctions::FilterFunctions(const LaplaceBasis& object, const TetMesh& mesh, const Eigen::VectorXd& density)
    : analysis(object.mass * object.eigenfunctions),
      root_over_analysis(std::sqrt(scalar_mass(mesh, density).sum())),
      is_uniform((density.array() == density[0]).all()) {}

Eigen::VectorXd filter_scale(const LaplaceBasis& object, const Eigen::VectorXd& weights,
                             const FilterFunctions& functions) {
  if (functions.is_uniform) return {};
  return functions.root_over_analysis * std::cbrt(object.volume) * weights.cwiseInverse();
}

RowMatrix weight_slopes(const LaplaceBasis& object, Weighting weighting, const ExampleSet& set) {
  const Eigen::VectorXd weights = descriptor_weights(object, weighting) / std::cbrt(object.volume);
  RowMatrix slopes(std::ssize(set.examples), 3 * weights.size());
  for (std::size_t k = 0; k < set.examples.size(); ++k)
    slopes.row(static_cast<Eigen::Index>(k)) =
        (weights.asDiagonal() * set.examples[k].descriptor).reshaped<Eigen::RowMajor>().transpose();
  return slopes;
}

}  // namespace exmat::precompute

#include "precompute/shape_space/filter_functions.h"

#include <cmath>

#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/projection.h"

namespace exmat::precompute {
namespace {

double root_of_mass(const TetMesh& mesh, const Eigen::VectorXd& density) {
  return std::sqrt(scalar_mass(mesh, density).sum());
}

}  // namespace

FilterFunctions::FilterFunctions(const LaplaceBasis& object, const TetMesh& mesh, const Eigen::VectorXd& density)
    : analysis(object.mass * object.eigenfunctions), root_over_analysis(root_of_mass(mesh, density)) {}

Eigen::VectorXd filter_scale(const LaplaceBasis& object, const Eigen::VectorXd& weights, const TetMesh& mesh,
                             const Eigen::VectorXd& density) {
  if ((density.array() == density[0]).all()) return {};
  return root_of_mass(mesh, density) * std::cbrt(object.volume) * weights.cwiseInverse();
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

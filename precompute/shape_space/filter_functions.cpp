#include "precompute/shape_space/filter_functions.h"

#include <cmath>

#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/projection.h"

namespace exmat::precompute {
namespace {

// Relative difference of P and its transpose that is rounding.
constexpr double kSymmetric = 1e-12;

}  // namespace

FilterFunctions::FilterFunctions(const LaplaceBasis& object, const TetMesh& mesh, const Eigen::VectorXd& density)
    : analysis(object.mass * object.eigenfunctions), synthesis(scalar_mass(mesh, density) * object.eigenfunctions) {
  const double ratio = synthesis.norm() / analysis.norm();
  symmetric = (synthesis - ratio * analysis).norm() <= kSymmetric * synthesis.norm();
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

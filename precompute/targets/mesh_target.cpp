#include "precompute/targets/mesh_target.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <string>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/cubature/element_samples.h"

namespace exmat::precompute {
namespace {

// Directions of the poses this much weaker than the strongest, squared, are rounding.
constexpr double kRank = 1e-12;

bool inverts(const RowMatrix& gradient, const Eigen::MatrixXd& poses) {
  const Eigen::MatrixXd H = gradient * poses;
  return std::ranges::any_of(H.colwise(), [](const auto& column) {
    const Eigen::Matrix<double, 9, 1> flat = column;
    return (Eigen::Matrix3d::Identity() + Eigen::Map<const RowMatrix3>(flat.data())).determinant() <= 0;
  });
}

}  // namespace

PoseCoordinates pose_range(const SparseMatrix& mass, const Eigen::MatrixXd& fields, const Eigen::MatrixXd& changes) {
  const Eigen::MatrixXd mass_fields = mass * fields;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(fields.transpose() * mass_fields);
  const Eigen::VectorXd& values = gram.eigenvalues();
  const Eigen::Index rank = (values.array() > kRank * values.tail(1)[0]).count();
  const Eigen::MatrixXd directions =
      gram.eigenvectors().rightCols(rank) * values.tail(rank).cwiseSqrt().cwiseInverse().asDiagonal();
  return {fields * directions, directions.transpose() * (mass_fields.transpose() * (fields * changes))};
}

Eigen::MatrixXd descriptor_changes(const RowMatrix& rest_descriptor, const ExampleSet& set) {
  Eigen::MatrixXd changes(rest_descriptor.size(), std::ssize(set.examples));
  for (Eigen::Index k = 0; k < changes.cols(); ++k)
    changes.col(k) =
        (set.examples[static_cast<std::size_t>(k)].descriptor - rest_descriptor).reshaped<Eigen::RowMajor>();
  return changes;
}

std::vector<ExampleData> examples_at(const Eigen::MatrixXd& poses) {
  std::vector<ExampleData> examples(static_cast<std::size_t>(poses.cols()));
  for (Eigen::Index k = 0; k < poses.cols(); ++k) {
    ExampleData& example = examples[static_cast<std::size_t>(k)];
    example.name = std::to_string(k);
    example.index = k;
    example.pose = poses.col(k);
  }
  return examples;
}

MeshTarget mesh_target(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                       EnergyReference reference) {
  const RowMatrix basis = system.extend(coordinates.basis);
  const ElementSamples samples(object.mesh, object.materials, basis);
  MeshTarget target;
  CubatureData all;
  all.gradient.resize(9 * samples.count(), basis.cols());
  for (Eigen::Index t = 0; t < samples.count(); ++t) {
    const RowMatrix gradient = samples.gradient(t);
    if (reference == EnergyReference::kExample && inverts(gradient, coordinates.poses)) continue;
    all.gradient.middleRows<9>(9 * std::ssize(target.tets)) = gradient;
    target.tets.push_back(t);
  }
  const auto count = std::ssize(target.tets);
  target.left_out = samples.count() - count;
  if (count == 0)
    throw InputError({"", "/examples", "poses that leave some tets of the object upright",
                      "poses that turn each of them inside out", "use milder poses"});
  all.gradient.conservativeResize(9 * count, Eigen::NoChange);
  all.weights = Eigen::VectorXd::Ones(count);
  all.volumes = tet_volumes(object.mesh)(target.tets);
  all.youngs_modulus = object.materials.youngs_modulus(target.tets);
  all.poisson_ratio = object.materials.poisson_ratio(target.tets);
  const auto complaint = target.solver.build(object.materials.model, all, examples_at(coordinates.poses),
                                             RowMatrix::Identity(basis.cols(), basis.cols()), reference);
  if (complaint) throw InputError(*complaint);
  return target;
}

}  // namespace exmat::precompute

#include "precompute/targets/mesh_target.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <string>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/targets/tet_forces.h"

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

void require_some(const std::vector<Eigen::Index>& tets) {
  if (!tets.empty()) return;
  throw InputError({"", "/examples", "poses that leave some tets of the object upright",
                    "poses that turn each of them inside out", "use milder poses"});
}

// Of these tets, each `weight` times.
void build_solver(const ObjectData& object, const ElementSamples& samples, const PoseCoordinates& coordinates,
                  EnergyReference reference, const std::vector<Eigen::Index>& tets, double weight,
                  runtime::TargetSolver& solver) {
  const auto count = std::ssize(tets);
  CubatureData elements;
  elements.gradient.resize(9 * count, samples.modes());
  for (Eigen::Index j = 0; j < count; ++j)
    elements.gradient.middleRows<9>(9 * j) = samples.gradient(tets[static_cast<std::size_t>(j)]);
  elements.weights = Eigen::VectorXd::Constant(count, weight);
  elements.volumes = tet_volumes(object.mesh)(tets);
  elements.youngs_modulus = object.materials.youngs_modulus(tets);
  elements.poisson_ratio = object.materials.poisson_ratio(tets);
  const auto complaint = solver.build(object.materials.model, elements, examples_at(coordinates.poses),
                                      RowMatrix::Identity(samples.modes(), samples.modes()), reference);
  if (complaint) throw InputError(*complaint);
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
  for (Eigen::Index t = 0; t < samples.count(); ++t)
    if (reference != EnergyReference::kExample || !inverts(samples.gradient(t), coordinates.poses))
      target.tets.push_back(t);
  target.left_out = samples.count() - std::ssize(target.tets);
  require_some(target.tets);
  build_solver(object, samples, coordinates, reference, target.tets, 1, target.solver);
  return target;
}

MeshTarget sampled_target(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                          EnergyReference reference, Eigen::Index most) {
  MeshTarget target;
  target.all = std::make_shared<TetForces>(object, system, coordinates, reference);
  target.tets = target.all->tets();
  target.left_out = object.mesh.tet_count() - std::ssize(target.tets);
  require_some(target.tets);
  const Eigen::Index all = std::ssize(target.tets), count = std::min(most, all);
  std::vector<Eigen::Index> sample;
  for (Eigen::Index i = 0; i < count; ++i) sample.push_back(target.tets[static_cast<std::size_t>(i * all / count)]);
  const RowMatrix basis = system.extend(coordinates.basis);
  build_solver(object, ElementSamples(object.mesh, object.materials, basis), coordinates, reference, sample,
               static_cast<double>(all) / static_cast<double>(count), target.solver);
  return target;
}

}  // namespace exmat::precompute

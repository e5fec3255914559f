#include "precompute/targets/mesh_target.h"

#include <Eigen/LU>
#include <algorithm>
#include <string>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/targets/element_forces.h"

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

void require_some(const std::vector<Eigen::Index>& elements) {
  if (!elements.empty()) return;
  throw InputError({"", "/examples", "poses that leave some tets of the object upright",
                    "poses that turn each of them inside out", "use milder poses"});
}

// Builds the solver from these elements, each `weight` times.
void build_solver(const ObjectData& object, const ElementSamples& samples, const PoseCoordinates& coordinates,
                  EnergyReference reference, const std::vector<Eigen::Index>& elements, double weight,
                  runtime::TargetSolver& solver) {
  CubatureData data = samples.data_of(elements);
  data.weights = Eigen::VectorXd::Constant(std::ssize(elements), weight);
  const auto complaint = solver.build(object.materials.model, data, examples_at(coordinates.poses),
                                      RowMatrix::Identity(samples.modes(), samples.modes()), reference);
  if (complaint) throw InputError(*complaint);
}

}  // namespace

PoseCoordinates pose_range(const SparseMatrix& mass, const Eigen::MatrixXd& fields, const Eigen::MatrixXd& changes) {
  const Eigen::MatrixXd mass_fields = mass * fields;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(Eigen::MatrixXd(fields.transpose() * mass_fields));
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
  for (Eigen::Index e = 0; e < samples.count(); ++e)
    if (reference != EnergyReference::kExample || !inverts(samples.gradient(e), coordinates.poses))
      target.elements.push_back(e);
  target.left_out = samples.count() - std::ssize(target.elements);
  require_some(target.elements);
  build_solver(object, samples, coordinates, reference, target.elements, 1, target.solver);
  return target;
}

MeshTarget sampled_target(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                          EnergyReference reference, Eigen::Index most) {
  MeshTarget target;
  target.all = std::make_shared<ElementForces>(object, system, coordinates, reference);
  target.elements = target.all->members();
  target.left_out = target.all->elements().count() - std::ssize(target.elements);
  require_some(target.elements);
  const Eigen::Index all = std::ssize(target.elements), count = std::min(most, all);
  std::vector<Eigen::Index> sample;
  for (Eigen::Index i = 0; i < count; ++i) sample.push_back(target.elements[static_cast<std::size_t>(i * all / count)]);
  const RowMatrix basis = system.extend(coordinates.basis);
  build_solver(object, ElementSamples(object.mesh, object.materials, basis), coordinates, reference, sample,
               static_cast<double>(all) / static_cast<double>(count), target.solver);
  return target;
}

}  // namespace exmat::precompute

#include "precompute/reference/full_space_examples.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/modes/field_clamp.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/shape_space/projection.h"

namespace exmat::precompute {
namespace {

// Directions of the poses this much weaker than the strongest, squared, are rounding.
constexpr double kRank = 1e-12;
// Relative difference of P and its transpose that is rounding.
constexpr double kSymmetric = 1e-12;

using Field = Eigen::Map<const VertexArray>;

LaplaceBasis laplace_basis_of(const ReducedModel& model) {
  const ShapeSpaceData& space = *model.shape_space;
  const TetMesh& mesh = model.object->mesh;
  return {space.eigenvalues,          space.eigenfunctions, scalar_mass(mesh) / space.volume,
          normalised_positions(mesh), space.volume,         space.centroid};
}

// Squared angular frequency of the highest linear mode, as the pipeline's clamp has it.
double clamp_decay(const ReducedModel& model) {
  const double angular = 2 * std::numbers::pi * model.modal->frequencies.tail(1)[0];
  return angular * angular;
}

Eigen::VectorXd flat(const RowMatrix& matrix) { return matrix.reshaped<Eigen::RowMajor>(); }

const ExampleSet& require_examples(const ReducedModel& model) {
  if (!model.examples || !model.shape_space || !model.modal)
    throw InputError({"", "/examples", "this group, /shape_space and /modal", "none",
                      "precompute the bundle again with a scene that has examples"});
  return *model.examples;
}

bool inverts(const RowMatrix& gradient, const Eigen::VectorXd& pose) {
  const Eigen::Matrix<double, 9, 1> H = gradient * pose;
  return (Eigen::Matrix3d::Identity() + Eigen::Map<const RowMatrix3>(H.data())).determinant() <= 0;
}

}  // namespace

Eigen::MatrixXd example_fields(const ReducedModel& model, const ElasticSystem& system) {
  require_examples(model);
  const LaplaceBasis object = laplace_basis_of(model);
  const FieldClamp clamp(system, clamp_decay(model), model.asset_name);
  const Eigen::VectorXd weights = descriptor_weights(object, model.shape_space->weighting);
  const PoseFields poses = whole_body_poses(object, weights, model.object->fixed, clamp);
  Eigen::MatrixXd fields = poses(Eigen::MatrixXd::Identity(3 * weights.size(), 3 * weights.size()));
  // The modal basis of a free body holds no rigid motions.
  fields -= system.null_space * (system.null_space.transpose() * (system.mass * fields)).eval();
  return fields;
}

FullSpaceExamples::FullSpaceExamples(const ReducedModel& model, const ElasticSystem& system,
                                     const Eigen::MatrixXd& fields, runtime::EnergyReference reference) {
  require_examples(model);
  set_filter(model, system);
  set_poses(model, system, fields);
  set_target(model, system, reference);
}

void FullSpaceExamples::set_filter(const ReducedModel& model, const ElasticSystem& system) {
  const LaplaceBasis object = laplace_basis_of(model);
  for (std::size_t i = 0; i < system.free_dofs.size(); i += 3) free_vertices_.push_back(system.free_dofs[i] / 3);
  const RowMatrix analysis = object.mass * object.eigenfunctions;
  const RowMatrix synthesis = scalar_mass(model.object->mesh, model.object->materials.density) * object.eigenfunctions;
  analysis_ = analysis(free_vertices_, Eigen::all);
  synthesis_ = synthesis(free_vertices_, Eigen::all);
  const double ratio = synthesis_.norm() / analysis_.norm();
  symmetric_ = (synthesis_ - ratio * analysis_).norm() <= kSymmetric * synthesis_.norm();

  const ExampleSet& set = *model.examples;
  const Eigen::VectorXd weights = descriptor_weights(object, model.shape_space->weighting) / std::cbrt(object.volume);
  RowMatrix slopes(std::ssize(set.examples), 3 * weights.size());
  for (std::size_t k = 0; k < set.examples.size(); ++k)
    slopes.row(static_cast<Eigen::Index>(k)) = flat(weights.asDiagonal() * set.examples[k].descriptor).transpose();
  weights_ = runtime::ExampleWeights(set.gram, set.h0, slopes);
}

void FullSpaceExamples::set_poses(const ReducedModel& model, const ElasticSystem& system,
                                  const Eigen::MatrixXd& fields) {
  const Eigen::MatrixXd mass_fields = system.mass * fields;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(fields.transpose() * mass_fields);
  const Eigen::VectorXd& values = gram.eigenvalues();
  const Eigen::Index rank = (values.array() > kRank * values.tail(1)[0]).count();
  const Eigen::VectorXd scales = values.tail(rank).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd directions = gram.eigenvectors().rightCols(rank) * scales.asDiagonal();
  pose_basis_ = fields * directions;
  for (const ExampleData& example : model.examples->examples) {
    const Eigen::VectorXd change = flat(example.descriptor - model.shape_space->rest_descriptor);
    poses_.push_back(directions.transpose() * (mass_fields.transpose() * (fields * change)));
  }
}

void FullSpaceExamples::set_target(const ReducedModel& model, const ElasticSystem& system,
                                   runtime::EnergyReference reference) {
  const ObjectData& object = *model.object;
  const RowMatrix basis = system.extend(pose_basis_);
  const ElementSamples samples(object.mesh, object.materials, basis);
  CubatureData all;
  std::vector<Eigen::Index> kept;
  all.gradient.resize(9 * samples.count(), basis.cols());
  for (Eigen::Index t = 0; t < samples.count(); ++t) {
    const RowMatrix gradient = samples.gradient(t);
    const bool inverted = reference == runtime::EnergyReference::kExample &&
                          std::ranges::any_of(poses_, [&](const auto& pose) { return inverts(gradient, pose); });
    if (inverted) continue;
    all.gradient.middleRows<9>(9 * std::ssize(kept)) = gradient;
    kept.push_back(t);
  }
  left_out_ = samples.count() - std::ssize(kept);
  all.gradient.conservativeResize(9 * std::ssize(kept), Eigen::NoChange);
  all.weights = Eigen::VectorXd::Ones(std::ssize(kept));
  all.volumes = tet_volumes(object.mesh)(kept);
  all.youngs_modulus = object.materials.youngs_modulus(kept);
  all.poisson_ratio = object.materials.poisson_ratio(kept);
  std::vector<ExampleData> examples = model.examples->examples;
  for (std::size_t k = 0; k < examples.size(); ++k) examples[k].pose = poses_[k];
  const auto complaint =
      target_.build(object.materials.model, all, examples, RowMatrix::Identity(basis.cols(), basis.cols()), reference);
  if (complaint) throw InputError(*complaint);
  target_fields_ = pose_basis_ * target_.basis();
}

Eigen::VectorXd FullSpaceExamples::weights(const Eigen::VectorXd& u) const {
  const RowMatrix coefficients = analysis_.transpose() * Field(u.data(), u.size() / 3, 3);
  runtime::ExampleWeights::Workspace workspace = weights_.make_workspace();
  Eigen::VectorXd weights(count());
  weights_.solve(flat(coefficients), workspace, weights);
  return weights;
}

Eigen::VectorXd FullSpaceExamples::filter(const Eigen::VectorXd& u) const {
  const Eigen::MatrixXd coefficients = analysis_.transpose() * Field(u.data(), u.size() / 3, 3);
  return flat(synthesis_ * coefficients);
}

Eigen::VectorXd FullSpaceExamples::transposed_filter(const Eigen::VectorXd& u) const {
  const Eigen::MatrixXd coefficients = synthesis_.transpose() * Field(u.data(), u.size() / 3, 3);
  return flat(analysis_ * coefficients);
}

}  // namespace exmat::precompute

#include "precompute/pipeline/example_stage.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <utility>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "precompute/pipeline/example_alignment.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/shape_space/projection.h"
#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {
namespace {

// Eigenfunctions computed beyond m, to see whether the cut splits a cluster.
constexpr Eigen::Index kExtraEigenfunctions = 4;
// A share of an example's displacement lost to truncation that is worth a warning.
constexpr double kTruncationWarning = 0.25;

// A displacement, over the object's size, that is none.
constexpr double kNoPose = 1e-6;

// Functions of the object looked through for how many would carry a pose.
constexpr Eigen::Index kMostFunctions = 100;

class ShapeStageBuilder {
 public:
  ShapeStageBuilder(const AssetConfig& asset, const ObjectInput& object, const ExampleInput& input,
                    std::vector<std::string>& warnings)
      : asset_(asset), object_(object), input_(input), warnings_(warnings) {}

  ShapeStage build();

 private:
  Eigen::VectorXd object_basis();
  void set_shape_data(const Eigen::VectorXd& eigenvalues);
  void add_examples();
  SparseMatrix fit_weights() const;
  void add_rest(const AlignedRest& rest);
  TransferredPose transfer(const AlignedRest& rest, const AlignedPose& pose, const PoseFrame& frame) const;
  void add_pose(const PoseInput& input, const AlignedPose& pose, const TransferredPose& transferred);
  ExampleData example_data(const AlignmentOutcome& outcome, double volume) const;

  const AssetConfig& asset_;
  const ObjectInput& object_;
  const ExampleInput& input_;
  std::vector<std::string>& warnings_;
  ShapeStage stage_;
};

// Leaves the first m functions in the stage and returns the eigenvalues of a few more.
Eigen::VectorXd ShapeStageBuilder::object_basis() {
  const Eigen::Index m = asset_.eigenfunctions;
  const Eigen::Index available = object_.mesh.vertex_count() - 2;
  if (m >= available)
    throw InputError({"", "/shape_space/eigenfunctions",
                      fmt::format("at most {} for a mesh of {} vertices", available - 1, object_.mesh.vertex_count()),
                      std::to_string(m), "ask for fewer or refine the mesh"});
  stage_.object = laplace_basis(object_.mesh, std::min(m + kExtraEigenfunctions, available), asset_.name);
  Eigen::VectorXd eigenvalues = stage_.object.eigenvalues;
  stage_.object.eigenvalues.conservativeResize(m);
  stage_.object.eigenfunctions.conservativeResize(Eigen::NoChange, m);
  return eigenvalues;
}

void ShapeStageBuilder::set_shape_data(const Eigen::VectorXd& eigenvalues) {
  const Eigen::Index m = asset_.eigenfunctions;
  const LaplaceBasis& object = stage_.object;
  stage_.weights = descriptor_weights(object, asset_.weighting);
  stage_.rest_coefficients = coefficients(object, object.vertices);
  stage_.data = {object.eigenvalues,
                 object.eigenfunctions,
                 stage_.weights.asDiagonal() * stage_.rest_coefficients,
                 object.volume,
                 object.centroid,
                 asset_.weighting,
                 splits_cluster(eigenvalues, m) ? 1 : 0};
  if (stage_.data.splits_cluster != 0)
    warn(warnings_,
         fmt::format("shape_space.eigenfunctions: {} splits a cluster of nearly equal eigenvalues ({:.4g} and {:.4g}); "
                     "{} would not",
                     m, eigenvalues[m - 1], eigenvalues[m], next_uncut(eigenvalues, m)));
}

SparseMatrix ShapeStageBuilder::fit_weights() const {
  if (!object_.fixed.any()) return scalar_mass(object_.mesh, object_.materials.density);
  return SparseMatrix(Eigen::VectorXd(object_.fixed.cast<double>()).asDiagonal());
}

ExampleData ShapeStageBuilder::example_data(const AlignmentOutcome& outcome, double volume) const {
  ExampleData example;
  example.name = outcome.name;
  example.index = std::ssize(stage_.examples.examples);
  example.scale = std::cbrt(stage_.object.volume / volume);
  example.method = outcome.method;
  example.alignment_residual = outcome.residual;
  example.confidence = outcome.confidence;
  example.inverted_fraction = outcome.inverted_fraction;
  example.competing_maps = outcome.competing_maps;
  return example;
}

void ShapeStageBuilder::add_rest(const AlignedRest& rest) {
  ExampleData example = example_data(rest.outcome, rest.basis.volume);
  example.is_rest = true;
  example.rotation = rest.rotation;
  example.descriptor = stage_.data.rest_descriptor;
  stage_.examples.examples.push_back(std::move(example));
  stage_.alignments.push_back(rest.outcome);
}

TransferredPose ShapeStageBuilder::transfer(const AlignedRest& rest, const AlignedPose& pose,
                                            const PoseFrame& frame) const {
  if (pose.carried)
    return transfer_carried(stage_.object, stage_.rest_coefficients, rest.carried, *pose.carried, frame);
  return transfer_pose(stage_.object, stage_.rest_coefficients, rest.map, rest.basis, pose.positions, frame);
}

void ShapeStageBuilder::add_pose(const PoseInput& input, const AlignedPose& pose, const TransferredPose& transferred) {
  ExampleData example = example_data(pose.outcome, tet_volumes(input.mesh).sum());
  example.rotation = transferred.rotation;
  example.shape_space_error = transferred.shape_space_error;
  example.descriptor = stage_.weights.asDiagonal() * transferred.coefficients;
  const Eigen::Index column = example.index - 1;
  stage_.fields.col(column) = std::cbrt(stage_.object.volume) * transferred.displacement.reshaped<Eigen::RowMajor>();
  if (transferred.displacement.norm() <= kNoPose * stage_.object.vertices.norm())
    throw InputError({"", "/examples, " + input.name, "a pose that differs from the rest pose", "the rest pose",
                      "leave it out: the rest pose is always an example"});
  stage_.displacements.col(column) =
      reconstruct_displacement(stage_.object, stage_.weights, example.descriptor - stage_.data.rest_descriptor);
  hold_fixed_mean(object_.fixed, stage_.displacements.col(column));
  stage_.examples.examples.push_back(std::move(example));
  stage_.alignments.push_back(pose.outcome);
  stage_.alignments.back().shape_space_error = transferred.shape_space_error;
}

void ShapeStageBuilder::add_examples() {
  ExampleAligner aligner(asset_, stage_.object, object_, input_);
  const AlignedRest rest = aligner.align_rest();
  add_rest(rest);
  const PoseFrame frame{rest.free_poses, fit_weights(), object_.fixed.any()};
  stage_.fields.resize(3 * object_.mesh.vertex_count(), std::ssize(input_.poses));
  stage_.displacements.resizeLike(stage_.fields);
  for (const PoseInput& input : input_.poses) {
    const AlignedPose pose = aligner.align_pose(rest, input);
    add_pose(input, pose, transfer(rest, pose, frame));
  }
}

// The least number of the object's functions, no cluster cut, that loses at most the share worth a warning of a
// displacement [3n]; 0 where kMostFunctions do not do.
class FunctionCounter {
 public:
  FunctionCounter(const TetMesh& mesh, const std::string& name) : mesh_(mesh), name_(name) {}

  Eigen::Index needed(const Eigen::VectorXd& field) {
    if (!basis_) basis_ = laplace_basis(mesh_, std::min(kMostFunctions, mesh_.vertex_count() - 2), name_);
    const VertexArray displacement = field.reshaped<Eigen::RowMajor>(field.size() / 3, 3);
    const double whole = (displacement.transpose() * (basis_->mass * displacement)).trace();
    const Eigen::VectorXd shares = coefficients(*basis_, displacement).rowwise().squaredNorm() / whole;
    double carried = 0;
    for (Eigen::Index count = 1; count < shares.size(); ++count) {
      carried += shares[count - 1];
      if (1 - carried <= kTruncationWarning * kTruncationWarning && !splits_cluster(basis_->eigenvalues, count))
        return count;
    }
    return 0;
  }

 private:
  const TetMesh& mesh_;
  const std::string& name_;
  std::optional<LaplaceBasis> basis_;
};

// `needed` functions of the object would carry the pose; 0 where the mesh has too few.
std::string advice_on_loss(const ExampleData& example, Eigen::Index functions, Eigen::Index needed) {
  if (needed > functions)
    return fmt::format("shape_space.eigenfunctions: {} would lose less than {:.0f} %", needed,
                       100 * kTruncationWarning);
  if (needed > 0 && example.method == "coupled")
    return "coupled bases do, not the functions: give more landmarks or regions, or take alignment.method \"auto\"";
  return "more than the mesh resolves would be needed";
}

ShapeStage ShapeStageBuilder::build() {
  set_shape_data(object_basis());
  add_examples();
  return std::move(stage_);
}

}  // namespace

ShapeStage build_shape_stage(const AssetConfig& asset, const ObjectInput& object, const ExampleInput& input,
                             std::vector<std::string>& warnings) {
  return ShapeStageBuilder(asset, object, input, warnings).build();
}

void finish_examples(const AssetConfig& asset, const ElasticSystem& system, const FieldClamp& clamp, ShapeStage& stage,
                     ReducedModel& model, std::vector<std::string>& warnings) {
  model.projection = direct_projection(stage.object, stage.weights, system.full_mass, model.modal->basis);
  const RowMatrix map = pose_map(stage.object, stage.weights, model.object->fixed, system, clamp, model.modal->basis,
                                 model.projection->reduced_from_shape);
  model.projection->target_basis = range_basis(map);
  fill_weights_problem(stage.data.rest_descriptor, *model.projection, map, stage.examples);
  FunctionCounter counter(model.object->mesh, asset.name);
  for (Eigen::Index k = 0; k < stage.displacements.cols(); ++k) {
    auto& example = stage.examples.examples[static_cast<std::size_t>(k + 1)];
    const Eigen::VectorXd field = stage.displacements.col(k);
    const Eigen::VectorXd rest = field - model.modal->basis * example.pose;
    const double norm = field.dot(system.full_mass * field);
    example.basis_error = norm > 0 ? std::sqrt(std::max(0.0, rest.dot(system.full_mass * rest) / norm)) : 0;
    log::info(fmt::format(
        "example {}: the {} eigenfunctions lose {:.1f} % of its displacement, the basis {:.1f} % of the rest",
        example.name, asset.eigenfunctions, 100 * example.shape_space_error, 100 * example.basis_error));
    if (example.shape_space_error <= kTruncationWarning) continue;
    warn(warnings, fmt::format("example {}: {} eigenfunctions lose {:.0f} % of its displacement; {}", example.name,
                               asset.eigenfunctions, 100 * example.shape_space_error,
                               advice_on_loss(example, asset.eigenfunctions, counter.needed(stage.fields.col(k)))));
  }
  model.shape_space = std::move(stage.data);
  model.examples = std::move(stage.examples);
}

}  // namespace exmat::precompute

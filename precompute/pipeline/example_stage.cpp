#include "precompute/pipeline/example_stage.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/shape_space/projection.h"
#include "precompute/shape_space/transfer.h"
#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {
namespace {

// Eigenfunctions computed beyond m, to see whether the cut splits a cluster.
constexpr Eigen::Index kExtraEigenfunctions = 4;
constexpr double kConfidenceWarning = 0.5, kConfidenceRefusal = 1.2;
// A share of an example's displacement lost to truncation that is worth a warning.
constexpr double kTruncationWarning = 0.25;

void warn(std::vector<std::string>& warnings, const std::string& message) {
  warnings.push_back(message);
  log::warning(message);
}

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
  RestMap map_rest(const LaplaceBasis& rest_basis);
  bool free_example(const RestMap& map) const;
  SparseMatrix fit_weights() const;
  void add_rest(const RestMap& map, const LaplaceBasis& rest_basis);
  void add_pose(const PoseInput& pose, const TransferredPose& transferred, const RestMap& map, double scale);

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

RestMap ShapeStageBuilder::map_rest(const LaplaceBasis& rest_basis) {
  const LaplaceBasis& object = stage_.object;
  if (input_.object_is_rest) return identity_map(object.eigenvalues.size(), object.vertices.rows());
  const RestMap map = rest_map(object, input_.rest, rest_basis);
  log::info(fmt::format("rest example {}: {:.1f} % from the object, confidence {:.3f} (0 is certain)", input_.rest_name,
                        100 * map.residual, map.confidence));
  const std::string advice = "expected a rest example that lies where the object does and has about its shape";
  if (map.confidence > kConfidenceRefusal)
    throw WorkError(fmt::format("example {}: alignment refused, confidence {:.2f} (limit {}): {}", input_.rest_name,
                                map.confidence, kConfidenceRefusal, advice));
  if (map.confidence > kConfidenceWarning)
    warn(warnings_, fmt::format("example {}: doubtful alignment, confidence {:.2f}: {}", input_.rest_name,
                                map.confidence, advice));
  return map;
}

bool ShapeStageBuilder::free_example(const RestMap& map) const {
  if (asset_.frame != "auto") return asset_.frame == "free";
  log::info(map.same_frame ? "examples share the object's frame: the rest example coincides with it"
                           : "examples are rotated to the object's frame: the rest example does not coincide with it");
  return !map.same_frame;
}

SparseMatrix ShapeStageBuilder::fit_weights() const {
  if (!object_.fixed.any()) return scalar_mass(object_.mesh, object_.materials.density);
  return SparseMatrix(Eigen::VectorXd(object_.fixed.cast<double>()).asDiagonal());
}

void ShapeStageBuilder::add_rest(const RestMap& map, const LaplaceBasis& rest_basis) {
  ExampleData rest;
  rest.name = input_.rest_name;
  rest.is_rest = true;
  rest.method = input_.object_is_rest ? "object" : "rest_map";
  rest.scale = std::cbrt(stage_.object.volume / rest_basis.volume);
  rest.alignment_residual = map.residual;
  rest.confidence = map.confidence;
  rest.descriptor = stage_.data.rest_descriptor;
  stage_.examples.examples.push_back(std::move(rest));
}

void ShapeStageBuilder::add_pose(const PoseInput& pose, const TransferredPose& transferred, const RestMap& map,
                                 double scale) {
  ExampleData example;
  example.name = pose.name;
  example.index = std::ssize(stage_.examples.examples);
  example.rotation = transferred.rotation;
  example.scale = scale;
  example.method = "same_connectivity";
  example.alignment_residual = map.residual;
  example.confidence = map.confidence;
  example.shape_space_error = transferred.shape_space_error;
  example.descriptor = stage_.weights.asDiagonal() * transferred.coefficients;
  const Eigen::Index column = example.index - 1;
  stage_.fields.col(column) = std::cbrt(stage_.object.volume) * transferred.displacement.reshaped<Eigen::RowMajor>();
  stage_.displacements.col(column) =
      reconstruct_displacement(stage_.object, stage_.weights, example.descriptor - stage_.data.rest_descriptor);
  hold_fixed_mean(object_.fixed, stage_.displacements.col(column));
  stage_.examples.examples.push_back(std::move(example));
}

void ShapeStageBuilder::add_examples() {
  const LaplaceBasis rest_basis =
      input_.object_is_rest
          ? stage_.object
          : laplace_basis(input_.rest, example_function_count(asset_.eigenfunctions, input_.rest.vertex_count()),
                          input_.rest_name);
  const RestMap map = map_rest(rest_basis);
  add_rest(map, rest_basis);
  const PoseFrame frame{free_example(map), fit_weights()};
  stage_.fields.resize(3 * object_.mesh.vertex_count(), std::ssize(input_.poses));
  stage_.displacements.resizeLike(stage_.fields);
  for (const PoseInput& pose : input_.poses) {
    const TetMesh posed{pose.vertices, input_.rest.tets};
    const auto transferred =
        transfer_pose(stage_.object, stage_.rest_coefficients, map, rest_basis, normalised_positions(posed), frame);
    add_pose(pose, transferred, map, std::cbrt(stage_.object.volume / tet_volumes(posed).sum()));
  }
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

void finish_examples(const AssetConfig& asset, const ElasticSystem& system, const SemidefiniteSolver& solver,
                     ShapeStage& stage, ReducedModel& model, std::vector<std::string>& warnings) {
  model.projection = direct_projection(stage.object, stage.weights, system.full_mass, model.modal->basis);
  const RowMatrix map = pose_map(stage.object, stage.weights, model.object->fixed, system, solver, model.modal->basis,
                                 model.projection->reduced_from_shape);
  model.projection->target_basis = range_basis(map);
  fill_weights_problem(stage.data.rest_descriptor, *model.projection, map, stage.examples);
  for (Eigen::Index k = 0; k < stage.displacements.cols(); ++k) {
    auto& example = stage.examples.examples[static_cast<std::size_t>(k + 1)];
    const Eigen::VectorXd field = stage.displacements.col(k);
    const Eigen::VectorXd rest = field - model.modal->basis * example.pose;
    const double norm = field.dot(system.full_mass * field);
    example.basis_error = norm > 0 ? std::sqrt(std::max(0.0, rest.dot(system.full_mass * rest) / norm)) : 0;
    log::info(fmt::format(
        "example {}: the {} eigenfunctions lose {:.1f} % of its displacement, the basis {:.1f} % of the rest",
        example.name, asset.eigenfunctions, 100 * example.shape_space_error, 100 * example.basis_error));
    if (example.shape_space_error > kTruncationWarning)
      warn(warnings, fmt::format("example {}: {} eigenfunctions lose {:.0f} % of its displacement; more "
                                 "shape_space.eigenfunctions (20 is usual) keep more",
                                 example.name, asset.eigenfunctions, 100 * example.shape_space_error));
  }
  model.shape_space = std::move(stage.data);
  model.examples = std::move(stage.examples);
}

}  // namespace exmat::precompute

#include "precompute/examples/example_stage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "precompute/examples/example_alignment.h"
#include "precompute/examples/function_counter.h"
#include "precompute/modes/field_clamp.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/shape_space/projection.h"
#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {
namespace {

// Eigenfunctions computed beyond m, to see whether the cut splits a cluster.
constexpr Eigen::Index kExtraEigenfunctions = 4;
// A displacement, over the object's size, that is none: numbers written with few digits have as much. Two
// tessellations of one body have more.
constexpr double kNoPose = 1e-4, kNoRegisteredPose = 0.01;
// A pose that moves fixed vertices by more, over the object's size, deserves a warning.
constexpr double kMovedClamp = 0.005;
// A turn that is worth words [rad].
constexpr double kTurned = 0.02;

// Value of ExampleData::source.
std::string source_of(const AssetConfig& asset, const std::string& name) {
  const auto example = std::ranges::find(asset.examples, name, &ExampleConfig::name);
  if (example == asset.examples.end()) return "";
  return example->morph ? *example->morph : example->file({}).filename().string();
}

// "the rest pose", and how it is turned.
std::string rest_pose_text(const RowMatrix3& to_object) {
  const Eigen::Matrix3d rotation = to_object;
  if (Eigen::AngleAxisd(rotation).angle() < kTurned) return "the rest pose";
  return "the rest pose, " + describe_turn(rotation);
}

class ShapeStageBuilder {
 public:
  ShapeStageBuilder(const AssetConfig& asset, const ObjectInput& object, const ExampleInput& input, StageCache& cache,
                    std::vector<std::string>& warnings)
      : asset_(asset), object_(object), input_(input), cache_(cache), warnings_(warnings) {}

  ShapeStage build();

 private:
  Eigen::VectorXd object_basis();
  void set_shape_data(const Eigen::VectorXd& eigenvalues);
  void add_examples();
  SparseMatrix fit_weights() const;
  void add_rest(const AlignedRest& rest, ExampleGroup& group) const;
  TransferredPose transfer(const AlignedRest& rest, const AlignedPose& pose, const PoseFrame& frame) const;
  void split_by_clamp(const AlignedRest& rest, const std::vector<AlignedPose>& poses);
  TransferredPose whole_pose(const AlignedRest& rest, const AlignedPose& pose, const PoseFrame& frame,
                             std::size_t p) const;
  void add_pose(const PoseInput& input, const AlignedPose& pose, const TransferredPose& transferred,
                ExampleGroup& group) const;
  ExampleData example_data(const AlignmentOutcome& outcome, double scale, const ExampleGroup& group) const;
  void warn_of_clamp(const std::string& name, const VertexArray& displacement);
  void report(const std::string& name, const AlignedPose& pose, const TransferredPose& transferred);
  void add_groups(const AlignedRest& rest);
  void add_poses(const AlignedRest& rest, const std::vector<AlignedPose>& poses);
  Eigen::Index functions_needed(const std::vector<AlignedPose>& poses) const;
  PoseFrame region_frame(const AlignedRest& rest, const RegionView& view) const;
  Eigen::VectorXd share_of_region(const AlignedRest& rest, const RegionInput& input) const;
  void cut(const RegionView& view, const Eigen::VectorXd& share, TransferredPose& pose) const;
  VertexArray carried_displacement(const TransferredPose& pose) const;

  const AssetConfig& asset_;
  const ObjectInput& object_;
  const ExampleInput& input_;
  StageCache& cache_;
  std::vector<std::string>& warnings_;
  Eigen::Index functions_ = asset_.eigenfunctions;  // m
  Eigen::MatrixXd own_, shifts_;                    // 3n x poses of split_by_clamp() [m]; empty: no clamp follows
  std::vector<TransferredPose> wholes_;             // the poses by these, whatever they act on
  double rest_scale_ = 1;                           // from the rest example's unit of length to the object's
  ShapeStage stage_;
};

// Leaves the first m functions in the stage and returns the eigenvalues of a few more.
Eigen::VectorXd ShapeStageBuilder::object_basis() {
  const Eigen::Index m = functions_;
  const Eigen::Index available = object_.mesh.vertex_count() - 2;
  if (m >= available)
    throw InputError({"", "/shape_space/eigenfunctions",
                      fmt::format("at most {} for a mesh of {} vertices", available - 1, object_.mesh.vertex_count()),
                      std::to_string(m), "ask for fewer or refine the mesh"});
  const Eigen::Index count = std::min(m + kExtraEigenfunctions, available);
  stage_.object = cache_.get(
      "eigenfunctions", [&] { return laplace_basis(object_.mesh, count, asset_.name); }, object_.mesh, count);
  Eigen::VectorXd eigenvalues = stage_.object.eigenvalues;
  stage_.object.eigenvalues.conservativeResize(m);
  stage_.object.eigenfunctions.conservativeResize(Eigen::NoChange, m);
  return eigenvalues;
}

void ShapeStageBuilder::set_shape_data(const Eigen::VectorXd& eigenvalues) {
  const Eigen::Index m = functions_;
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

ExampleData ShapeStageBuilder::example_data(const AlignmentOutcome& outcome, double scale,
                                            const ExampleGroup& group) const {
  ExampleData example;
  example.name = outcome.name;
  example.index = std::ssize(group.examples.examples);
  example.scale = scale;
  example.source = source_of(asset_, outcome.name);
  example.method = outcome.method;
  example.alignment_residual = outcome.residual;
  example.doubt = outcome.doubt;
  example.inverted_fraction = outcome.inverted_fraction;
  example.competing_maps = outcome.competing_maps;
  return example;
}

void ShapeStageBuilder::add_rest(const AlignedRest& rest, ExampleGroup& group) const {
  ExampleData example = example_data(rest.outcome, rest_scale_, group);
  example.is_rest = true;
  example.rotation = rest.rotation;
  example.descriptor = stage_.data.rest_descriptor;
  group.examples.examples.push_back(std::move(example));
}

TransferredPose ShapeStageBuilder::transfer(const AlignedRest& rest, const AlignedPose& pose,
                                            const PoseFrame& frame) const {
  TransferredPose transferred =
      pose.carried
          ? transfer_carried(stage_.object, stage_.rest_coefficients, rest.carried, *pose.carried, frame)
          : transfer_pose(stage_.object, stage_.rest_coefficients, rest.map, rest.basis, pose.positions, frame);
  transferred.rotation = transferred.rotation * rest.rotation;
  return transferred;
}

// Splits each pose, where it stands, into what it does beside its clamp and the elastic displacement by what it does
// there.
void ShapeStageBuilder::split_by_clamp(const AlignedRest& rest, const std::vector<AlignedPose>& poses) {
  Eigen::MatrixXd fields(object_.mesh.vertices.size(), std::ssize(poses));
  for (std::size_t p = 0; p < poses.size(); ++p) {
    const PoseInput& input = input_.poses[p];
    if (!input.same_connectivity || rest.free_poses)
      throw InputError({"", "/object/fixed/follow", "poses of the rest example's own mesh, which stand where it does",
                        fmt::format("example {}, {}", input.name,
                                    input.same_connectivity ? "which is rotated to it" : "a mesh of its own"),
                        "leave follow out, or pose the rest example's mesh where the object is"});
    const VertexArray moved =
        rest_scale_ * (input.mesh.vertices - input_.rest.mesh.vertices) * rest.rotation.transpose();
    fields.col(static_cast<Eigen::Index>(p)) = VertexArray(rest.map.pull_back * moved).reshaped<Eigen::RowMajor>();
  }
  const ElasticSystem system = build_elastic_system(object_.mesh, object_.materials, object_.fixed);
  own_ = system.extend(FieldClamp(system, 0, asset_.name).apply(fields));
  shifts_ = fields - own_;
}

// `p` is its number.
TransferredPose ShapeStageBuilder::whole_pose(const AlignedRest& rest, const AlignedPose& aligned,
                                              const PoseFrame& frame, std::size_t p) const {
  if (own_.size() == 0) return transfer(rest, aligned, frame);
  const Eigen::VectorXd own = own_.col(static_cast<Eigen::Index>(p)) / std::cbrt(stage_.object.volume);
  TransferredPose pose = posed_object(stage_.object, stage_.rest_coefficients,
                                      own.reshaped<Eigen::RowMajor>(object_.mesh.vertex_count(), 3));
  pose.rotation = rest.rotation;
  return pose;
}

// Logs notes on its scale, and warns where it is hardly a pose.
void ShapeStageBuilder::report(const std::string& name, const AlignedPose& pose, const TransferredPose& transferred) {
  if (!pose.scale.note.empty()) log::info(fmt::format("example {}: {}", name, pose.scale.note));
  if (!pose.scale.warning.empty()) warn(warnings_, fmt::format("example {}: {}", name, pose.scale.warning));
  warn_of_clamp(name, transferred.displacement);
  const double share = transferred.displacement.norm() / stage_.object.vertices.norm();
  if (pose.outcome.method == "same_connectivity" || share > kNoRegisteredPose) return;
  warn(warnings_,
       fmt::format("example {}: it differs by {:.2g} % of the body's size from {}, no more than two meshes of "
                   "one body do; leave it out, or pose the rest example's own mesh",
                   name, 100 * share, rest_pose_text(transferred.rotation)));
}

// `displacement` is that of the normalised object.
void ShapeStageBuilder::warn_of_clamp(const std::string& name, const VertexArray& displacement) {
  if (!object_.fixed.any() || asset_.clamp_follows) return;
  Eigen::MatrixXd field = displacement.reshaped<Eigen::RowMajor>();
  hold_fixed_mean(object_.fixed, field);
  const Eigen::VectorXd distances = field.reshaped<Eigen::RowMajor>(displacement.rows(), 3).rowwise().norm();
  const Eigen::VectorXd moved = object_.fixed.cast<double>().cwiseProduct(distances);
  Eigen::Index vertex = 0;
  const double farthest = std::cbrt(stage_.object.volume) * moved.maxCoeff(&vertex);
  const double size = bounding_box_diagonal(object_.mesh.vertices);
  if (farthest <= kMovedClamp * size) return;
  warn(warnings_,
       fmt::format("example {}: the pose moves fixed vertices by up to {:.3g} m ({:.1f} % of the body's size, "
                   "vertex {}), where the body cannot follow; leave them at rest in the pose, or out of "
                   "object.fixed, or have it follow (object.fixed.follow)",
                   name, farthest, 100 * farthest / size, vertex));
}

void ShapeStageBuilder::add_pose(const PoseInput& input, const AlignedPose& pose, const TransferredPose& transferred,
                                 ExampleGroup& group) const {
  ExampleData example = example_data(pose.outcome, rest_scale_ / pose.scale.unit, group);
  example.rotation = transferred.rotation;
  example.shape_space_error = transferred.shape_space_error;
  example.descriptor = stage_.weights.asDiagonal() * transferred.coefficients;
  if (input.surface) {
    example.surface_rms = input.surface->rms;
    example.surface_farthest = input.surface->farthest;
    example.surface_iterations = input.surface->iterations;
  }
  if (transferred.displacement.norm() <= kNoPose * stage_.object.vertices.norm())
    throw InputError(
        {"", "/examples, " + example.name,
         group.region.empty() ? "a pose that differs from the rest pose"
                              : fmt::format("a pose that differs from the rest pose in the region {}", group.region),
         asset_.clamp_follows ? "one that does no more than its fixed vertices make of it"
                              : rest_pose_text(transferred.rotation),
         asset_.clamp_follows ? "have it deform the body beside them; a scene's bones move the joint \"clamp\" alone"
                              : "leave it out: the rest pose is always an example"});
  group.fields.conservativeResize(3 * object_.mesh.vertex_count(), group.fields.cols() + 1);
  group.fields.rightCols(1) = std::cbrt(stage_.object.volume) * transferred.displacement.reshaped<Eigen::RowMajor>();
  group.examples.examples.push_back(std::move(example));
}

// 0 to 1 at each vertex of the object: how much of what a pose does there the region's example takes over.
Eigen::VectorXd ShapeStageBuilder::share_of_region(const AlignedRest& rest, const RegionInput& input) const {
  if (input.inside_example.size() == 0) return Eigen::VectorXd::Ones(input.inside.size());
  return rest.map.pull_back * input.inside_example.cast<double>();
}

// A pose is placed by the vertices that its region is seen from.
PoseFrame ShapeStageBuilder::region_frame(const AlignedRest& rest, const RegionView& view) const {
  if (view.frame().isZero(0)) return {rest.free_poses, fit_weights(), true};
  return {rest.free_poses, SparseMatrix(view.frame().asDiagonal()), true};
}

// Leaves what the view sees of a pose that region_frame() placed, as it will see the body.
void ShapeStageBuilder::cut(const RegionView& view, const Eigen::VectorXd& share, TransferredPose& pose) const {
  const double weight = view.frame().sum();
  if (weight > 0) pose.displacement.rowwise() -= view.frame().transpose() * pose.displacement / weight;
  const Eigen::VectorXd moved = pose.displacement.reshaped<Eigen::RowMajor>();
  const VertexArray seen = view.see(moved).reshaped<Eigen::RowMajor>(share.size(), 3);
  pose.displacement = share.asDiagonal() * seen;
  const Eigen::MatrixXd change = coefficients(stage_.object, pose.displacement);
  pose.coefficients = stage_.rest_coefficients + change;
  pose.shape_space_error = lost_share(stage_.object.mass, pose.displacement, stage_.object.eigenfunctions * change);
}

void ShapeStageBuilder::add_groups(const AlignedRest& rest) {
  if (input_.whole_body) stage_.groups.push_back({""});
  for (const RegionInput& input : input_.regions)
    stage_.groups.push_back({input.name, RegionView(object_.mesh, input.inside, object_.fixed)});
  for (ExampleGroup& group : stage_.groups) add_rest(rest, group);
}

void ShapeStageBuilder::add_examples() {
  ExampleAligner aligner(asset_, stage_.object, object_, input_, cache_);
  const AlignedRest rest = aligner.align_rest();
  rest_scale_ = std::cbrt(stage_.object.volume / rest.basis.volume);
  const std::string remark = remark_on_rest_scale(rest.basis.volume, stage_.object.volume);
  if (!remark.empty()) warn(warnings_, fmt::format("rest example {}: {}", rest.outcome.name, remark));
  std::vector<AlignedPose> poses;
  for (const PoseInput& input : input_.poses) poses.push_back(aligner.align_pose(rest, input));
  if (asset_.clamp_follows) split_by_clamp(rest, poses);
  add_poses(rest, poses);
  if (const Eigen::Index needed = functions_needed(poses); needed > functions_) {
    functions_ = needed;
    set_shape_data(object_basis());
    add_poses(rest, poses);
  }
  for (std::size_t i = 0; i < poses.size(); ++i) report(input_.poses[i].name, poses[i], wholes_[i]);
}

// The groups of the stage, by its m functions.
void ShapeStageBuilder::add_poses(const AlignedRest& rest, const std::vector<AlignedPose>& poses) {
  stage_.groups.clear();
  stage_.poses.clear();
  stage_.alignments.assign(1, rest.outcome);
  add_groups(rest);
  if (input_.whole_body) stage_.groups.front().shifts = shifts_;
  const PoseFrame frame{rest.free_poses, fit_weights(), object_.fixed.any()};
  wholes_.clear();
  for (std::size_t p = 0; p < poses.size(); ++p) {
    const PoseInput& input = input_.poses[p];
    const AlignedPose& pose = poses[p];
    const TransferredPose& whole = wholes_.emplace_back(whole_pose(rest, pose, frame, p));
    stage_.poses.push_back({whole.rotation, rest_scale_ / pose.scale.unit, carried_displacement(whole)});
    if (shifts_.size() > 0)
      stage_.poses.back().displacement +=
          shifts_.col(static_cast<Eigen::Index>(p)).reshaped<Eigen::RowMajor>(object_.mesh.vertex_count(), 3);
    stage_.alignments.push_back(pose.outcome);
    stage_.alignments.back().shape_space_error = whole.shape_space_error;
    if (input_.whole_body && input.in_whole_body) add_pose(input, pose, whole, stage_.groups.front());
    for (std::size_t i = 0; i < input_.regions.size(); ++i) {
      const RegionInput& region = input_.regions[i];
      if (std::ranges::find(region.examples, input.name) == region.examples.end()) continue;
      ExampleGroup& group = stage_.groups[i + (input_.whole_body ? 1 : 0)];
      TransferredPose local = transfer(rest, pose, region_frame(rest, *group.view));
      cut(*group.view, share_of_region(rest, region), local);
      add_pose(input, pose, local, group);
    }
  }
}

// Counts the functions that lose no more of any pose than the asset tolerates. Where coupled bases carry a pose, the
// number stays: the pose is known by the functions that were coupled.
Eigen::Index ShapeStageBuilder::functions_needed(const std::vector<AlignedPose>& poses) const {
  const auto is_carried = [](const AlignedPose& pose) { return pose.carried.has_value(); };
  if (!asset_.pose_tolerance || std::ranges::any_of(poses, is_carried)) return functions_;
  FunctionCounter counter(object_.mesh, asset_.name);
  const Eigen::Index most = std::min(kMostEigenfunctions, object_.mesh.vertex_count() - 2 - kExtraEigenfunctions);
  Eigen::Index needed = functions_;
  for (const ExampleGroup& group : stage_.groups)
    for (const auto& field : group.fields.colwise()) {
      const Eigen::Index count = counter.needed(field, *asset_.pose_tolerance);
      needed = std::max(needed, count > 0 ? std::min(count, most) : most);
    }
  log::info(fmt::format("eigenfunctions: {}, so that each loses at most {:.1f} % of a pose, where {} do", needed,
                        100 * *asset_.pose_tolerance, most));
  return needed;
}

VertexArray ShapeStageBuilder::carried_displacement(const TransferredPose& pose) const {
  const RowMatrix change = stage_.weights.asDiagonal() * (pose.coefficients - stage_.rest_coefficients);
  const Eigen::MatrixXd field =
      carried_fields(stage_.object, stage_.weights, object_.fixed, change.reshaped<Eigen::RowMajor>());
  return field.reshaped<Eigen::RowMajor>(object_.mesh.vertex_count(), 3);
}

ShapeStage ShapeStageBuilder::build() {
  set_shape_data(object_basis());
  add_examples();
  for (ExampleGroup& group : stage_.groups) fill_gram(stage_.data.rest_descriptor, group.examples);
  return std::move(stage_);
}

}  // namespace

ShapeStage build_shape_stage(const AssetConfig& asset, const ObjectInput& object, const ExampleInput& input,
                             StageCache& cache, std::vector<std::string>& warnings) {
  return ShapeStageBuilder(asset, object, input, cache, warnings).build();
}

}  // namespace exmat::precompute

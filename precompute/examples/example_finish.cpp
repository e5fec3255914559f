#include "precompute/examples/example_finish.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "common/model/example_pull.h"
#include "precompute/examples/function_counter.h"
#include "precompute/shape_space/filter_functions.h"
#include "precompute/shape_space/projection.h"
#include "precompute/shape_space/region_poses.h"
#include "precompute/shape_space/region_window.h"

namespace exmat::precompute {
namespace {

// A share of an example's displacement lost to truncation that is worth a warning.
constexpr double kTruncationWarning = 0.25;

// [3m x (K-1)] changes of descriptor from the rest pose to the others.
Eigen::MatrixXd changes_from_rest(const ExampleSet& set) {
  return descriptor_changes(set.examples.front().descriptor, set).rightCols(std::ssize(set.examples) - 1);
}

// `needed` functions of the object would carry the pose; 0 where too many would be needed.
std::string advice_on_loss(const ExampleData& example, Eigen::Index functions, Eigen::Index needed) {
  if (needed > functions)
    return fmt::format("shape_space.eigenfunctions: {} would lose less than {:.0f} %", needed,
                       100 * kTruncationWarning);
  if (needed > 0 && example.method == "coupled")
    return "coupled bases do, not the functions: give more landmarks or regions, or take alignment.method \"auto\"";
  return fmt::format("the first {} do not carry it", kMostEigenfunctions);
}

void log_group(const ExampleGroup& group, FunctionCounter& counter, const ExampleSet& set,
               std::vector<std::string>& warnings) {
  const std::string where = group.region.empty() ? "" : fmt::format(" in region {}", group.region);
  for (Eigen::Index k = 0; k < group.fields.cols(); ++k) {
    const ExampleData& example = set.examples[static_cast<std::size_t>(k + 1)];
    log::info(fmt::format(
        "example {}{}: the {} eigenfunctions lose {:.1f} % of its displacement, the basis {:.1f} % of the rest",
        example.name, where, example.descriptor.rows(), 100 * example.shape_space_error, 100 * example.basis_error));
    if (example.shape_space_error <= kTruncationWarning) continue;
    warn(warnings, fmt::format("example {}{}: {} eigenfunctions lose {:.0f} % of its displacement; {}", example.name,
                               where, example.descriptor.rows(), 100 * example.shape_space_error,
                               advice_on_loss(example, example.descriptor.rows(),
                                              counter.needed(group.fields.col(k), kTruncationWarning))));
  }
}

IndexVector flagged(const FlagVector& flags) {
  std::vector<std::int32_t> vertices;
  for (Eigen::Index v = 0; v < flags.size(); ++v)
    if (flags[v] != 0) vertices.push_back(static_cast<std::int32_t>(v));
  return Eigen::Map<const IndexVector>(vertices.data(), std::ssize(vertices));
}

// Without projection and targets.
RegionData region_of(const ExampleGroup& group, std::int64_t index) {
  RegionData region;
  region.name = group.region;
  region.index = index;
  region.vertices = flagged(group.view->inside());
  region.window = group.view->window()(region.vertices);
  region.band = group.view->band()(region.vertices);
  region.examples = group.examples;
  return region;
}

}  // namespace

PoseFitter::PoseFitter(const AssetConfig& asset, const ObjectInput& object, const ElasticSystem& system,
                       std::unique_ptr<SemidefiniteSolver> solver, double highest, const ShapeStage& stage)
    : asset_(asset), object_(object), system_(system), stage_(stage), poses_(stage.groups.size()) {
  const Eigen::Index changes = 3 * stage.weights.size();
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    if (stage.groups[i].region.empty()) continue;
    const RegionPoses poses(stage.object, stage.weights, *stage.groups[i].view, system, *solver,
                            kRegionStiffness * highest);
    poses_[i] = poses.displacements(Eigen::MatrixXd::Identity(changes, changes));
  }
  solver.reset();  // factors are the most of the memory: the clamp has its own
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const ExampleGroup& group = stage.groups[i];
    held_.emplace_back();
    if (group.region.empty()) {
      const FieldClamp clamp(system, highest, asset.name);
      poses_[i] = whole_body_poses(stage.object, stage.weights, object.fixed, clamp);
      Eigen::MatrixXd given = group.fields;
      hold_fixed_mean(object.fixed, given);
      if (asset.pose_tolerance) held_.back() = clamp.apply(given);
    }
    fields_.emplace_back(poses_[i] * changes_from_rest(group.examples));
    if (held_.back().size() == 0) held_.back() = fields_.back();
  }
}

Eigen::MatrixXd PoseFitter::fields() const {
  Eigen::MatrixXd fields(system_.mass.rows(), 0);
  for (const Eigen::MatrixXd& more : held_) {
    fields.conservativeResize(Eigen::NoChange, fields.cols() + more.cols());
    fields.rightCols(more.cols()) = more;
  }
  return fields;
}

PoseFitter::PoseFields PoseFitter::pose_fields(Eigen::Index index, Eigen::Index k) const {
  const auto group = static_cast<std::size_t>(index);
  const Eigen::VectorXd clamped = system_.extend(fields_[group].col(k - 1));
  const ExampleGroup& examples = stage_.groups[group];
  if (!examples.region.empty()) return {examples.fields.col(k - 1), seen(index, clamped), seen(index, clamped)};
  Eigen::MatrixXd given = examples.fields.col(k - 1);
  hold_fixed_mean(object_.fixed, given);
  if (examples.shifts.size() > 0) given += examples.shifts.col(k - 1);
  return {given,
          carried_fields(stage_.object, stage_.weights, object_.fixed, changes_from_rest(examples.examples).col(k - 1)),
          clamped};
}

RowMatrix PoseFitter::seen(Eigen::Index group, const RowMatrix& displacements) const {
  const auto& view = stage_.groups[static_cast<std::size_t>(group)].view;
  return view ? RowMatrix(view->see(displacements)) : displacements;
}

PoseCoordinates PoseFitter::range(Eigen::Index index) const {
  const auto group = static_cast<std::size_t>(index);
  Eigen::MatrixXd fields = poses_[group];
  fields -= system_.null_space * (system_.null_space.transpose() * (system_.mass * fields)).eval();
  return pose_range(system_.mass, fields,
                    descriptor_changes(stage_.data.rest_descriptor, stage_.groups[group].examples));
}

Eigen::VectorXd PoseFitter::tet_shares(Eigen::Index index) const {
  const auto& view = stage_.groups[static_cast<std::size_t>(index)].view;
  if (!view) return Eigen::VectorXd::Ones(object_.mesh.tet_count());
  return region_tet_shares(object_.mesh, view->inside(), view->window());
}

// The basis through the filter of the example force, then the space: U^T P Y.
Eigen::MatrixXd PoseFitter::pull(std::size_t index, const ProjectionData& projection,
                                 const TargetSpace& targets) const {
  const ExampleGroup& group = stage_.groups[index];
  RowMatrix displacements = system_.extend(targets.coordinates.basis);
  if (group.view) displacements = group.view->see(displacements);
  return pull_from_shape(projection) * shape_changes(stage_.object, stage_.weights, displacements);
}

PoseFitter::Finished PoseFitter::finish_group(std::size_t index, const ReducedModel& model) const {
  const ExampleGroup& group = stage_.groups[index];
  const RowMatrix& basis = model.modal->basis;
  const bool whole = group.region.empty();
  Finished finished{group.examples, direct_projection(stage_.object, stage_.weights, system_.full_mass,
                                                      whole ? basis : RowMatrix(group.view->see(basis)))};
  finished.projection.filter_scale =
      filter_scale(stage_.object, stage_.weights, object_.mesh, object_.materials.density);
  const RowMatrix map = whole && !system_.constrained() ? finished.projection.reduced_from_shape
                                                        : pose_map(poses_[index], system_, basis);
  finished.projection.target_basis = range_basis(map);
  fill_weights_problem(stage_.data.rest_descriptor, finished.projection, map, finished.examples);
  const Eigen::MatrixXd fields =
      whole ? carried_fields(stage_.object, stage_.weights, object_.fixed, changes_from_rest(finished.examples))
            : system_.extend(fields_[index]);
  for (Eigen::Index k = 0; k < fields.cols(); ++k) {
    ExampleData& example = finished.examples.examples[static_cast<std::size_t>(k + 1)];
    const Eigen::VectorXd rest = fields.col(k) - basis * example.pose;
    const double norm = fields.col(k).dot(system_.full_mass * fields.col(k));
    example.basis_error = norm > 0 ? std::sqrt(std::max(0.0, rest.dot(system_.full_mass * rest) / norm)) : 0;
  }
  if (group.shifts.size() > 0)
    add_shifts(stage_.data.rest_descriptor, finished.projection,
               shape_changes(stage_.object, stage_.weights, group.shifts), finished.examples);
  return finished;
}

void preview_examples(const ShapeStage& stage, ReducedModel& model) {
  model.shape_space = stage.data;
  for (const ExampleGroup& group : stage.groups)
    if (group.region.empty())
      model.examples = group.examples;
    else
      model.regions.push_back(region_of(group, std::ssize(model.regions)));
}

void PoseFitter::put(const std::vector<TargetSpace>& targets, ReducedModel& model) const {
  model.shape_space = stage_.data;
  for (std::size_t i = 0; i < stage_.groups.size(); ++i) {
    auto [examples, projection] = finish_group(i, model);
    const ExampleGroup& group = stage_.groups[i];
    const Eigen::MatrixXd pulled = pull(i, projection, targets[i]);
    if (group.region.empty()) {
      finish_targets(targets[i], pulled, model.target_space, model.targets);
      model.projection = std::move(projection);
      model.examples = std::move(examples);
      continue;
    }
    RegionData& region = model.regions.emplace_back(region_of(group, std::ssize(model.regions)));
    finish_targets(targets[i], pulled, region.target_space, region.targets);
    region.examples = std::move(examples);
    region.projection = std::move(projection);
  }
}

void PoseFitter::log_losses(const ReducedModel& model, std::vector<std::string>& warnings) const {
  FunctionCounter counter(model.object->mesh, asset_.name);
  auto region = model.regions.begin();
  for (const ExampleGroup& group : stage_.groups)
    log_group(group, counter, group.region.empty() ? *model.examples : (region++)->examples, warnings);
}

}  // namespace exmat::precompute

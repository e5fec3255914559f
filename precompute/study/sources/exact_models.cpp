#include "precompute/study/sources/exact_models.h"

#include <algorithm>
#include <fmt/format.h>
#include <optional>
#include <utility>

#include "common/core/error.h"
#include "common/model/example_pull.h"
#include "precompute/cubature/cubature.h"
#include "precompute/cubature/element_samples.h"
#include "precompute/examples/example_stage.h"
#include "precompute/full_space/full_space_examples.h"
#include "precompute/polynomial/internal_force.h"
#include "precompute/shape_space/projection.h"
#include "precompute/targets/target_space.h"

namespace exmat::precompute {
namespace {

constexpr int kToTheEnd = 1000;          // Newton iterations of a target in a step
constexpr double kAnyElements = 1e9;     // elements of the space are not used
constexpr double kSamePosition = 1e-12;  // over the body's size

bool is_mesh_of(const TetMesh& mesh, const TetMesh& other) {
  return mesh.tets.rows() == other.tets.rows() && mesh.vertices.rows() == other.vertices.rows() &&
         mesh.tets == other.tets &&
         (mesh.vertices - other.vertices).norm() <= kSamePosition * (1 + mesh.vertices.norm());
}

IndexVector flagged(const FlagVector& flags) {
  std::vector<std::int32_t> vertices;
  for (Eigen::Index v = 0; v < flags.size(); ++v)
    if (flags[v] != 0) vertices.push_back(static_cast<std::int32_t>(v));
  return Eigen::Map<const IndexVector>(vertices.data(), std::ssize(vertices));
}

// An example force of a scene.
struct Group {
  std::string region;  // empty: the whole body
  EnergyReference reference = EnergyReference::kExample;
};

std::vector<Group> groups_of(const SceneConfig& scene) {
  std::vector<Group> groups;
  if (scene.examples) groups.push_back({"", scene.examples->energy_reference});
  for (const RegionForceConfig& region : scene.regions) groups.push_back({region.name, region.force.energy_reference});
  return groups;
}

// All poses that descriptors stand for.
std::vector<PoseCoordinates> ranges(const ReducedModel& model, const ElasticSystem& system,
                                    const std::vector<Group>& groups) {
  std::vector<PoseCoordinates> found;
  std::vector<std::string> regions;
  const auto add = [&](const ExamplePoses& poses) {
    found.push_back(
        pose_range(system.mass, poses.fields, descriptor_changes(model.shape_space->rest_descriptor, *poses.examples)));
  };
  for (const Group& group : groups)
    if (group.region.empty())
      add(whole_body_example_poses(model, system));
    else
      regions.push_back(group.region);
  for (const ExamplePoses& poses : region_example_poses(model, system, regions)) add(poses);
  return found;
}

// Projection of a group of examples, and its space and table of targets.
struct TargetParts {
  const ProjectionData& projection;
  std::optional<TargetSpaceData>& space;
  std::optional<TargetTableData>& table;
};

TargetParts target_parts(ReducedModel& model, const std::string& region) {
  if (region.empty()) return {*model.projection, model.target_space, model.targets};
  RegionData& found = *std::ranges::find(model.regions, region, &RegionData::name);
  return {found.projection, found.target_space, found.targets};
}

// U^T P B of the displacements B of the coordinates.
RowMatrix pull_of(const ReducedModel& model, const ElasticSystem& system, const PoseCoordinates& coordinates,
                  const std::string& region, const ProjectionData& projection) {
  const LaplaceBasis object = laplace_basis_of(model);
  RowMatrix displacements = system.extend(coordinates.basis);
  if (!region.empty()) displacements = known_example_poses(model, region, coordinates).view.value().see(displacements);
  return pull_from_shape(projection) *
         shape_changes(object, descriptor_weights(object, model.shape_space->weighting), displacements);
}

TargetSpaceData exact_space(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                            EnergyReference reference) {
  const RowMatrix basis = system.extend(coordinates.basis);
  const ElementSamples samples(object.mesh, object.materials, basis);
  CubatureData elements = samples.data_of(mesh_target(object, system, coordinates, reference).elements);
  TargetSpaceData data;
  data.energy_reference = reference;
  data.poses = coordinates.poses.transpose();
  data.weights = Eigen::VectorXd::Ones(elements.elements.size());
  data.elements = std::move(elements.elements);
  data.volumes = std::move(elements.volumes);
  data.gradient = std::move(elements.gradient);
  data.youngs_modulus = std::move(elements.youngs_modulus);
  data.poisson_ratio = std::move(elements.poisson_ratio);
  return data;
}

ElasticSystem system_of(const ReducedModel& model) {
  const ObjectData& object = *model.object;
  return build_elastic_system(object.mesh, object.materials, object.fixed);
}

}  // namespace

void require_same_object(const AssetConfig& asset, const ObjectInput& object, const TetMesh& mesh) {
  if (is_mesh_of(object.mesh, mesh)) return;
  throw InputError({asset.file.string(), "/object/mesh", "the object of the study's asset", "another mesh",
                    "name the same object, with other examples alone"});
}

ReducedModel with_examples_of(const AssetConfig& asset, ReducedModel model, StageCache& cache) {
  InputFiles files;
  std::vector<std::string> warnings;
  const ObjectInput object = read_object(asset, files);
  require_same_object(asset, object, model.object->mesh);
  const ExampleInput input = read_examples(asset, object, files);
  ShapeStage stage = build_shape_stage(asset, object, input, cache, warnings);
  require_aligned(asset, stage.alignments, warnings);
  model.shape_space = stage.data;
  model.examples.reset();
  model.regions.clear();
  for (ExampleGroup& group : stage.groups) {
    fill_gram(stage.data.rest_descriptor, group.examples);
    if (group.region.empty()) {
      model.examples = std::move(group.examples);
      continue;
    }
    RegionData& region = model.regions.emplace_back();
    region.name = group.region;
    region.index = std::ssize(model.regions) - 1;
    region.vertices = flagged(group.view->inside());
    region.examples = std::move(group.examples);
  }
  return model;
}

std::vector<PoseCoordinates> target_coordinates(const ReducedModel& model, const SceneConfig& scene, double tolerance,
                                                std::uint64_t seed, StageCache& cache) {
  const std::vector<Group> groups = groups_of(scene);
  const ElasticSystem system = system_of(model);
  const ObjectData& object = *model.object;
  const std::vector<PoseCoordinates> all = ranges(model, system, groups);
  std::vector<PoseCoordinates> coordinates;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    const TargetSpaceOptions options{.energy_reference = groups[i].reference,
                                     .tolerance = tolerance,
                                     .element_tolerance = kAnyElements,
                                     .table = false,
                                     .seed = seed};
    coordinates.push_back(cache.get(
        "targets of error sources", [&] { return build_target_space(object, system, all[i], options).coordinates; },
        object.mesh, object.materials, system.free_dofs, all[i], options));
  }
  return coordinates;
}

void use_exact_targets(const SceneConfig& scene, const std::vector<PoseCoordinates>& coordinates, ReducedModel& model) {
  const std::vector<Group> groups = groups_of(scene);
  const ElasticSystem system = system_of(model);
  for (std::size_t i = 0; i < groups.size(); ++i) {
    const TargetParts parts = target_parts(model, groups[i].region);
    TargetSpaceData space = exact_space(*model.object, system, coordinates[i], groups[i].reference);
    space.pull = pull_of(model, system, coordinates[i], groups[i].region, parts.projection);
    parts.space = std::move(space);
    parts.table.reset();
  }
}

SceneConfig with_exact_targets(SceneConfig scene) {
  const auto solve = [](ExampleForceConfig& force) {
    force.target = TargetSource::kSolve;
    force.target_iterations = kToTheEnd;
  };
  if (scene.examples) solve(*scene.examples);
  for (RegionForceConfig& region : scene.regions) solve(region.force);
  return scene;
}

void use_all_elements(ReducedModel& model) {
  CubatureData all = all_elements(model.object->mesh, model.object->materials, model.modal->basis);
  all.heldout_poses = model.cubature->heldout_poses;
  model.cubature = std::move(all);
  model.polynomial.reset();
  choose_internal_force(ForceMethod::kCubature, std::nullopt, model);
}

std::string doubt_of_correspondence(const ObjectInput& object, const ExampleInput& examples) {
  const bool rest_is_known =
      examples.object_is_rest || is_mesh_of(examples.rest.mesh, object.mesh) || examples.rest.on_object.size() > 0;
  for (const PoseInput& pose : examples.poses) {
    if (pose.on_object.size() > 0) continue;
    if (!pose.same_connectivity) return fmt::format("the pose {} is on a mesh of its own", pose.name);
    if (!rest_is_known)
      return fmt::format("the pose {} is on the mesh of the rest example, which is not the object's", pose.name);
  }
  return "";
}

}  // namespace exmat::precompute

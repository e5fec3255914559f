#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"
#include "common/model/reduced_model.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/inputs/inputs.h"
#include "precompute/targets/mesh_target.h"

namespace exmat::precompute {

// Models of the motions between the full problem and a reduced one, in which some of the approximations
// are exact. Models are whole bundles.

/// Throws InputError where the object of an asset has another mesh.
void require_same_object(const AssetConfig& asset, const ObjectInput& object, const TetMesh& mesh);

/// The body of a model with the examples of an asset of the same object, seen through asset.eigenfunctions functions:
/// enough for the full space, and no more. Throws InputError where the objects differ.
ReducedModel with_examples_of(const AssetConfig& asset, ReducedModel model, StageCache& cache);

/// Few displacements that hold all targets of each example force of the scene, of the whole body first, as
/// FullSpaceOptions has them; to a tenth of `tolerance`, as build_target_space() finds them.
std::vector<PoseCoordinates> target_coordinates(const ReducedModel& model, const SceneConfig& scene, double tolerance,
                                                std::uint64_t seed, StageCache& cache);

/// Targets of the scene's example forces are solved in the coordinates over all tets: /target_space of all of them,
/// and no table.
void use_exact_targets(const SceneConfig& scene, const std::vector<PoseCoordinates>& coordinates, ReducedModel& model);
/// The scene of such a model, whose targets are solved to the end in each step.
SceneConfig with_exact_targets(SceneConfig scene);

/// All tets of weight 1 in the place of cubature or polynomial.
void use_all_elements(ReducedModel& model);

/// Why the poses' correspondence to the object is not known exactly; empty where it is: each is on the object's own
/// mesh, or comes by a map of its vertices.
std::string doubt_of_correspondence(const ObjectInput& object, const ExampleInput& examples);

}  // namespace exmat::precompute

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "precompute/alignment/pose_alignment.h"
#include "precompute/examples/alignment_verdict.h"
#include "precompute/examples/example_scale.h"
#include "precompute/examples/rest_placing.h"
#include "precompute/inputs/inputs.h"
#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {

class StageCache;

/// The rest example in the object's frame.
struct AlignedRest {
  LaplaceBasis basis;  ///< basis of the rest example; its vertices turned into the object's frame
  RestMap map;
  CarriedShape carried;                                    ///< the rest example by the map
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< from the rest example's frame to the object's
  bool free_poses = false;                                 ///< poses are rotated to the rest example first
  AlignmentOutcome outcome;
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, AlignedRest& value) {
  pass_all(archive, value.basis, value.map, value.carried, value.rotation, value.free_poses, value.outcome);
}

/// A pose as the rest example's vertices show it, or, of coupled bases, as it comes over to the object.
struct AlignedPose {
  VertexArray positions;                ///< n_0 x 3, placed beside the rest example, turned as that was
  std::optional<CarriedShape> carried;  ///< shape on the object by coupled bases, likewise
  PoseScale scale;
  AlignmentOutcome outcome;
};

/// Members that the stage cache keeps: all but the scale.
template <typename Archive>
void pass_members(Archive& archive, AlignedPose& value) {
  pass_all(archive, value.positions, value.carried, value.outcome);
}

/// Aligns the examples of an asset to the object's first m functions by its `alignment`. docs/alignment.md.
class ExampleAligner {
 public:
  /// All of these are kept by reference. `object` holds m functions.
  ExampleAligner(const AssetConfig& asset, const LaplaceBasis& object, const ObjectInput& object_input,
                 const ExampleInput& examples, StageCache& cache);

  /// Throws InputError and WorkError where the input cannot be worked with at all; doubts are in the outcome.
  AlignedRest align_rest();
  AlignedPose align_pose(const AlignedRest& rest, const PoseInput& pose);

 private:
  Eigen::Index functions() const { return object_.eigenvalues.size(); }
  AlignedRest map_rest(const LaplaceBasis& basis, const Eigen::Matrix3d& rotation) const;
  RestTurn turn_of_rest(const LaplaceBasis& basis, RestPlacing& placing) const;
  void use_vertex_map(AlignedRest& rest) const;
  const AlignedShape& rest_shape(const AlignedRest& rest);
  Correspondences correspondences(const AlignedRest& rest, const PoseInput& pose) const;
  std::vector<Eigen::Index> landmark_numbers(const PoseInput& pose) const;
  AlignedPose registered(const AlignedRest& rest, const PoseInput& pose, const Placing& placing);
  double missed_landmarks(const AlignedRest& rest, const PoseInput& pose, const VertexArray& posed,
                          const VertexArray& displacement) const;
  AlignedPose coupled(const AlignedRest& rest, const PoseInput& pose, const Placing& placing);
  VertexArray registered_points(const AlignedRest& rest, const AlignedShape& pose, const VertexArray& displacement,
                                const Eigen::Matrix3d& to_rest);
  Eigen::MatrixXd coupled_map(const PoseInput& example, const LaplaceBasis& basis) const;
  IndexMatrix landmarks_of(const PoseInput& pose) const;

  const AssetConfig& asset_;
  const LaplaceBasis& object_;
  const ObjectInput& object_input_;
  const ExampleInput& examples_;
  StageCache& cache_;
  std::optional<AlignedShape> rest_shape_;
  Symmetry symmetry_;
};

}  // namespace exmat::precompute

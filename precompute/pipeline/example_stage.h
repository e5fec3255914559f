#pragma once

#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/modes/field_clamp.h"
#include "precompute/pipeline/alignment_verdict.h"
#include "precompute/pipeline/inputs.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// The object's shape space and its examples in it, before there is a basis.
struct ShapeStage {
  LaplaceBasis object;                ///< its first m functions
  Eigen::MatrixXd rest_coefficients;  ///< m x 3, of the object
  Eigen::VectorXd weights;            ///< Lambda, m
  ShapeSpaceData data;
  std::vector<AlignmentOutcome> alignments;  ///< of the examples, in their order
  ExampleSet examples;            ///< the rest pose first; reduced coordinates and basis errors are not filled in
  Eigen::MatrixXd fields;         ///< 3n x (K-1) displacement of the object to each pose, whole [m]
  Eigen::MatrixXd displacements;  ///< 3n x (K-1) what the m functions carry of it [m]
};

/// Computes the object's shape space and brings every example into it. method.md, section 1; alignment.md. `warnings`
/// receives what is also logged as such. Refused alignments are in the stage, for require_aligned. Throws InputError
/// (no file named where it is the asset's) and WorkError.
ShapeStage build_shape_stage(const AssetConfig& asset, const ObjectInput& object, const ExampleInput& input,
                             std::vector<std::string>& warnings);

/// Puts shape space, projection and examples into a model that has its modal basis, logs and records what of each
/// example is lost. `stage` is used up.
void finish_examples(const AssetConfig& asset, const ElasticSystem& system, const FieldClamp& clamp, ShapeStage& stage,
                     ReducedModel& model, std::vector<std::string>& warnings);

}  // namespace exmat::precompute

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/model/reduced_model.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/examples/alignment_verdict.h"
#include "precompute/inputs/inputs.h"
#include "precompute/shape_space/laplace_basis.h"
#include "precompute/shape_space/region_view.h"

namespace exmat::precompute {

/// Examples that act together: on the whole body, or on a region alone.
struct ExampleGroup {
  std::string region;                ///< empty: the whole body
  std::optional<RegionView> view{};  ///< present for a region
  ExampleSet examples{};             ///< the rest pose first; reduced coordinates and basis errors are not filled in
  Eigen::MatrixXd fields{};          ///< 3n x (K-1) displacement of the object to each pose, as the view sees it [m]
  /// 3n x (K-1), where the clamp follows examples, the rest of these poses: the elastic displacement of the body by
  /// what each does to the clamp, whose own part is then left out of descriptors and fields [m].
  Eigen::MatrixXd shifts{};
};

/// A pose brought to the object as a whole, whatever it acts on.
struct StagedPose {
  RowMatrix3 rotation = RowMatrix3::Identity();  ///< from the example's frame to the object's
  double scale = 1;                              ///< from the example's unit of length to the object's
  VertexArray displacement;                      ///< n x 3, what the m functions carry [m]
};

/// The object's shape space and its examples in it, before there is a basis.
struct ShapeStage {
  LaplaceBasis object;                ///< its first m functions
  Eigen::MatrixXd rest_coefficients;  ///< m x 3, of the object
  Eigen::VectorXd weights;            ///< Lambda, m
  ShapeSpaceData data;
  std::vector<AlignmentOutcome> alignments;  ///< one for each example, in their order
  std::vector<StagedPose> poses;             ///< as ExampleInput::poses
  std::vector<ExampleGroup> groups;          ///< the whole body's, if any, then those of the regions

  bool has_regions() const { return !groups.empty() && !groups.back().region.empty(); }
};

/// Computes the object's shape space and brings every example into it. docs/method.md, "Shape space";
/// docs/alignment.md. Eigenfunctions and registered poses come from the cache where it has them. `warnings` receives
/// what is also logged as such. Refused alignments are in the stage, for require_aligned. Throws InputError (no file
/// named where it is the asset's) and WorkError.
ShapeStage build_shape_stage(const AssetConfig& asset, const ObjectInput& object, const ExampleInput& input,
                             StageCache& cache, std::vector<std::string>& warnings);

}  // namespace exmat::precompute

#pragma once

#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "precompute/alignment/pose_alignment.h"

namespace exmat::precompute {

enum class AlignmentVerdict { kGood, kDoubtful, kRefused };

/// "good", "doubtful" or "refused".
const char* name_of(AlignmentVerdict verdict);

/// Outcome of an example's alignment, for the bundle and the user. docs/alignment.md, "What the user is told".
struct AlignmentOutcome {
  std::string name;
  std::string method;
  double residual = 0, doubt = 0, inverted_fraction = 0;
  std::int64_t competing_maps = 0;
  double shape_space_error = 0;  ///< filled in where the pose is transferred
  AlignmentVerdict verdict = AlignmentVerdict::kGood;
  std::string message{};  ///< why it is not good, and what input would help
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, AlignmentOutcome& value) {
  pass_all(archive, value.name, value.method, value.residual, value.doubt, value.inverted_fraction,
           value.competing_maps, value.shape_space_error, value.verdict, value.message);
}

/// Raises the verdict to `verdict` with a message, before that of a lesser one; one as grave or graver stands alone.
void object_to(AlignmentOutcome& outcome, AlignmentVerdict verdict, const std::string& message);

/// Doubt J and share of inverted volume against their limits; `advice` says what input would help.
void judge_doubt(AlignmentOutcome& outcome, const std::string& advice);

/// Residual, the distance of the pose's surface from what was found, against its limits: that of a doubt, and 0.15.
void judge_residual(AlignmentOutcome& outcome, const std::string& advice, double warning = 0.05);

/// Fills in an outcome from a registered pose. `frame` is that of the asset; `free_frame` what it came to.
void judge_pose(const PoseAlignment& alignment, AlignmentFrame frame, bool free_frame, AlignmentOutcome& outcome);

/// Names the landmarks that contradict the others; `numbers` are their places in the file, from 1.
void judge_landmarks(const PoseAlignment& alignment, const std::vector<Eigen::Index>& numbers,
                     AlignmentOutcome& outcome);

/// Throws WorkError that names every refused example, unless the asset accepts them. Doubts, and refusals that are
/// accepted, are warnings: appended and logged.
void require_aligned(const AssetConfig& asset, const std::vector<AlignmentOutcome>& outcomes,
                     std::vector<std::string>& warnings);

/// Appends a warning and logs it.
void warn(std::vector<std::string>& warnings, const std::string& message);

}  // namespace exmat::precompute

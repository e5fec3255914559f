#pragma once

#include <string>
#include <vector>

#include "precompute/alignment/functional_map.h"
#include "precompute/alignment/registration.h"
#include "precompute/alignment/symmetry.h"

namespace exmat::precompute {

/// Corresponding points of the rest example and a posed one.
struct Correspondences {
  SparseMatrix on_rest;  ///< l x n_0 interpolation
  SparseMatrix on_pose;  ///< l x n_k interpolation

  Eigen::Index count() const { return on_rest.rows(); }
};

/// Knowledge about a pose beforehand.
struct AlignmentHints {
  bool free_frame = false;          ///< the pose may be rotated in space
  Correspondences correspondences;  ///< landmarks, or a dense map
  bool landmarks_alone = false;     ///< no starts but from the correspondences
  bool frame_unsaid = false;        ///< free_frame is a guess: of poses that fit, the least moved is meant
};

/// A landmark that contradicts the others.
struct LeftOutLandmark {
  std::size_t index = 0;  ///< row of the correspondences
  double missed = 0;      ///< distance from where it belongs by the pose that was found, over the RMS radius
};

/// A posed example registered from the rest example: the positions of the rest example's vertices in the pose.
struct PoseAlignment {
  VertexArray positions;            ///< n_0 x 3, normalised, in the frame of the pose
  std::string start;                ///< start of the registration, in words
  double residual = 0;              ///< RMS distance of the two surfaces, over the RMS radius of the rest example
  double missed_landmarks = 0;      ///< RMS distance of the landmarks from where they belong, over the RMS radius
  double doubt = 0;                 ///< docs/alignment.md, "What the user is told"; 0 is certain
  double inverted_fraction = 0;     ///< share of the rest example's volume
  std::int64_t competing_maps = 0;  ///< other poses that fit within 1.4 times the best
  bool ambiguous = false;           ///< one of them is as near the rest pose, or nothing can tell which is
  bool mirrored = false;            ///< the mirror image of the rest example fits, and this does not
  double mirror_residual = 0;       ///< residual of that mirror image, where it fits
  double squeezed_fraction = 0;     ///< share of the volume in tets that shrink to half beside the whole, or double
  double uncovered = 0;             ///< share of the area of either surface, the larger, that is far from the other
  bool hides_twist = false;         ///< a body of revolution: a turn about its axis leaves no trace
  double displacement = 0;          ///< RMS from rest, over the RMS radius
  std::vector<LeftOutLandmark> left_out;  ///< landmarks that were not used
  double turn = 0;                        ///< angle of the rotation that lays the rest example best over the pose [rad]
};

/// Registers a pose: docs/alignment.md, "How a pose on another mesh is registered". Both shapes normalised; `symmetry`
/// is that of the rest example.
PoseAlignment align_pose(const AlignedShape& rest, const Symmetry& symmetry, const AlignedShape& pose,
                         const AlignmentHints& hints);

}  // namespace exmat::precompute

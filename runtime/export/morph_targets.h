#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/vertex_normals.h"
#include "runtime/export/drawn_surface.h"

namespace exmat::runtime {

/// N morph targets of a surface: with weights w it is drawn at vertices + displacements w, with the normals
/// at rest + normals w, made unit again.
struct MorphTargets {
  std::vector<std::string> names;  ///< N
  RowMatrix displacements;         ///< 3v x N [m for a weight of 1]
  RowMatrix normals;               ///< 3v x N
  RowMatrix weights;               ///< F x N, of each frame; none without a motion
};

/// Error of morph targets in single precision against a motion, over all frames and vertices.
struct MorphError {
  double largest = 0, rms = 0;  ///< error of the positions in the body's frame [m]
  double normal_rms = 0;        ///< angle between the normals [rad], over at most kNormalFrames frames
};

/// Frames that normals are fitted to and judged by, spread over the motion.
constexpr Eigen::Index kNormalFrames = 100;

/// The modes, weighted by q itself, with the derivatives of the normals at rest.
MorphTargets modes_as_targets(const DrawnSurface& surface, const VertexNormals& normals);

/// Targets for a motion [F x r], r or, if there are as many, `count` >= 1: the principal components of the
/// displacements of the vertices, which miss least of them of all sets of so many. Each is scaled so that its largest
/// weight is 1 or -1; normals are fitted to those of the motion (ridge regression, towards the derivatives at rest).
MorphTargets targets_of_motion(const DrawnSurface& surface, const VertexNormals& normals, const RowMatrix& reduced,
                               std::optional<std::int64_t> count = std::nullopt);

MorphError error_of(const MorphTargets& targets, const DrawnSurface& surface, const VertexNormals& normals,
                    const RowMatrix& reduced);

}  // namespace exmat::runtime

#pragma once

#include <vector>

#include "common/mesh/assembly.h"
#include "precompute/study/measure/frames.h"

namespace exmat::precompute {

/// Largest lead or lag of a motion, of the duration.
inline constexpr double kPhaseReach = 0.05;

/// F distances |.|_M of each frame from the motion of the reference between `reach` [s] before and after it, which goes
/// straight from frame to frame: 0 for a body that is late by less, and otherwise as it should be. `turned`: of a free
/// body, turned and shifted to where it is nearest. Squares cancel: a distance below 1e-7 of the body's size is not
/// resolved.
std::vector<double> nearest_distances(const BodyFrames& frames, const BodyFrames& reference, const SparseMatrix& mass,
                                      double reach, bool turned);

}  // namespace exmat::precompute

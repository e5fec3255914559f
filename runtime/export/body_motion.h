#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/export/trajectory_reader.h"

namespace exmat::runtime {

/// A run of a body, F frames.
struct BodyMotion {
  Eigen::VectorXd times;   ///< F, increasing [s]
  RowMatrix reduced;       ///< F x r, q [kg^(1/2) m]
  RowMatrix positions;     ///< F x 3, of the body's origin beyond where it is at rest [m]
  RowMatrix orientations;  ///< F x 4, unit quaternions, w first, each in the half space of the one before it
  RowMatrix bones;         ///< F x 7b, joint [m] and turn from the bind pose, w first, of a body on a skeleton
  bool full = false;       ///< in some frame it was in full space: q does not say where its vertices are

  Eigen::Index frames() const { return times.size(); }
};

/// Throws InputError: damaged, or of exmat-precompute full-space, without reduced coordinates.
BodyMotion read_body_motion(TrajectoryReader& trajectory);

}  // namespace exmat::runtime

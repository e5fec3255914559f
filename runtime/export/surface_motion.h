#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/export/body_motion.h"
#include "runtime/export/drawn_surface.h"
#include "runtime/export/trajectory_reader.h"

namespace exmat::runtime {

/// Motion of the vertices of a drawn surface as a trajectory holds it.
struct SurfaceMotion {
  RowMatrix displacements;  ///< F x 3v, from rest in the body's frame or, with a skin, before it [m]
  double missed = 0;        ///< by as much does one miss a position, where bones cancel each other out [m]
};

/// By the positions of the object's vertices, of the body that is selected. Throws InputError.
SurfaceMotion read_surface_motion(TrajectoryReader& trajectory, const DrawnSurface& surface, const BodyMotion& motion);

/// A motion by its principal components, those that are needed for an RMS error of `tolerance`.
struct MotionComponents {
  RowMatrix modes;              ///< 3v x N, orthonormal columns
  RowMatrix reduced;            ///< F x N [m]
  double largest = 0, rms = 0;  ///< what they miss of a vertex [m]
};
MotionComponents components_of(const RowMatrix& displacements, double tolerance);

}  // namespace exmat::runtime

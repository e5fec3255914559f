#pragma once

#include <vector>

#include "precompute/alignment/aligned_shape.h"
#include "precompute/alignment/surface_tree.h"

namespace exmat::precompute {

/// Rotations that lay a body of volume 1 at centroid 0 upon itself.
struct Symmetry {
  std::vector<Eigen::Matrix3d> rotations;  ///< without the identity
  bool of_revolution = false;              ///< some axis admits any angle
  bool mirrored = false;                   ///< it is its own mirror image
};

/// Looks about the principal axes, for mirror images too, and refines by iterated closest points; of a body of
/// revolution only some of its many. Two bodies count as one where their surfaces are `tolerance` apart (RMS, over the
/// RMS radius).
Symmetry rest_symmetry(const AlignedShape& shape, double tolerance = 0.02);

/// Columns: principal axes of the second moments of mass, right-handed, moments ascending.
Eigen::Matrix3d principal_axes(const LaplaceBasis& basis);

/// Angle of the turn from one rotation to the other, 0 to pi [rad].
double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

/// The 24 rotations of a cube.
std::vector<Eigen::Matrix3d> cube_rotations();

/// RMS distance of the vertices of a body of volume 1 from its centroid, by mass.
double rms_radius(const LaplaceBasis& basis);

}  // namespace exmat::precompute

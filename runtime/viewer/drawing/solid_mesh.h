#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "exmat/exmat.h"

namespace exmat::viewer {

/// Triangles with a normal at each point.
struct SolidMesh {
  std::vector<float> points;           ///< six numbers each: place [m] and normal
  std::vector<std::uint32_t> indices;  ///< 3f
};

SolidMesh make_ball(const Eigen::Vector3d& centre, double radius);
SolidMesh make_box(const Eigen::Vector3d& centre, const Eigen::Vector3d& half, const Eigen::Matrix3d& axes);
SolidMesh make_capsule(const Eigen::Vector3d& start, const Eigen::Vector3d& axis, double radius);
/// A piece of a plane of so many metres in each direction.
SolidMesh make_sheet(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double half);

/// Flat triangles by three corners each [9f].
SolidMesh make_triangles(std::span<const double> corners);

/// In the obstacle's frame; a sheet of the given size of a plane, `corners` [9f] of a mesh or of ground.
SolidMesh make_obstacle(const exmat_obstacle& obstacle, std::span<const double> corners, double sheet);

}  // namespace exmat::viewer

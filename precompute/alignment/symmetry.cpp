#include "precompute/alignment/symmetry.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>

namespace exmat::precompute {
namespace {

// About each principal axis; a body of revolution admits the first, which no prism of fewer than 18 sides does.
constexpr std::array<double, 5> kAngles{20, 45, 60, 72, 120};  // [degrees]

double gap(const AlignedShape& shape, const SurfaceTree& surface, const Eigen::Matrix3d& rotation) {
  return std::sqrt(two_way_chamfer(SurfaceTree(shape.mesh.vertices * rotation.transpose(), shape.surface), surface));
}

}  // namespace

Eigen::Matrix3d principal_axes(const AlignedShape& shape) {
  const Eigen::Matrix3d moments = shape.mesh.vertices.transpose() * (shape.basis.mass * shape.mesh.vertices);
  Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors();
  if (axes.determinant() < 0) axes.col(0) *= -1;
  return axes;
}

double rms_radius(const AlignedShape& shape) {
  return std::sqrt((shape.mesh.vertices.transpose() * (shape.basis.mass * shape.mesh.vertices)).trace());
}

std::vector<Eigen::Matrix3d> cube_rotations() {
  std::vector<Eigen::Matrix3d> rotations;
  for (int first = 0; first < 3; ++first)
    for (int second = 0; second < 3; ++second) {
      if (second == first) continue;
      for (int signs = 0; signs < 4; ++signs) {
        Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
        R(first, 0) = (signs & 1) != 0 ? -1 : 1;
        R(second, 1) = (signs & 2) != 0 ? -1 : 1;
        R.col(2) = R.col(0).cross(R.col(1));
        rotations.push_back(R);
      }
    }
  return rotations;
}

Symmetry rest_symmetry(const AlignedShape& shape, double tolerance) {
  const SurfaceTree surface(shape.mesh.vertices, shape.surface);
  const double limit = tolerance * rms_radius(shape);
  const Eigen::Matrix3d axes = principal_axes(shape);
  Symmetry symmetry;
  const auto offer = [&](const Eigen::Matrix3d& rotation) {
    const bool is_one = gap(shape, surface, rotation) < limit;
    if (is_one) symmetry.rotations.push_back(rotation);
    return is_one;
  };
  for (const Eigen::Matrix3d& turn : cube_rotations())
    if (!turn.isIdentity(0.1)) offer(axes * turn * axes.transpose());
  for (int axis = 0; axis < 3; ++axis)
    for (const double angle : kAngles) {
      const Eigen::AngleAxisd rotation(angle * std::numbers::pi / 180, Eigen::Vector3d(axes.col(axis)));
      const bool is_one = offer(rotation.toRotationMatrix());
      symmetry.of_revolution = symmetry.of_revolution || (is_one && angle == kAngles[0]);
    }
  return symmetry;
}

}  // namespace exmat::precompute

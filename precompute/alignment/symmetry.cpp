#include "precompute/alignment/symmetry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/core/decompositions.h"
#include "common/mesh/farthest_points.h"
#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

constexpr double kEqualMoments = 0.1;  // relative difference of moments that may belong to a symmetric body
constexpr int kTurns = 8;              // tried about an axis of equal moments: multiples of 45 degrees
constexpr int kSelfFitRounds = 10;
constexpr Eigen::Index kSelfFitSamples = 150;
constexpr double kSameRotation = 0.25;                            // [rad]
constexpr double kRevolutionAngle = 20 * std::numbers::pi / 180;  // no prism of fewer than 18 sides admits it

// A body's surface laid upon itself.
class SelfFit {
 public:
  explicit SelfFit(const AlignedShape& shape) : surface_(shape.mesh.vertices, shape.surface) {
    const auto& centres = surface_.samples().centres;
    samples_ = centres(farthest_points(centres, kSelfFitSamples), Eigen::all);
  }

  // The rotation that iterated closest points reach from a first guess; a reflection from one.
  Eigen::Matrix3d settle(Eigen::Matrix3d rotation) const {
    const double sign = rotation.determinant() < 0 ? -1 : 1;
    for (int round = 0; round < kSelfFitRounds; ++round)
      rotation = sign * procrustes_rotation(sign * nearest(samples_ * rotation.transpose()).transpose() * samples_);
    return rotation;
  }

  // RMS distance of the rotated surface from itself.
  double gap(const Eigen::Matrix3d& rotation) const {
    const VertexArray turned = samples_ * rotation.transpose();
    return (nearest(turned) - turned).norm() / std::sqrt(static_cast<double>(turned.rows()));
  }

 private:
  VertexArray nearest(const VertexArray& points) const {
    VertexArray found(points.rows(), 3);
#pragma omp parallel for schedule(static)
    for (Eigen::Index k = 0; k < points.rows(); ++k)
      found.row(k) = surface_.nearest(points.row(k).transpose()).position.transpose();
    return found;
  }

  SurfaceTree surface_;
  VertexArray samples_;
};

// Rotations near which the symmetries of a body of these principal axes and moments are.
std::vector<Eigen::Matrix3d> guesses(const Eigen::Matrix3d& axes, const Eigen::Vector3d& moments) {
  const auto equal = [&](int a, int b) { return moments[b] - moments[a] < kEqualMoments * moments[b]; };
  const bool low = equal(0, 1), high = equal(1, 2);
  std::vector<Eigen::Matrix3d> result;
  if (!low && !high) {
    for (int axis = 0; axis < 3; ++axis)
      result.emplace_back(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d(axes.col(axis))));
    return result;
  }
  if (low && high) {
    for (const Eigen::Matrix3d& turn : cube_rotations()) result.emplace_back(axes * turn * axes.transpose());
    return result;
  }
  const Eigen::Vector3d axis = axes.col(low ? 2 : 0), side = axes.col(1);
  for (int turn = 0; turn < kTurns; ++turn) {
    const Eigen::AngleAxisd about(2 * std::numbers::pi * turn / kTurns, axis);
    result.emplace_back(about);
    result.emplace_back(about * Eigen::AngleAxisd(std::numbers::pi, side));
  }
  return result;
}

}  // namespace

Eigen::Matrix3d principal_axes(const LaplaceBasis& basis) {
  const Eigen::Matrix3d moments = basis.vertices.transpose() * (basis.mass * basis.vertices);
  Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors();
  if (axes.determinant() < 0) axes.col(0) *= -1;
  return axes;
}

double rms_radius(const LaplaceBasis& basis) {
  return std::sqrt((basis.vertices.transpose() * (basis.mass * basis.vertices)).trace());
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
  const SelfFit self(shape);
  const double limit = tolerance * rms_radius(shape.basis);
  const Eigen::Matrix3d axes = principal_axes(shape.basis);
  const Eigen::Vector3d moments =
      (axes.transpose() * shape.mesh.vertices.transpose() * (shape.basis.mass * shape.mesh.vertices) * axes).diagonal();
  Symmetry symmetry;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::AngleAxisd turn(kRevolutionAngle, Eigen::Vector3d(axes.col(axis)));
    if (self.gap(turn.toRotationMatrix()) < limit) symmetry.of_revolution = true;
  }
  std::vector<Eigen::Matrix3d> found{Eigen::Matrix3d::Identity()};
  const std::vector<Eigen::Matrix3d> all = guesses(axes, moments);
  symmetry.mirrored =
      self.gap(self.settle(-Eigen::Matrix3d::Identity())) < limit ||
      std::ranges::any_of(all, [&](const Eigen::Matrix3d& guess) { return self.gap(self.settle(-guess)) < limit; });
  for (const Eigen::Matrix3d& guess : all) {
    const Eigen::Matrix3d rotation = symmetry.of_revolution ? guess : self.settle(guess);
    if (self.gap(rotation) >= limit) continue;
    if (std::ranges::none_of(found, [&](const auto& other) { return angle_between(other, rotation) < kSameRotation; }))
      found.push_back(rotation);
  }
  symmetry.rotations.assign(found.begin() + 1, found.end());
  return symmetry;
}

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

}  // namespace exmat::precompute

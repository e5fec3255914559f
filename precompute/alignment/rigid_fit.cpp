#include "precompute/alignment/rigid_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <utility>

#include "common/mesh/farthest_points.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/symmetry.h"
#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

constexpr int kSettlingRounds = 10;
constexpr Eigen::Index kSettlingSamples = 100, kSamples = 200;
constexpr std::size_t kSettled = 8;  // of each kind of first guesses, the best
// Limits for an iterated fit in place of a turn by right angles: iterating follows the tessellation, too.
constexpr double kWorthIterating = 0.7, kWorthwhileGap = 0.01;
// An axis this near to one of space is named by its letter [rad].
constexpr double kNearAxis = 0.05;

}  // namespace

BodySurface body_surface(const LaplaceBasis& basis, const TetArray& tets) {
  return {basis.vertices, surface_triangles(tets), principal_axes(basis), rms_radius(basis)};
}

RigidFitter::Sampled::Sampled(const BodySurface& body) : tree(body.vertices, body.triangles) {
  const VertexArray& centres = tree.samples().centres;
  points = centres(farthest_points(centres, kSamples), Eigen::all);
  few = points(farthest_points(points, kSettlingSamples), Eigen::all);
}

double RigidFitter::Sampled::mean_squared_distance(const VertexArray& from) const {
  Eigen::VectorXd squared(from.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index k = 0; k < squared.size(); ++k) {
    const Eigen::Vector3d point = from.row(k);
    squared[k] = (tree.nearest(point).position - point).squaredNorm();
  }
  return squared.mean();
}

RigidFitter::RigidFitter(const BodySurface& moving, const BodySurface& fixed)
    : moving_axes_(moving.axes), fixed_axes_(fixed.axes), moving_(moving), fixed_(fixed), radius_(fixed.radius) {}

Eigen::Matrix3d RigidFitter::settle(Eigen::Matrix3d rotation) const {
  const double sign = rotation.determinant() < 0 ? -1 : 1;
  const VertexArray& samples = moving_.few;
  VertexArray nearest(samples.rows(), 3);
  for (int round = 0; round < kSettlingRounds; ++round) {
    const VertexArray turned = samples * rotation.transpose();
#pragma omp parallel for schedule(static)
    for (Eigen::Index k = 0; k < nearest.rows(); ++k)
      nearest.row(k) = fixed_.tree.nearest(turned.row(k).transpose()).position.transpose();
    rotation = sign * procrustes_rotation(sign * nearest.transpose() * samples);
  }
  return rotation;
}

RigidFit RigidFitter::sampled_fit(const Eigen::Matrix3d& rotation) const {
  const double there = fixed_.mean_squared_distance(moving_.points * rotation.transpose()),
               back = moving_.mean_squared_distance(fixed_.points * rotation);
  return {rotation, std::sqrt(0.5 * (there + back)) / radius_};
}

RigidFit RigidFitter::at(const Eigen::Matrix3d& rotation) const {
  const SurfaceTree turned = moving_.tree.rotated(rotation);
  return {rotation, std::sqrt(two_way_chamfer(turned, fixed_.tree)) / radius_};
}

std::vector<RigidFit> RigidFitter::fits(bool mirrored) const {
  const double sign = mirrored ? -1 : 1;
  std::vector<RigidFit> plain, by_axes, all;
  for (const Eigen::Matrix3d& turn : cube_rotations()) {
    plain.push_back(sampled_fit(sign * turn));
    by_axes.push_back(sampled_fit(sign * fixed_axes_ * turn * moving_axes_.transpose()));
  }
  std::ranges::stable_sort(plain, {}, &RigidFit::gap);
  std::ranges::stable_sort(by_axes, {}, &RigidFit::gap);
  // Adds what iterating makes of a guess, or the nearest turn by right angles where that is hardly worse.
  const auto offer = [&](const RigidFit& guess) {
    const RigidFit fit = sampled_fit(settle(guess.rotation));
    const RigidFit& straight = *std::ranges::min_element(
        plain, {}, [&](const RigidFit& other) { return angle_between(other.rotation, fit.rotation); });
    const bool gains = straight.gap > kWorthwhileGap && fit.gap < kWorthIterating * straight.gap;
    all.push_back(gains || angle_between(straight.rotation, fit.rotation) > kDifferentRotation ? fit : straight);
  };
  for (std::size_t k = 0; k < kSettled; ++k) {
    offer(plain[k]);
    offer(by_axes[k]);
  }
  std::ranges::stable_sort(all, {}, &RigidFit::gap);
  std::vector<RigidFit> different;
  for (const RigidFit& fit : all)
    if (std::ranges::none_of(different, [&](const RigidFit& other) {
          return angle_between(other.rotation, fit.rotation) < kDifferentRotation;
        }))
      different.push_back(fit);
  return different;
}

RigidFitter::Uncovered RigidFitter::uncovered(const Eigen::Matrix3d& rotation, double distance) const {
  const SurfaceTree turned = moving_.tree.rotated(rotation);
  return {uncovered_share(turned, fixed_.tree, distance * radius_),
          uncovered_share(fixed_.tree, turned, distance * radius_)};
}

std::string describe_turn(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(rotation.transpose()));
  Eigen::Vector3d axis = turn.axis();
  double degrees = turn.angle() * 180 / std::numbers::pi;
  Eigen::Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  if (axis[largest] < 0) {
    axis = -axis;
    degrees = -degrees;
  }
  if (axis[largest] > std::cos(kNearAxis))
    return fmt::format("turned by {:.0f} degrees about {}", degrees, "xyz"[largest]);
  return fmt::format("turned by {:.0f} degrees about the axis ({:.2f}, {:.2f}, {:.2f})", degrees, axis[0], axis[1],
                     axis[2]);
}

}  // namespace exmat::precompute

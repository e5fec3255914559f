#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>

#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/contact/nearest_on_triangle.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

constexpr double kRounding = 1e-13;  // of the square of the way to the triangle's corner

/// Some triangles as the kernels take them, [corner](axis, triangle).
struct Triangles {
  explicit Triangles(std::uint32_t seed) {
    for (auto& corner : corners) corner = test::random_matrix(3, kLanes, seed++);
    const auto last = static_cast<Eigen::Index>(kLanes - 1);
    corners[2].col(last) = corners[1].col(last) + 1e-9 * (corners[0].col(last) - corners[1].col(last));  // a needle
    corners[1].col(last - 1) = corners[0].col(last - 1);                                                 // an edge
    corners[1].col(last - 2) = corners[2].col(last - 2) = corners[0].col(last - 2);                      // a point
    corners[2].col(last - 3) = 0.5 * (corners[0].col(last - 3) + corners[1].col(last - 3));              // a line
  }
  AlignedArray packed() const {
    AlignedArray array(9 * kLanes);
    for (int c = 0; c < 3; ++c)
      for (int axis = 0; axis < 3; ++axis)
        for (int t = 0; t < kLanes; ++t) array[(3 * c + axis) * kLanes + t] = corner(c)(axis, t);
    return array;
  }
  const Eigen::Matrix3Xd& corner(int c) const { return corners[static_cast<std::size_t>(c)]; }
  TrianglePoint nearest(const Eigen::Vector3d& point, int t) const {
    return nearest_on_triangle(point, corner(0).col(t), corner(1).col(t), corner(2).col(t));
  }

  /// Squared: of the three edges, and inside where there is an area.
  double squared_distance(const Eigen::Vector3d& point, int t) const {
    double least = t < kWithArea ? nearest(point, t).squared_distance : std::numeric_limits<double>::infinity();
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d a = corner(c).col(t), edge = corner((c + 1) % 3).col(t) - a;
      const double length = edge.squaredNorm();
      const double along = length > 0 ? std::clamp(edge.dot(point - a) / length, 0.0, 1.0) : 0;
      least = std::min(least, (a + along * edge - point).squaredNorm());
    }
    return least;
  }

  static constexpr int kWithArea = kLanes - 4;
  std::array<Eigen::Matrix3Xd, 3> corners;
};

/// Near, far, and on triangles: on corners, edges and faces.
Eigen::Vector3d query(const Triangles& triangles, std::uint32_t trial) {
  const Eigen::Vector3d random = test::random_vector(3, 1000 + trial);
  if (trial % 3 == 0) return random;
  if (trial % 3 == 1) return 100 * random;
  Eigen::Vector3d weights = random.cwiseAbs();
  if (trial % 2 == 0) weights[0] = 0;
  if (trial % 5 == 0) weights[1] = 0;
  weights /= weights.sum();
  Eigen::Vector3d on = Eigen::Vector3d::Zero();
  for (int c = 0; c < 3; ++c) on += weights[c] * triangles.corner(c).col(trial % kLanes);
  return on;
}

TEST(TriangleKernels, DistancesAreThoseOfOneTriangleAtATime) {
  for (std::uint32_t trial = 0; trial < 400; ++trial) {
    const Triangles triangles(10 * trial);
    const AlignedArray packed = triangles.packed();
    const Eigen::Vector3d point = query(triangles, trial);
    for (const Kernels* kernels : available()) {
      std::array<double, kLanes> squared;
      kernels->triangle_distances(packed.data(), point.data(), squared.data());
      for (int t = 0; t < kLanes; ++t) {
        const double expected = triangles.squared_distance(point, t);
        const double away = (point - triangles.corner(0).col(t)).squaredNorm();
        const double found = squared[static_cast<std::size_t>(t)];
        EXPECT_GE(found, 0) << kernels->name;
        EXPECT_LE(found, expected) << kernels->name << ' ' << trial << ' ' << t;
        EXPECT_GE(found, expected - kRounding * away) << kernels->name << ' ' << trial << ' ' << t;
      }
    }
  }
}

TEST(TriangleKernels, WhatHasNotComeNearIsFar) {
  constexpr double kShare = 0.25;
  int near = 0, far = 0;
  for (std::uint32_t trial = 0; trial < 400; ++trial) {
    const Triangles triangles(10 * trial), at_rest(10 * trial + 5);
    const AlignedArray packed = triangles.packed(), rest = at_rest.packed();
    const Eigen::Vector3d point = query(triangles, trial), rest_point = test::random_vector(3, 5000 + trial);
    for (const Kernels* kernels : available()) {
      std::array<double, kLanes> squared;
      kernels->approached_triangles(packed.data(), point.data(), rest.data(), rest_point.data(), kShare,
                                    squared.data());
      for (int t = 0; t < Triangles::kWithArea; ++t) {  // without an area the nearest point at rest is not the only one
        const TrianglePoint expected = triangles.nearest(point, t);
        Eigen::Vector3d there = Eigen::Vector3d::Zero();
        for (int c = 0; c < 3; ++c) there += expected.barycentric[c] * at_rest.corner(c).col(t);
        const double limit = kShare * (rest_point - there).squaredNorm();
        if (std::abs(expected.squared_distance - limit) < 1e-6 * limit) continue;
        const double found = squared[static_cast<std::size_t>(t)];
        EXPECT_EQ(std::isinf(found), expected.squared_distance > limit) << kernels->name << ' ' << trial << ' ' << t;
        ++(std::isinf(found) ? far : near);
      }
    }
  }
  EXPECT_GT(near, 500);
  EXPECT_GT(far, 500);
}

}  // namespace
}  // namespace exmat::runtime

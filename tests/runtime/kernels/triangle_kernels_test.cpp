#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <gtest/gtest.h>
#include <iterator>
#include <limits>
#include <vector>

#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/contact/nearest_on_triangle.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace triangle_kernels_test {

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

/// Triangles and a point that were elsewhere at rest.
struct Moved {
  explicit Moved(std::uint32_t trial)
      : triangles(10 * trial),
        at_rest(10 * trial + 5),
        packed(triangles.packed()),
        rest(at_rest.packed()),
        point(query(triangles, trial)),
        rest_point(test::random_vector(3, 5000 + trial)) {}
  Triangles triangles, at_rest;
  AlignedArray packed, rest;
  Eigen::Vector3d point, rest_point;
};

TEST(TriangleKernels, DistancesAreThoseOfOneTriangleAtATime) {
  for (std::uint32_t trial = 0; trial < 400; ++trial) {
    const Triangles triangles(10 * trial);
    const AlignedArray packed = triangles.packed();
    const Eigen::Vector3d point = query(triangles, trial);
    for (const Kernels* kernels : available()) {
      std::array<double, kLanes> squared;
      constexpr double kLimit = 2;
      const unsigned near = kernels->triangle_distances(packed.data(), point.data(), kLimit, squared.data());
      for (int t = 0; t < kLanes; ++t) {
        EXPECT_EQ((near >> t & 1U) != 0, squared[static_cast<std::size_t>(t)] <= kLimit) << kernels->name;
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
    const Moved moved(trial);
    const auto& [triangles, at_rest, packed, rest, point, rest_point] = moved;
    for (const Kernels* kernels : available()) {
      std::array<double, kLanes> squared;
      constexpr double kLimit = 3;
      const unsigned found = kernels->approached_triangles(packed.data(), point.data(), rest.data(), rest_point.data(),
                                                           kShare, kLimit, squared.data());
      for (int t = 0; t < Triangles::kWithArea; ++t) {  // without an area the nearest point at rest is not the only one
        const TrianglePoint expected = triangles.nearest(point, t);
        Eigen::Vector3d there = Eigen::Vector3d::Zero();
        for (int c = 0; c < 3; ++c) there += expected.barycentric[c] * at_rest.corner(c).col(t);
        const double limit = kShare * (rest_point - there).squaredNorm();
        if (std::abs(expected.squared_distance - limit) < 1e-6 * limit) continue;
        const bool is_near = expected.squared_distance <= limit;
        EXPECT_EQ((found >> t & 1U) != 0, is_near && squared[static_cast<std::size_t>(t)] <= kLimit)
            << kernels->name << ' ' << trial << ' ' << t;
        ++(is_near ? near : far);
      }
    }
  }
  EXPECT_GT(near, 500);
  EXPECT_GT(far, 500);
}

/// No point of what is left out is near, by the points of a grid.
TEST(TriangleKernels, WhatIsApproachableIsKept) {
  constexpr double kShare = 0.25, kBeyond = 0.01, kLimit = 3;
  constexpr int kGrid = 12;
  int kept = 0, left = 0;
  for (std::uint32_t trial = 0; trial < 400; ++trial) {
    const Moved moved(trial);
    const auto& [triangles, at_rest, packed, rest, point, rest_point] = moved;
    unsigned near = 0;
    for (int t = 0; t < kLanes; ++t)
      for (int i = 0; i <= kGrid; ++i)
        for (int j = 0; i + j <= kGrid; ++j) {
          const auto place = [&](const Triangles& of) -> Eigen::Vector3d {
            return (i * of.corner(0).col(t) + j * of.corner(1).col(t) + (kGrid - i - j) * of.corner(2).col(t)) / kGrid;
          };
          const double squared = (point - place(triangles)).squaredNorm();
          const double limit = kShare * (rest_point - place(at_rest)).squaredNorm() + kBeyond;
          if (squared < (1 - kRounding) * std::min(limit, kLimit)) near |= 1U << t;
        }
    for (const Kernels* kernels : available()) {
      const unsigned found = kernels->approachable_triangles(packed.data(), point.data(), rest.data(),
                                                             rest_point.data(), kShare, kBeyond, kLimit);
      EXPECT_EQ(near & ~found, 0U) << kernels->name << ' ' << trial;
      kept += std::popcount(found);
      left += static_cast<int>(kLanes) - std::popcount(found);
    }
  }
  EXPECT_GT(kept, 500);
  EXPECT_GT(left, 500);
}

/// A triangle and its point that have moved as one rigid body are not approachable.
TEST(TriangleKernels, NothingOfARigidMotionIsApproachable) {
  const Triangles at_rest(7);
  Triangles triangles = at_rest;
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  for (auto& corner : triangles.corners) corner = rotation * corner;
  const AlignedArray packed = triangles.packed(), rest = at_rest.packed();
  // d . d' - share D . D' = (1 - share) D . D' > 0: from so far away all corners are in the same direction.
  const Eigen::Vector3d rest_point = Eigen::Vector3d(4, 5, 6), point = rotation * rest_point;
  for (const Kernels* kernels : available())
    EXPECT_EQ(kernels->approachable_triangles(packed.data(), point.data(), rest.data(), rest_point.data(), 0.25, 0,
                                              std::numeric_limits<double>::infinity()),
              0U)
        << kernels->name;
}

TEST(TriangleKernels, CornersAreGatheredWithABoxAboutThem) {
  constexpr Eigen::Index kPoints = 30;
  for (std::uint32_t trial = 0; trial < 20; ++trial) {
    const Eigen::Matrix3Xd points = test::random_matrix(3, kPoints, trial);
    std::array<int, 3 * kLanes> vertices;
    for (std::size_t i = 0; i < vertices.size(); ++i) vertices[i] = static_cast<int>((7 * i + 11 * trial) % kPoints);
    Eigen::AlignedBox3d expected;
    for (const int vertex : vertices) expected.extend(points.col(vertex));
    for (const Kernels* kernels : available()) {
      AlignedArray corners(9 * kLanes), box(6 * kLanes);
      kernels->gather_triangles(points.data(), vertices.data(), corners.data(), box.data() + trial % kLanes);
      for (int c = 0; c < 3; ++c)
        for (int t = 0; t < kLanes; ++t)
          for (int axis = 0; axis < 3; ++axis)
            EXPECT_EQ(corners[(3 * c + axis) * kLanes + t],
                      points(axis, vertices[static_cast<std::size_t>(c * kLanes + t)]));
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(box[axis * kLanes + trial % kLanes], expected.min()[axis]) << kernels->name;
        EXPECT_EQ(box[(3 + axis) * kLanes + trial % kLanes], expected.max()[axis]) << kernels->name;
      }
    }
  }
}

using Box = Eigen::AlignedBox3d;

Box random_box(double size, std::uint32_t seed) {
  const Eigen::Vector3d centre = test::random_vector(3, seed),
                        half = size * test::random_vector(3, seed + 1).cwiseAbs();
  return {centre - half, centre + half};
}
void set_lane(const Box& box, Eigen::Index leaf, AlignedArray& boxes) {
  for (int axis = 0; axis < 3; ++axis) {
    boxes[(leaf / kLanes * 6 + axis) * kLanes + leaf % kLanes] = box.min()[axis];
    boxes[(leaf / kLanes * 6 + 3 + axis) * kLanes + leaf % kLanes] = box.max()[axis];
  }
}
void set_query(const Box& box, double (&numbers)[6]) {
  for (int axis = 0; axis < 3; ++axis) {
    numbers[axis] = box.min()[axis];
    numbers[3 + axis] = box.max()[axis];
  }
}
/// Largest distance of any two points of either, by their corners: the distance is convex.
double farthest(const Box& a, const Box& b) {
  double most = 0;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j)
      most = std::max(most,
                      (a.corner(static_cast<Box::CornerType>(i)) - b.corner(static_cast<Box::CornerType>(j))).norm());
  return most;
}

TEST(TriangleKernels, LeavesThatAreNotFarAreKept) {
  constexpr Eigen::Index kPanels = 5;
  int kept_in_all = 0, left_in_all = 0, by_each[3] = {};
  for (std::uint32_t trial = 0; trial < 200; ++trial) {
    AlignedArray places(kPanels * 6 * kLanes), velocities(places.size()), rest(places.size());
    const auto box_of = [&](Eigen::Index leaf, std::uint32_t kind) {
      return random_box(0.3, 10000 * trial + 10 * static_cast<std::uint32_t>(leaf) + 3 * kind);
    };
    const bool moves = trial % 2 == 1;
    LeafQuery query;
    const Box own[3] = {box_of(900, 0), box_of(900, 1), box_of(900, 2)};
    set_query(own[0], query.places);
    set_query(own[1], query.velocities);
    set_query(own[2], query.rest);
    query.radius = 1.1;
    query.near = 0.3;
    query.time = 0.4;
    query.share = 0.5;
    query.beyond = trial % 3 == 0 ? 0.1 : 0;
    std::vector<LeafPanel> panels;
    std::vector<unsigned> expected;
    for (Eigen::Index panel = 0; panel < kPanels; ++panel) {
      const unsigned chosen = panel == 2 ? 0xA5 : 0xFF;
      unsigned kept = 0;
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
        const Eigen::Index leaf = panel * kLanes + lane;
        const Box boxes[3] = {box_of(leaf, 0), box_of(leaf, 1), box_of(leaf, 2)};
        set_lane(boxes[0], leaf, places);
        set_lane(boxes[1], leaf, velocities);
        set_lane(boxes[2], leaf, rest);
        const double gap = boxes[0].exteriorDistance(own[0]);
        const bool near[3] = {gap <= query.radius, gap < query.share * farthest(boxes[2], own[2]) + query.beyond,
                              !moves || gap <= query.near + query.time * farthest(boxes[1], own[1])};
        for (int i = 0; i < 3; ++i) by_each[i] += near[i] ? 0 : 1;
        if (near[0] && near[1] && near[2] && (chosen >> lane & 1U) != 0) kept |= 1U << lane;
      }
      panels.push_back({static_cast<int>(panel), chosen});
      expected.push_back(kept);
    }
    for (const Kernels* kernels : available()) {
      std::vector<LeafPanel> kept(panels.size());
      const auto count = kernels->near_leaves({places.data(), moves ? velocities.data() : nullptr, rest.data()}, query,
                                              panels.data(), std::ssize(panels), kept.data());
      std::vector<unsigned> found(panels.size(), 0);
      for (std::ptrdiff_t i = 0; i < count; ++i) {
        EXPECT_NE(kept[static_cast<std::size_t>(i)].lanes, 0U) << kernels->name;
        found[static_cast<std::size_t>(kept[static_cast<std::size_t>(i)].panel)] =
            kept[static_cast<std::size_t>(i)].lanes;
      }
      EXPECT_EQ(found, expected) << kernels->name << ' ' << trial;
      for (const unsigned lanes : found) {
        kept_in_all += std::popcount(lanes);
        left_in_all += static_cast<int>(kLanes) - std::popcount(lanes);
      }
    }
  }
  EXPECT_GT(kept_in_all, 1000);
  EXPECT_GT(left_in_all, 1000);
  for (const int count : by_each) EXPECT_GT(count, 500);
}

}  // namespace triangle_kernels_test
}  // namespace exmat::runtime

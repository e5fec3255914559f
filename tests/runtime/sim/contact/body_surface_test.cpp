#include "runtime/sim/contact/body_surface.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "common/mesh/geometry.h"
#include "runtime/sim/contact/obstacle.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/mesh_distance.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

struct Surface {
  Surface() : bar(test::make_bar({.free = true})), triangles(surface_triangles(mesh().tets)) {
    surface = BodySurface::of_tets(mesh().tets, mesh().vertices, bar.basis(), Eigen::Vector3d::Zero());
  }
  const TetMesh& mesh() const { return bar.model.object->mesh; }
  VertexArray positions(const Eigen::VectorXd& q) const {
    VertexArray moved = mesh().vertices;
    moved.reshaped<Eigen::RowMajor>() += bar.basis() * q;
    return moved;
  }

  test::Bar bar;
  TriangleArray triangles;
  BodySurface surface;
};

TEST(BodySurface, SignedDistanceIsThatOfAllTrianglesAndTheWindingNumber) {
  Surface body;
  SurfaceShape shape = body.surface.make_shape();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  int inside = 0;
  for (int trial = 0; trial < 4; ++trial) {
    Eigen::VectorXd q = Eigen::VectorXd::NullaryExpr(body.bar.modes(), [&] { return unit(random); });
    q *= 0.3 * trial;
    body.surface.place(q, shape);
    const VertexArray x = body.positions(q);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d p = Eigen::Vector3d(0.5, 0.12, 0.12) +
                                Eigen::Vector3d(0.7 * unit(random), 0.3 * unit(random), 0.3 * unit(random));
      const double nearest = test::distance_to_all(x, body.triangles, p);
      const auto hit = body.surface.nearest(p, 10, shape);
      ASSERT_TRUE(hit);
      EXPECT_NEAR(std::abs(hit->distance), nearest, 1e-12);
      EXPECT_EQ(hit->distance<0, test::winding_number(x, body.triangles, p)> 0.5) << p.transpose();
      inside += hit->distance < 0;
      // Its material point is where it says.
      RowMatrix rows(3, q.size());
      body.surface.basis_of(*hit, rows);
      const Eigen::Vector3d point = body.surface.place_of(*hit) + rows * q;
      EXPECT_NEAR((p - point - hit->distance * hit->normal).norm(), 0, 1e-9);
      // Nothing is found nearer than it is.
      EXPECT_FALSE(body.surface.nearest(p, 0.999 * std::abs(hit->distance), shape));
      EXPECT_TRUE(body.surface.may_be_within(p, 1.001 * std::abs(hit->distance), shape));
    }
  }
  EXPECT_GT(inside, 100);
}

TEST(BodySurface, AtRestIsTheBoxThatItIs) {
  Surface body;
  SurfaceShape shape = body.surface.make_shape();
  body.surface.place(Eigen::VectorXd::Zero(body.bar.modes()), shape);
  const Box box{{0.5, 0.125, 0.125}, {0.5, 0.125, 0.125}, Eigen::Matrix3d::Identity()};
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p = box.centre + Eigen::Vector3d(0.8 * unit(random), 0.3 * unit(random), 0.3 * unit(random));
    const SurfacePoint expected = nearest_surface_point(box, p);
    const auto hit = body.surface.nearest(p, 10, shape);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance, expected.distance, 1e-12);
    if (expected.distance > 0.01) {
      EXPECT_NEAR((hit->normal - expected.normal).norm(), 0, 1e-9);
    }
  }
}

TEST(BodySurface, QueriesDoNotAllocate) {
  Surface body;
  SurfaceShape shape = body.surface.make_shape();
  const Eigen::VectorXd q = 0.2 * Eigen::VectorXd::Ones(body.bar.modes());
  const test::AllocationCounter counter;
  body.surface.place(q, shape);
  body.surface.nearest({0.5, 0.3, 0.1}, 1, shape);
  body.surface.may_be_within({0.5, 0.3, 0.1}, 1, shape);
  EXPECT_EQ(counter.count(), 0);
}

// The triangles about a vertex are at no distance from it but for rounding, at rest as deformed.
TEST(BodySurface, AVertexDoesNotApproachItsOwnTriangles) {
  Surface body;
  SurfaceShape shape = body.surface.make_shape();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(body.bar.modes());
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::VectorXd q = 0.02 * test::random_vector(body.bar.modes(), 11 + static_cast<std::uint32_t>(trial));
    for (Eigen::Index v = 0; v < body.mesh().vertices.rows(); ++v) {
      const Eigen::Vector3d at_rest = body.mesh().vertices.row(v);
      body.surface.place(rest, shape);
      const auto place = body.surface.nearest(at_rest, 1e-9, shape);
      if (!place) continue;  // within
      body.surface.place(q, shape);
      // As a vertex comes by another way of summing up than the surface's own.
      const Eigen::Vector3d point = at_rest + body.bar.basis().middleRows<3>(3 * v) * q;
      EXPECT_FALSE(body.surface.nearest_approached(point, at_rest, *place, 1e-6, shape)) << v;
    }
  }
}

TEST(BodySurface, NothingApproachesItselfWithinTheBounds) {
  const test::Bar bar = test::make_bar({.cells = {6, 2, 3}, .lengths = {0.6, 0.2, 0.3}, .slot_start = 2});
  const TetMesh& mesh = bar.model.object->mesh;
  const BodySurface surface = BodySurface::of_tets(mesh.tets, mesh.vertices, bar.basis(), Eigen::Vector3d::Zero());
  const TriangleArray triangles = surface_triangles(mesh.tets);
  const RowMatrix bounds_of = surface.approach_bounds(mesh.vertices, bar.basis());
  const Eigen::VectorXd bounds = bounds_of.colwise().maxCoeff();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  SurfaceShape shape = surface.make_shape();
  double nearest_to_bound = 1;
  // Smallest ratio of distances to those at rest, of vertices [first, last) to points of triangles.
  const auto smallest_ratio = [&](const Eigen::VectorXd& q, Eigen::Index first, Eigen::Index last) {
    VertexArray x = mesh.vertices;
    x.reshaped<Eigen::RowMajor>() += bar.basis() * q;
    double smallest = 1;
    for (Eigen::Index v = first; v < last; ++v)
      for (Eigen::Index t = 0; t < triangles.rows(); ++t)
        for (int a = 0; a <= 4; ++a)
          for (int b = 0; a + b <= 4; ++b) {
            const Eigen::Vector3d weights(a / 4.0, b / 4.0, (4 - a - b) / 4.0);
            Eigen::RowVector3d there = Eigen::RowVector3d::Zero(), at_rest = Eigen::RowVector3d::Zero();
            for (int c = 0; c < 3; ++c) {
              there += weights[c] * x.row(triangles(t, c));
              at_rest += weights[c] * mesh.vertices.row(triangles(t, c));
            }
            const double rest = (mesh.vertices.row(v) - at_rest).norm();
            if (rest > 1e-12) smallest = std::min(smallest, (x.row(v) - there).norm() / rest);
          }
    return smallest;
  };
  for (int trial = 0; trial < 8; ++trial) {
    // One mode alone uses its bound up; mixtures stay below.
    Eigen::VectorXd q = trial < 4
                            ? Eigen::VectorXd(Eigen::VectorXd::Unit(bar.modes(), trial))
                            : Eigen::VectorXd(Eigen::VectorXd::NullaryExpr(bar.modes(), [&] { return unit(random); }));
    q *= 0.999 / bounds.dot(q.cwiseAbs());
    for (const double sign : {-1.0, 1.0}) {
      const double ratio = smallest_ratio(sign * q, 0, mesh.vertices.rows());
      EXPECT_GE(ratio, 0.5);
      nearest_to_bound = std::min(nearest_to_bound, ratio);
      surface.place(sign * q, shape);
      for (Eigen::Index v = 0; v < mesh.vertices.rows(); v += 7) {
        const Eigen::Vector3d point = mesh.vertices.row(v).transpose() + bar.basis().middleRows<3>(3 * v) * sign * q;
        EXPECT_FALSE(surface.nearest_approached(point, mesh.vertices.row(v), SurfaceHit(), 1, shape));
      }
    }
  }
  EXPECT_LT(nearest_to_bound, 0.75);  // not idle
  // Each vertex has bounds of its own, beyond those of all.
  double farthest = 0;
  for (Eigen::Index v = 0; v < mesh.vertices.rows(); v += 5) {
    Eigen::VectorXd q = Eigen::VectorXd::NullaryExpr(bar.modes(), [&] { return unit(random); });
    q *= 0.999 / bounds_of.row(v).dot(q.cwiseAbs());
    farthest = std::max(farthest, bounds.dot(q.cwiseAbs()));
    EXPECT_GE(smallest_ratio(q, v, v + 1), 0.5) << v;
    surface.place(q, shape);
    const Eigen::Vector3d point = mesh.vertices.row(v).transpose() + bar.basis().middleRows<3>(3 * v) * q;
    EXPECT_FALSE(surface.nearest_approached(point, mesh.vertices.row(v), SurfaceHit(), 1, shape)) << v;
  }
  EXPECT_GT(farthest, 1.2);
}

// Parts of a body that come near to a vertex of it, by the definition: of all triangles.
TEST(BodySurface, WhatApproachesIsTheNearestOfAllTrianglesThatDo) {
  const test::Bar bar = test::make_bar({.cells = {6, 2, 3}, .lengths = {0.6, 0.2, 0.3}, .slot_start = 2});
  const TetMesh& mesh = bar.model.object->mesh;
  const BodySurface surface = BodySurface::of_tets(mesh.tets, mesh.vertices, bar.basis(), Eigen::Vector3d::Zero());
  const TriangleArray triangles = surface_triangles(mesh.tets);
  SurfaceShape shape = surface.make_shape();
  constexpr double kRadius = 0.15;  // [m]
  int found = 0, far = 0;
  for (std::uint32_t trial = 0; trial < 40; ++trial) {
    const Eigen::VectorXd q = 0.4 * test::random_vector(bar.modes(), 2 * trial),
                          v = 0.5 * test::random_vector(bar.modes(), 2 * trial + 1);
    VertexArray x = mesh.vertices, velocities = VertexArray::Zero(x.rows(), 3);
    x.reshaped<Eigen::RowMajor>() += bar.basis() * q;
    velocities.reshaped<Eigen::RowMajor>() += bar.basis() * v;
    for (Eigen::Index own = 0; own < x.rows(); ++own) {
      const Eigen::Vector3d point = x.row(own), rest = mesh.vertices.row(own);
      surface.place(Eigen::VectorXd::Zero(bar.modes()), shape);
      const auto place = surface.nearest(rest, 1e-9, shape);
      if (!place) continue;  // within
      surface.place(q, v, shape);
      const Eigen::Vector3d facing = surface.normal_of(*place, shape);
      const ClosingPoint closing{velocities.row(own), 0.01, 0.03};
      EXPECT_LE((surface.velocity_of(*place, shape) - closing.velocity).norm(), 1e-12 * v.norm());
      // With and without what velocities exclude.
      std::array<double, 2> nearest{kRadius, kRadius};
      for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
        if ((triangles.row(t).array() == static_cast<int>(own)).any()) continue;
        const auto corner = [&](int c) -> Eigen::Vector3d { return x.row(triangles(t, c)); };
        const TrianglePoint here = nearest_on_triangle(point, corner(0), corner(1), corner(2));
        Eigen::Vector3d at_rest = Eigen::Vector3d::Zero();
        double fastest = 0;
        for (int c = 0; c < 3; ++c) {
          at_rest += here.barycentric[c] * mesh.vertices.row(triangles(t, c)).transpose();
          fastest = std::max(fastest, (velocities.row(own) - velocities.row(triangles(t, c))).norm());
        }
        const double distance = std::sqrt(here.squared_distance);
        const Eigen::Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
        if (distance >= 0.5 * (rest - at_rest).norm() || normal.dot(facing) > 0.5) continue;
        nearest[0] = std::min(nearest[0], distance);
        if (distance <= closing.near + closing.time * fastest) nearest[1] = std::min(nearest[1], distance);
      }
      for (const bool closes : {false, true}) {
        const auto hit = surface.nearest_approached(point, rest, *place, kRadius, shape, closes ? &closing : nullptr);
        const double expected = nearest[closes];
        ASSERT_EQ(hit.has_value(), expected < kRadius) << own << " of " << trial;
        if (hit) {
          EXPECT_NEAR(std::abs(hit->distance), expected, 1e-12);
        }
      }
      found += nearest[1] < kRadius;
      far += nearest[0] < nearest[1];
    }
  }
  EXPECT_GT(found, 100);
  EXPECT_GT(far, 100);
}

}  // namespace
}  // namespace exmat::runtime

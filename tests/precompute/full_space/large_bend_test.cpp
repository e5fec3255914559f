// Smoothed elements far from rest: a slender bar beside the elastica, a block beside a finer one.

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>

#include "common/mesh/geometry.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/modes/mesh_stiffness.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace large_bend_test {

constexpr double kYoung = 1e6;

struct Solid {
  TetMesh mesh;
  TetMaterials materials;
  FlagVector fixed;
};

Solid solid(const TetMesh& mesh, MaterialModel model, double poisson_ratio, Formulation formulation, int clamped_axis) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  return {mesh,
          {1000 * ones, kYoung * ones, poisson_ratio * ones, model, formulation, kVarianceFactor},
          (mesh.vertices.col(clamped_axis).array() < 1e-9).cast<std::uint8_t>()};
}

// Newton's method with a load [3n] of dead forces applied in steps. Mean displacement of the loaded vertices.
Eigen::Vector3d displacement(const Solid& body, const Eigen::VectorXd& load) {
  const ElasticSystem system = build_elastic_system(body.mesh, body.materials, body.fixed);
  const MeshElasticity elasticity(body.mesh, body.materials, system.free_dofs);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(elasticity.size()), force;
  LowerTriangle stiffness;
  constexpr int kSteps = 20;
  for (int step = 1; step <= kSteps; ++step) {
    const Eigen::VectorXd outer = system.restrict(load) * step / kSteps;
    for (int iteration = 0;; ++iteration) {
      elasticity.force_and_stiffness(u, runtime::Tangent::kExact, force, stiffness);
      if ((force - outer).norm() <= 1e-8 * outer.norm()) break;
      if (iteration == 100) {
        ADD_FAILURE() << "no equilibrium at step " << step;
        return Eigen::Vector3d::Zero();
      }
      const Eigen::SimplicialLDLT<LowerTriangle> factors(stiffness);
      Eigen::VectorXd step = factors.solve(outer - force);
      if (!(step.dot(outer - force) > 0)) {
        elasticity.force_and_stiffness(u, runtime::Tangent::kPositiveSemidefinite, force, stiffness);
        step = Eigen::SimplicialLDLT<LowerTriangle>(stiffness).solve(outer - force);
      }
      const double start = elasticity.energy(u) - outer.dot(u), rounding = 1e-12 * (std::abs(start) + outer.norm());
      double length = 1;
      while (length > 1e-3 &&
             !(elasticity.energy(u + length * step) - outer.dot(u + length * step) <= start + rounding))
        length /= 2;
      u += length * step;
    }
  }
  const Eigen::VectorXd all = system.extend(u);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (Eigen::Index v = 0; v < body.mesh.vertex_count(); ++v)
    if (!load.segment<3>(3 * v).isZero(0)) {
      sum += all.segment<3>(3 * v);
      ++count;
    }
  return sum / count;
}

// A traction on the face at the end of an axis, of this sum.
Eigen::VectorXd load_on_end(const TetMesh& mesh, int axis, const Eigen::Vector3d& total) {
  const double end = mesh.vertices.col(axis).maxCoeff() - 1e-9;
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(mesh.vertex_count());
  const TriangleArray surface = surface_triangles(mesh.tets);
  for (const auto& triangle : surface.rowwise()) {
    const Eigen::Vector3d a = mesh.vertices.row(triangle[0]), b = mesh.vertices.row(triangle[1]),
                          c = mesh.vertices.row(triangle[2]);
    if (std::min({a[axis], b[axis], c[axis]}) < end) continue;
    for (const auto vertex : triangle) areas[vertex] += (b - a).cross(c - a).norm() / 6;
  }
  Eigen::VectorXd load(3 * mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) load.segment<3>(3 * v) = total * areas[v] / areas.sum();
  return load;
}

// End of an inextensible beam of length 1 that a force bends, P L^2 / (E I) = load: theta'' = -load cos theta,
// theta(0) = 0, theta'(1) = 0, by shooting.
std::array<double, 2> elastica(double load) {
  std::array<double, 2> end{};
  const auto shoot = [&](double curvature) {
    constexpr int kSteps = 2000;
    constexpr double h = 1.0 / kSteps;
    double angle = 0;
    end = {0, 0};
    for (int i = 0; i < kSteps; ++i) {  // midpoint rule
      const double middle = angle + 0.5 * h * curvature;
      const double bent = curvature - 0.5 * h * load * std::cos(angle);
      curvature -= h * load * std::cos(middle);
      angle += h * bent;
      end[0] += h * std::cos(middle);
      end[1] += h * std::sin(middle);
    }
    return curvature;
  };
  double low = 0, high = load;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (shoot(middle) > 0 ? high : low) = middle;
  }
  return end;
}

// 20 times as long as it is thick and two tets across: 960 tets. Tables of the elastica (Mattiasson 1981) have
// (1 - 0.38763, 0.71379) for a load of 5.
TEST(LargeBend, IsThatOfTheElastica) {
  constexpr double kLength = 8, kWidth = 0.4, kLoad = 5;
  const std::array<double, 2> expected = elastica(kLoad);
  EXPECT_NEAR(expected[0], 1 - 0.38763, 1e-5);
  EXPECT_NEAR(expected[1], 0.71379, 1e-5);
  const TetMesh mesh = test::box_mesh({40, 2, 2}, {kLength, kWidth, kWidth});
  const double bending = kYoung * std::pow(kWidth, 4) / 12;
  const Eigen::VectorXd load = load_on_end(mesh, 0, {0, 0, kLoad * bending / (kLength * kLength)});
  for (const MaterialModel model :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean, MaterialModel::kCorotational}) {
    Solid body = solid(mesh, model, 0.3, Formulation::kSmoothed, 0);
    body.materials.variance_factor = mesh_stiffness(mesh, body.materials, body.fixed, "bar")->variance_factor;
    const Eigen::Vector3d found = displacement(body, load) / kLength;
    EXPECT_NEAR(found[2], expected[1], 0.03 * expected[1]) << name_of(model);
    EXPECT_NEAR(-found[0], 1 - expected[0], 0.06 * (1 - expected[0])) << name_of(model);
  }
  const Eigen::Vector3d linear =
      displacement(solid(mesh, MaterialModel::kStVenantKirchhoff, 0.3, Formulation::kLinear, 0), load) / kLength;
  EXPECT_LT(linear[2], 0.85 * expected[1]) << "tets of constant strain are too stiff";
}

// A block that is clamped below is pulled and pressed far. Beside it eight times as many elements.
TEST(LargeStrain, IsThatOfAFinerMesh) {
  for (const double pressure : {0.6e6, -0.6e6}) {
    std::array<double, 2> heights{};
    for (const int cells : {3, 6}) {
      const TetMesh mesh = test::cube_grid(cells, 1.0 / cells);
      heights[cells == 3 ? 0 : 1] =
          1 + displacement(solid(mesh, MaterialModel::kStableNeoHookean, 0.45, Formulation::kSmoothed, 2),
                           load_on_end(mesh, 2, {0, 0, pressure}))[2];
    }
    EXPECT_GT(std::abs(heights[1] - 1), 0.3);
    EXPECT_NEAR(heights[0] - 1, heights[1] - 1, 0.05 * std::abs(heights[1] - 1)) << pressure;
  }
}

}  // namespace large_bend_test
}  // namespace exmat::precompute

#include "precompute/fem/elastic_system.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/fem/rigid_moments.h"
#include "precompute/modes/linear_modes.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

TetMaterials uniform(const TetMesh& mesh, double density, double youngs_modulus, double poisson_ratio) {
  const Eigen::Index n = mesh.tet_count();
  return {Eigen::VectorXd::Constant(n, density), Eigen::VectorXd::Constant(n, youngs_modulus),
          Eigen::VectorXd::Constant(n, poisson_ratio)};
}

FlagVector clamp_x0(const TetMesh& mesh) {
  FlagVector fixed = FlagVector::Zero(mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) fixed[v] = mesh.vertices(v, 0) < 1e-9 ? 1 : 0;
  return fixed;
}

LinearModes modes_of(const ElasticSystem& system, int count) {
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "test");
  return linear_modes(system, solver, count);
}

// Root in (low, high) of a function that changes sign there.
template <typename Function>
double bisect(const Function& f, double low, double high) {
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    ((f(low) < 0) == (f(middle) < 0) ? low : high) = middle;
  }
  return low;
}

// First natural frequency [rad/s] of a Timoshenko cantilever. Huang 1961, equation 38 (clamped-free).
double timoshenko_frequency(double L, double E, double G, double rho, double A, double I, double shear_factor) {
  const double r2 = I / (A * L * L), s2 = E * I / (shear_factor * A * G * L * L);
  const auto characteristic = [&](double b) {
    const double root = std::sqrt((r2 - s2) * (r2 - s2) + 4 / (b * b));
    const double alpha = std::sqrt(0.5 * (-(r2 + s2) + root)), beta = std::sqrt(0.5 * (r2 + s2 + root));
    return 2 + (b * b * (r2 - s2) * (r2 - s2) + 2) * std::cosh(b * alpha) * std::cos(b * beta) -
           b * (r2 + s2) / std::sqrt(1 - b * b * r2 * s2) * std::sinh(b * alpha) * std::sin(b * beta);
  };
  // Below Euler-Bernoulli's 3.516, where the function changes sign once.
  const double b = bisect(characteristic, 1.0, 3.6);
  return b * std::sqrt(E * I / (rho * A)) / (L * L);
}

// Two bars in series, stretched by a traction: nothing narrows with a Poisson ratio of 0, each stretches by F l / (E
// A).
TEST(ElasticSystem, BarOfTwoMaterialsStretchesAsTheSumOfItsParts) {
  const auto mesh = test::box_mesh({5, 2, 2}, {1.0, 0.3, 0.2});
  TetMaterials materials = uniform(mesh, 1000, 2e5, 0.0);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    if (tet_positions(mesh, t).col(0).mean() > 0.6) materials.youngs_modulus[t] = 7e5;
  const auto system = build_elastic_system(mesh, materials, clamp_x0(mesh));
  Eigen::VectorXd load = Eigen::VectorXd::Zero(system.full_mass.rows());
  const double traction = 100;
  const TriangleArray surface = surface_triangles(mesh.tets);
  for (Eigen::Index f = 0; f < surface.rows(); ++f) {
    const Eigen::RowVector3i triangle = surface.row(f);
    const bool at_end = (mesh.vertices(triangle, 0).array() > 1 - 1e-9).all();
    if (at_end)
      for (const int vertex : triangle) load[3 * vertex] += traction * (0.3 * 0.2 / 8) / 3;
  }
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, "test");
  const Eigen::VectorXd u = system.extend(solver.solve(system.restrict(load)));
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
    const double x = mesh.vertices(v, 0);
    const double expected = traction * (std::min(x, 0.6) / 2e5 + std::max(x - 0.6, 0.0) / 7e5);
    EXPECT_NEAR(u[3 * v], expected, 1e-12) << x;
    EXPECT_NEAR(u[3 * v + 1], 0, 1e-15);
  }
}

TEST(ElasticSystem, FreeBodyHasExactlySixRigidModes) {
  const auto mesh = test::box_mesh({4, 3, 2}, {1.0, 0.7, 0.4});
  const auto system = build_elastic_system(mesh, uniform(mesh, 900, 1e5, 0.4), FlagVector::Zero(mesh.vertex_count()));
  const Eigen::MatrixXd K = system.stiffness, M = system.mass;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> dense(K, M, Eigen::EigenvaluesOnly);
  const Eigen::VectorXd& all = dense.eigenvalues();
  EXPECT_EQ((all.array() < 1e-9 * all[6]).count(), 6);
  EXPECT_GT(all[6], 1e-3 * all[7]);
  const auto modes = modes_of(system, 10);
  EXPECT_LE(((modes.eigenvalues - all.segment(6, 10)).array() / all.segment(6, 10).array()).abs().maxCoeff(), 1e-9);
  EXPECT_LE((system.null_space.transpose() * (M * modes.modes)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LE((K * system.null_space).norm(), 1e-12 * K.norm() * system.null_space.norm());
}

TEST(ElasticSystem, BendingFrequencyTendsToTimoshenko) {
  // Poisson ratio 0: the clamp does not hinder the section, as in the beam theory; shear factor 5/6.
  const double L = 1, height = 0.2, width = 0.3, E = 1e6, rho = 1000;
  const double exact =
      timoshenko_frequency(L, E, E / 2, rho, width * height, width * std::pow(height, 3) / 12, 5.0 / 6);
  const auto frequency = [&](int n) {
    const auto mesh = test::box_mesh({10 * n, 3 * n, 2 * n}, {L, width, height});
    return std::sqrt(
        modes_of(build_elastic_system(mesh, uniform(mesh, rho, E, 0.0), clamp_x0(mesh)), 1).eigenvalues[0]);
  };
  const double coarse = frequency(2), fine = frequency(4);
  EXPECT_GT(coarse, fine);
  EXPECT_GT(fine, exact);
  // Second order: the error falls to a quarter, and the extrapolated value is that of the beam theory, itself good to
  // half a percent.
  EXPECT_NEAR((coarse - exact) / (fine - exact), 4.0, 0.6);
  EXPECT_NEAR((4 * fine - coarse) / (3 * exact), 1.0, 0.005);
}

TEST(ElasticSystem, UniaxialStretchHasTheRightEnergy) {
  const auto mesh = test::box_mesh({3, 2, 2}, {1.5, 1.0, 0.8});
  const double E = 3e4, nu = 0.3, strain = 1e-3;
  const auto K = elastic_stiffness(mesh, uniform(mesh, 1, E, nu));
  Eigen::VectorXd u = Eigen::VectorXd::Zero(3 * mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    u.segment<3>(3 * v) =
        strain * Eigen::Vector3d(mesh.vertices(v, 0), -nu * mesh.vertices(v, 1), -nu * mesh.vertices(v, 2));
  EXPECT_NEAR(0.5 * u.dot(K * u) / (0.5 * E * strain * strain * 1.2), 1.0, 1e-12);
}

// 40 m long, 5 mm thick, clamped at its narrow end.
TEST(ElasticSystem, ClampMayBeSmallBesideTheBody) {
  const TetMesh tape = test::box_mesh({160, 4, 1}, {40, 1, 0.005});
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(tape.tet_count());
  const FlagVector end = (tape.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  EXPECT_TRUE(build_elastic_system(tape, {1000 * ones, 1e6 * ones, 0.3 * ones}, end).constrained());
}

TEST(ElasticSystem, ClampOnALineIsRefused) {
  const auto mesh = test::box_mesh({3, 2, 2}, {1, 1, 1});
  FlagVector fixed = FlagVector::Zero(mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    fixed[v] = mesh.vertices(v, 0) < 1e-9 && mesh.vertices(v, 1) < 1e-9 ? 1 : 0;
  try {
    build_elastic_system(mesh, uniform(mesh, 1, 1, 0.3), fixed);
    FAIL() << "a hinge passed as a clamp";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("3 that leave the body free to move rigidly"), std::string::npos)
        << error.what();
  }
}

TEST(SemidefiniteSolver, HingedBodiesAreRefused) {
  // Two tets that share one edge can turn about it.
  TetMesh mesh;
  mesh.vertices.resize(6, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0.5, 1, 0, -1, 0.1, 0.2, -0.5, -1;
  mesh.tets.resize(2, 4);
  mesh.tets << 0, 1, 2, 3, 0, 1, 5, 4;
  const auto system = build_elastic_system(mesh, uniform(mesh, 1, 1, 0.3), FlagVector::Zero(6));
  EXPECT_THROW(SemidefiniteSolver(system.stiffness, system.mass * system.null_space, "hinge"), WorkError);
}

TEST(SemidefiniteSolver, SolvesInTheComplementOfTheRigidModes) {
  const auto mesh = test::box_mesh({4, 2, 2}, {1.0, 0.5, 0.4});
  const auto system = build_elastic_system(mesh, uniform(mesh, 700, 2e5, 0.35), FlagVector::Zero(mesh.vertex_count()));
  const Eigen::MatrixXd MR = system.mass * system.null_space;
  const SemidefiniteSolver solver(system.stiffness, MR, "test");
  const Eigen::MatrixXd b = Eigen::MatrixXd::Random(system.mass.rows(), 3);
  const Eigen::MatrixXd x = solver.solve(b);
  const Eigen::MatrixXd projected = b - MR * (system.null_space.transpose() * b);
  EXPECT_LE((system.stiffness * x - projected).norm(), 1e-11 * projected.norm());
  EXPECT_LE((MR.transpose() * x).norm(), 1e-11 * MR.norm() * x.norm());
}

// Kinetic energy and moments of the deformed body, by the consistent mass of its vertices.
TEST(RigidMoments, AgreeWithSumsOverTheVertices) {
  const auto mesh = test::box_mesh({3, 2, 2}, {1.0, 0.5, 0.4});
  Eigen::VectorXd density(mesh.tet_count());
  for (Eigen::Index t = 0; t < density.size(); ++t) density[t] = 500 + 10 * static_cast<double>(t);
  const RowMatrix U = RowMatrix::Random(3 * mesh.vertex_count(), 4) * 0.1;
  const auto rigid = rigid_moments(mesh, density, U);
  const Eigen::VectorXd q = Eigen::VectorXd::Random(4);
  const VertexArray y = (mesh.vertices.rowwise() - rigid.centre_of_mass.transpose()) +
                        VertexArray((U * q).reshaped<Eigen::RowMajor>(mesh.vertex_count(), 3));
  const Eigen::Matrix3d P = y.transpose() * (scalar_mass(mesh, density) * y);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const double quadratic = q.dot(rigid.basis_moments.middleRows((3 * a + b) * 4, 4) * q);
      const double value = rigid.second_moments(a, b) + rigid.linear_moments.row(3 * a + b).dot(q) + quadratic;
      EXPECT_NEAR(value, P(a, b), 1e-12 * P.norm());
    }
  // sum m (X x u), X - y = -u: the part of the angular momentum of the velocity u that is not of second order.
  const VertexArray X = mesh.vertices.rowwise() - rigid.centre_of_mass.transpose();
  const Eigen::Matrix3d moments = X.transpose() * (scalar_mass(mesh, density) * VertexArray(y - X));
  const Eigen::Vector3d spin_load(moments(1, 2) - moments(2, 1), moments(2, 0) - moments(0, 2),
                                  moments(0, 1) - moments(1, 0));
  EXPECT_LE((rigid.spin_load * q - spin_load).norm(), 1e-12 * moments.norm());
  const Eigen::Matrix3d inertia = rigid.second_moments.trace() * Eigen::Matrix3d::Identity() - rigid.second_moments;
  EXPECT_LE((rigid.inertia - inertia).norm(), 1e-12 * inertia.norm());
}

}  // namespace
}  // namespace exmat::precompute

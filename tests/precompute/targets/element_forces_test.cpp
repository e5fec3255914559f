#include "precompute/targets/element_forces.h"

#include <Eigen/LU>
#include <gtest/gtest.h>
#include <omp.h>

#include "precompute/full_space/mesh_elasticity.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

// Against energies as the definitions have them, of a mesh of several parts.

namespace exmat::precompute {
namespace element_forces_test {

constexpr Eigen::Index kCoordinates = 5;
constexpr int kSums = 11;  // no multiple of the lanes of a register

struct Case {
  EnergyReference reference = EnergyReference::kExample;
  MaterialModel material = MaterialModel::kStVenantKirchhoff;
};

void PrintTo(const Case& c, std::ostream* out) { *out << name_of(c.reference) << " " << name_of(c.material); }

class ElementForcesOf : public ::testing::TestWithParam<Case> {
 protected:
  ElementForcesOf() {
    object_.mesh = test::box_mesh({9, 7, 6}, {1.0, 0.8, 0.6});
    const Eigen::Index tets = object_.mesh.tet_count();
    const Eigen::ArrayXd uneven = 1 + 0.5 * test::random_vector(tets, 7).array();
    object_.materials = {Eigen::VectorXd::Ones(tets), 1e4 * uneven, Eigen::VectorXd::Constant(tets, 0.3),
                         GetParam().material};
    object_.fixed = (object_.mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
    system_ = build_elastic_system(object_.mesh, object_.materials, object_.fixed);
    // Waves of a tenth of the box.
    const Eigen::Index rows = system_.mass.rows();
    coordinates_.basis.resize(rows, kCoordinates);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const auto dof = system_.free_dofs[static_cast<std::size_t>(i)];
      const Eigen::RowVector3d x = object_.mesh.vertices.row(dof / 3);
      for (Eigen::Index c = 0; c < kCoordinates; ++c)
        coordinates_.basis(i, c) = 0.1 * x[0] * std::sin(x.sum() * (1 + static_cast<double>(c)) + dof % 3);
    }
    coordinates_.poses.resize(kCoordinates, 3);
    coordinates_.poses << Eigen::VectorXd::Zero(kCoordinates), 0.5 * test::random_matrix(kCoordinates, 2, 3);
  }

  /// sum_k w_k E_k.
  double energy(const Eigen::VectorXd& w, const Eigen::VectorXd& p) const {
    const auto places = [&](const Eigen::VectorXd& at) -> VertexArray {
      const Eigen::VectorXd u = system_.extend(coordinates_.basis * at);
      return object_.mesh.vertices + VertexArray(u.reshaped<Eigen::RowMajor>(u.size() / 3, 3));
    };
    const auto edges = [&](const VertexArray& x, Eigen::Index t) {
      Eigen::Matrix3d D;
      for (int c = 0; c < 3; ++c)
        D.col(c) = (x.row(object_.mesh.tets(t, c + 1)) - x.row(object_.mesh.tets(t, 0))).transpose();
      return D;
    };
    const VertexArray x = places(p);
    double sum = 0;
    for (Eigen::Index k = 0; k < w.size(); ++k) {
      const VertexArray from = places(coordinates_.poses.col(k));
      for (Eigen::Index t = 0; t < object_.mesh.tet_count(); ++t) {
        const Eigen::Matrix3d rest = edges(object_.mesh.vertices, t), example = edges(from, t), now = edges(x, t);
        const bool is_rest = GetParam().reference == EnergyReference::kRest;
        const Eigen::Matrix3d F = is_rest
                                      ? Eigen::Matrix3d(Eigen::Matrix3d::Identity() + (now - example) * rest.inverse())
                                      : Eigen::Matrix3d(now * example.inverse());
        sum += w[k] * (is_rest ? rest : example).determinant() / 6 *
               test::energy_density(GetParam().material, F, object_.materials.youngs_modulus[t],
                                    object_.materials.poisson_ratio[t]);
      }
    }
    return sum;
  }

  /// By central differences along random directions.
  template <typename Energy>
  static void expect_derivatives(const ElementForces& forces, const RowMatrix& weights, const Energy& energy) {
    constexpr double kStep = 1e-5;
    const Eigen::MatrixXd p = 0.3 * test::random_matrix(kCoordinates, kSums, 9), found = forces.forces(weights, p);
    for (int n = 0; n < kSums; ++n) {
      const Eigen::VectorXd direction = test::random_vector(kCoordinates, 20U + static_cast<unsigned>(n)),
                            w = weights.row(n).transpose();
      const double difference = energy(w, p.col(n) + kStep * direction) - energy(w, p.col(n) - kStep * direction);
      EXPECT_NEAR(found.col(n).dot(direction), difference / (2 * kStep), 1e-6 * found.col(n).norm()) << n;
    }
  }

  ObjectData object_;
  ElasticSystem system_;
  PoseCoordinates coordinates_;
};

INSTANTIATE_TEST_SUITE_P(Cases, ElementForcesOf,
                         ::testing::Values(Case{}, Case{EnergyReference::kRest},
                                           Case{EnergyReference::kExample, MaterialModel::kStableNeoHookean},
                                           Case{EnergyReference::kRest, MaterialModel::kCorotational}));

// Weights of zero are among them, alone and in all of a group.
TEST_P(ElementForcesOf, AreTheDerivativesOfTheEnergies) {
  const ElementForces forces(object_, system_, coordinates_, GetParam().reference);
  ASSERT_EQ(std::ssize(forces.members()), object_.mesh.tet_count());
  RowMatrix weights = test::random_matrix(kSums, 3, 5).cwiseAbs();
  weights.bottomRows(3).col(1).setZero();
  weights(0, 2) = 0;
  expect_derivatives(forces, weights, [&](const Eigen::VectorXd& w, const Eigen::VectorXd& p) { return energy(w, p); });
}

// Forces of rings, against the elasticity of the mesh.
TEST_P(ElementForcesOf, OfRingsAreTheDerivativesOfTheEnergies) {
  object_.materials.youngs_modulus.setConstant(1e4);
  object_.materials.formulation = Formulation::kSmoothed;
  object_.materials.variance_factor = 0.2;
  const ElementForces forces(object_, system_, coordinates_, GetParam().reference);
  ASSERT_EQ(std::ssize(forces.members()), object_.mesh.vertex_count());
  MeshElasticity elasticity(object_.mesh, object_.materials, system_.free_dofs);
  const RowMatrix weights = test::random_matrix(kSums, 3, 5).cwiseAbs();
  const auto energy = [&](const Eigen::VectorXd& w, const Eigen::VectorXd& at) {
    double sum = 0;
    for (Eigen::Index k = 0; k < w.size(); ++k) {
      const Eigen::VectorXd example = coordinates_.basis * coordinates_.poses.col(k), u = system_.extend(example);
      const bool is_rest = GetParam().reference == EnergyReference::kRest;
      const VertexArray from =
          object_.mesh.vertices + (is_rest ? 0 : 1) * VertexArray(u.reshaped<Eigen::RowMajor>(u.size() / 3, 3));
      EXPECT_EQ(elasticity.set_undeformed(from), 0);
      sum += w[k] * elasticity.energy(coordinates_.basis * at - example);
    }
    return sum;
  };
  expect_derivatives(forces, weights, energy);
}

// Rotations are iterated until all lanes of a register have theirs, so that others make a difference of rounding.
TEST_P(ElementForcesOf, AreTheSameForEveryNumberOfThreadsAndBesideOthers) {
  const ElementForces forces(object_, system_, coordinates_, GetParam().reference);
  const RowMatrix weights = test::random_matrix(kSums, 3, 5).cwiseAbs();
  const Eigen::MatrixXd p = 0.3 * test::random_matrix(kCoordinates, kSums, 9);
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const Eigen::MatrixXd one = forces.forces(weights, p);
  omp_set_num_threads(3);
  const Eigen::MatrixXd three = forces.forces(weights, p);
  omp_set_num_threads(threads);
  EXPECT_EQ(one, three);
  for (int n = 0; n < kSums; ++n)
    EXPECT_LE((forces.forces(weights.row(n), p.col(n)) - one.col(n)).norm(), 1e-13 * one.col(n).norm());
}

// From the minimum of a few tets: no force is left, and that of the others matters.
TEST_P(ElementForcesOf, VanishWhereTheDescentsEnd) {
  const MeshTarget target = sampled_target(object_, system_, coordinates_, GetParam().reference, 40);
  RowMatrix weights = test::random_matrix(kSums, 3, 6).cwiseAbs();
  for (auto row : weights.rowwise()) row /= row.sum();
  Eigen::MatrixXd y(target.solver.dimension(), kSums);
  auto workspace = target.solver.make_workspace();
  double scale = 0;
  for (int k = 0; k < 3; ++k) scale = std::max(scale, target.solver.example(k).norm());
  for (int n = 0; n < kSums; ++n) {
    Eigen::VectorXd own(y.rows());
    target.solver.start(weights.row(n).transpose(), own);
    target.solver.solve(weights.row(n).transpose(), workspace, own);
    y.col(n) = own;
  }
  const RowMatrix& Z = target.solver.basis();
  const Eigen::MatrixXd before = Z.transpose() * target.all->forces(weights, Z * y);
  for (const ElementForces::Answer& answer : target.all->polish(target.solver, weights, y))
    EXPECT_TRUE(answer.converged) << answer.residual;
  const Eigen::MatrixXd after = Z.transpose() * target.all->forces(weights, Z * y);
  EXPECT_LE(after.colwise().norm().maxCoeff(), 1e-8 * scale);
  EXPECT_GE(before.colwise().norm().maxCoeff(), 1e-4 * scale);
}

}  // namespace element_forces_test
}  // namespace exmat::precompute

#include "precompute/full_space/mesh_elasticity.h"

#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"
#include "precompute/full_space/fitted_frame.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

struct Kind {
  MaterialModel material;
  Formulation formulation = Formulation::kLinear;
};

class MeshElasticityTest : public testing::TestWithParam<Kind> {
 protected:
  static test::Bar make() {
    test::Bar bar = test::make_bar({.cells = {2, 2, 1}, .material = GetParam().material, .density_gradient = 1});
    bar.model.object->materials.formulation = GetParam().formulation;
    bar.model.object->materials.variance_factor = 0.2;
    return bar;
  }
  test::Bar bar_ = make();
  FullSpaceModel model_ = build_full_space_model(bar_.model);
  const MeshElasticity& elasticity_ = model_.elasticity;
  /// Strains of about 0.3.
  Eigen::VectorXd u_ = 0.03 * test::random_vector(elasticity_.size(), 1);
};

TEST_P(MeshElasticityTest, ForceIsThatOfTheDefinition) {
  if (GetParam().formulation == Formulation::kSmoothed) GTEST_SKIP() << "EnergyIsThatOfTheDefinition";
  Eigen::VectorXd force;
  elasticity_.force(u_, force);
  const Eigen::VectorXd expected = model_.system.restrict(test::full_internal_force(bar_, model_.system.extend(u_)));
  EXPECT_LE((force - expected).norm(), 1e-12 * expected.norm());
}

// Rings from their tets: the mean of the deformation gradients, and how far each is from it.
TEST_P(MeshElasticityTest, EnergyIsThatOfTheDefinition) {
  const TetMesh& mesh = bar_.model.object->mesh;
  const TetMaterials& materials = bar_.model.object->materials;
  const Eigen::VectorXd all = model_.system.extend(u_), volumes = tet_volumes(mesh);
  std::vector<Eigen::Matrix3d> H;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto shape = shape_gradients(tet_positions(mesh, t));
    H.emplace_back(Eigen::Matrix3d::Zero());
    for (int c = 0; c < 4; ++c) H.back() += all.segment<3>(3 * mesh.tets(t, c)) * shape.row(c);
  }
  const auto density = [&](const Eigen::Matrix3d& gradient) {
    return test::energy_density(materials.model, Eigen::Matrix3d::Identity() + gradient, materials.youngs_modulus[0],
                                materials.poisson_ratio[0]);
  };
  ASSERT_EQ(materials.youngs_modulus.minCoeff(), materials.youngs_modulus.maxCoeff());
  double expected = 0;
  if (GetParam().formulation == Formulation::kLinear)
    for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
      expected += volumes[t] * density(H[static_cast<std::size_t>(t)]);
  const double mu = materials.youngs_modulus[0] / (2 * (1 + materials.poisson_ratio[0]));
  for (Eigen::Index v = 0; GetParam().formulation == Formulation::kSmoothed && v < mesh.vertex_count(); ++v) {
    double volume = 0;
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    for (int pass = 0; pass < 2; ++pass)
      for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
        if ((mesh.tets.row(t).array() != v).all()) continue;
        const Eigen::Matrix3d& own = H[static_cast<std::size_t>(t)];
        if (pass == 0) {
          mean = (volume * mean + volumes[t] / 4 * own) / (volume + volumes[t] / 4);
          volume += volumes[t] / 4;
        } else {
          expected += 0.5 * materials.variance_factor * mu * volumes[t] / 4 * (own - mean).squaredNorm();
        }
      }
    expected += volume * density(mean);
  }
  EXPECT_NEAR(elasticity_.energy(u_), expected, 1e-12 * expected);
}

// Its second derivative at rest is the stiffness that modes are made of.
TEST_P(MeshElasticityTest, StiffnessAtRestIsThatOfTheSystem) {
  Eigen::VectorXd force;
  LowerTriangle stiffness;
  elasticity_.force_and_stiffness(Eigen::VectorXd::Zero(u_.size()), runtime::Tangent::kExact, force, stiffness);
  const Eigen::MatrixXd found = Eigen::MatrixXd(stiffness).selfadjointView<Eigen::Lower>();
  EXPECT_LE((found - Eigen::MatrixXd(model_.system.stiffness)).norm(), 1e-13 * found.norm());
}

TEST_P(MeshElasticityTest, ForceAndStiffnessAreDerivatives) {
  Eigen::VectorXd force, before, after;
  LowerTriangle stiffness;
  const double energy = elasticity_.force_and_stiffness(u_, runtime::Tangent::kExact, force, stiffness);
  EXPECT_NEAR(energy, elasticity_.energy(u_), 1e-13 * energy);
  const Eigen::VectorXd direction = test::random_vector(u_.size(), 2);
  // Errors of central differences: h^2 of the third derivative against rounding over h.
  constexpr double kStep = 1e-6;
  const double ahead = elasticity_.force(u_ + kStep * direction, after);
  const double behind = elasticity_.force(u_ - kStep * direction, before);
  EXPECT_NEAR((ahead - behind) / (2 * kStep), force.dot(direction), 1e-7 * force.norm() * direction.norm());
  const Eigen::VectorXd expected = (after - before) / (2 * kStep);
  const Eigen::VectorXd found = stiffness.selfadjointView<Eigen::Lower>() * direction;
  EXPECT_LE((found - expected).norm(), 1e-7 * expected.norm());
}

TEST_P(MeshElasticityTest, ProjectedStiffnessIsPositiveSemidefinite) {
  const Eigen::VectorXd crushed =
      -0.7 * model_.system.restrict(bar_.model.object->mesh.vertices.reshaped<Eigen::RowMajor>());
  Eigen::VectorXd force;
  LowerTriangle exact, projected;
  elasticity_.force_and_stiffness(crushed, runtime::Tangent::kExact, force, exact);
  elasticity_.force_and_stiffness(crushed, runtime::Tangent::kPositiveSemidefinite, force, projected);
  const auto lowest = [](const LowerTriangle& matrix) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(matrix)).eigenvalues()[0];
  };
  EXPECT_LT(lowest(exact), 0) << "the pose is too mild for this test";
  EXPECT_GE(lowest(projected), -1e-10 * projected.norm());
}

TEST_P(MeshElasticityTest, OfAPartIsThatOfTheMeshOfThatPart) {
  if (GetParam().formulation == Formulation::kSmoothed) GTEST_SKIP() << "rings have shares of what is outside the part";
  const ObjectData& object = *bar_.model.object;
  FlagVector inside = FlagVector::Zero(object.mesh.vertex_count());
  inside.tail(2 * inside.size() / 3).setOnes();
  std::vector<Eigen::Index> tets;
  for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t)
    if (inside(object.mesh.tets.row(t).transpose()).all()) tets.push_back(t);
  ASSERT_GT(tets.size(), 0U);
  ASSERT_LT(std::ssize(tets), object.mesh.tet_count());
  TetMesh mesh = object.mesh;
  mesh.tets = TetArray(object.mesh.tets(tets, Eigen::all));
  TetMaterials materials = object.materials;
  materials.youngs_modulus = Eigen::VectorXd(object.materials.youngs_modulus(tets));
  materials.poisson_ratio = Eigen::VectorXd(object.materials.poisson_ratio(tets));
  materials.density = Eigen::VectorXd(object.materials.density(tets));
  const MeshElasticity alone(mesh, materials, model_.system.free_dofs);
  MeshElasticity part = elasticity_;
  Eigen::VectorXd shares = Eigen::VectorXd::Zero(object.mesh.tet_count());
  shares(tets).setOnes();
  part.set_shares(shares);
  Eigen::VectorXd expected, force;
  EXPECT_EQ(part.force(u_, force), alone.force(u_, expected));
  EXPECT_EQ(force, expected);
  EXPECT_EQ(part.set_undeformed(mesh.vertices), 0);
  EXPECT_EQ(part.energy(u_), alone.energy(u_));
  part.set_shares(0.25 * shares);
  EXPECT_DOUBLE_EQ(part.energy(u_), 0.25 * alone.energy(u_));
}

// Nothing is stored in a new undeformed shape, and what it is a rotation of has no energy either.
TEST_P(MeshElasticityTest, StartsFromAnyUndeformedShape) {
  const TetMesh& mesh = bar_.model.object->mesh;
  std::vector<std::int32_t> all(static_cast<std::size_t>(3 * mesh.vertex_count()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::int32_t>(i);
  MeshElasticity elasticity(mesh, bar_.model.object->materials, all);
  const VertexArray shape = mesh.vertices + 0.02 * test::random_matrix(mesh.vertex_count(), 3, 3);
  ASSERT_EQ(elasticity.set_undeformed(shape), 0);
  const VertexArray turned =
      shape * Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix() - shape;
  Eigen::VectorXd force;
  const Eigen::VectorXd displacement = turned.reshaped<Eigen::RowMajor>();
  const double energy = elasticity.force(displacement, force);
  const double scale = elasticity.energy(0.1 * displacement);
  ASSERT_GT(scale, 0);
  EXPECT_LE(energy, 1e-20 * scale + 1e-24);
  EXPECT_LE(force.norm(), 1e-10 * scale / bar_.length);
  VertexArray mirrored = shape;
  mirrored.col(1) *= -1;
  EXPECT_EQ(elasticity.set_undeformed(mirrored), elasticity.elements());
  EXPECT_EQ(elasticity.energy(displacement), 0);
}

INSTANTIATE_TEST_SUITE_P(All, MeshElasticityTest,
                         testing::Values(Kind{MaterialModel::kStVenantKirchhoff},
                                         Kind{MaterialModel::kStableNeoHookean}, Kind{MaterialModel::kCorotational},
                                         Kind{MaterialModel::kStVenantKirchhoff, Formulation::kSmoothed},
                                         Kind{MaterialModel::kStableNeoHookean, Formulation::kSmoothed},
                                         Kind{MaterialModel::kCorotational, Formulation::kSmoothed}));

class FittedFrameTest : public testing::Test {
 protected:
  Eigen::VectorXd moved(const Eigen::VectorXd& u, const Eigen::Matrix3d& R, const Eigen::Vector3d& shift) const {
    Eigen::VectorXd displacement(u.size());
    for (Eigen::Index i = 0; i < u.size(); i += 3) {
      const Eigen::Vector3d rest = mesh_.vertices.row(i / 3).transpose();
      displacement.segment<3>(i) =
          frame_.centre_at_rest() + shift + R * (rest - frame_.centre_at_rest() + u.segment<3>(i)) - rest;
    }
    return displacement;
  }
  Eigen::VectorXd rigid(const Eigen::VectorXd& u) const { return motions_.transpose() * (system_.full_mass * u); }

  test::Bar bar_ = test::make_bar({.cells = {2, 1, 1}, .density_gradient = 2, .free = true});
  const TetMesh& mesh_ = bar_.model.object->mesh;
  ElasticSystem system_ = build_elastic_system(mesh_, bar_.model.object->materials, bar_.model.object->fixed);
  Eigen::MatrixXd motions_ = system_.null_space;
  FittedFrame frame_{mesh_, scalar_mass(mesh_, bar_.model.object->materials.density)};
  Eigen::VectorXd q_ =
      moved(0.08 * test::random_vector(3 * mesh_.vertex_count(), 5),
            Eigen::AngleAxisd(2, Eigen::Vector3d(1, -1, 3).normalized()).toRotationMatrix(), {3, -2, 1});
};

TEST_F(FittedFrameTest, FindsTheMotionOfADeformationWithoutRigidPart) {
  Eigen::VectorXd u = 0.05 * test::random_vector(3 * mesh_.vertex_count(), 6);
  u -= motions_ * rigid(u);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 1, -1).normalized()).toRotationMatrix();
  const auto placement = frame_.place(moved(u, R, {1, 2, 3}));
  EXPECT_LE((placement.rotation - R).norm(), 1e-12);
  EXPECT_LE((frame_.deformation(placement) - u).norm(), 1e-12);
}

TEST_F(FittedFrameTest, DeformationHasNoRigidPartAndTheRateIsItsDerivative) {
  const auto placement = frame_.place(q_);
  const Eigen::VectorXd u = frame_.deformation(placement);
  EXPECT_LE(rigid(u).norm(), 1e-12 * std::sqrt(u.dot(system_.full_mass * u)));
  const Eigen::VectorXd direction = test::random_vector(q_.size(), 7);
  constexpr double kStep = 1e-6;
  const Eigen::VectorXd difference = (frame_.deformation(frame_.place(q_ + kStep * direction)) -
                                      frame_.deformation(frame_.place(q_ - kStep * direction))) /
                                     (2 * kStep);
  EXPECT_LE((frame_.rate(placement, direction) - difference).norm(), 1e-8 * difference.norm());
}

TEST_F(FittedFrameTest, ForcesDoTheSameWorkAndNeitherPushNorTurn) {
  const auto placement = frame_.place(q_);
  const Eigen::VectorXd g = test::random_vector(q_.size(), 8), x = test::random_vector(q_.size(), 9);
  const Eigen::VectorXd force = frame_.force(placement, g);
  EXPECT_NEAR(force.dot(x), g.dot(frame_.rate(placement, x)), 1e-12 * g.norm() * x.norm());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), torque = sum;
  for (Eigen::Index i = 0; i < q_.size(); i += 3) {
    const Eigen::Vector3d f = force.segment<3>(i), place = mesh_.vertices.row(i / 3).transpose() + q_.segment<3>(i);
    sum += f;
    torque += (place - placement.centre).cross(f);
  }
  EXPECT_LE(sum.norm(), 1e-12 * force.norm());
  EXPECT_LE(torque.norm(), 1e-12 * force.norm() * bar_.length);
}

}  // namespace
}  // namespace exmat::precompute

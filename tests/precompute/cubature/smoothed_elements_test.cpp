// Reduced smoothed elements, all of them, against the elasticity of the mesh.
#include <gtest/gtest.h>

#include "common/mesh/elements.h"
#include "precompute/cubature/cubature.h"
#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/polynomial/reduced_polynomial.h"
#include "runtime/sim/elasticity/reduced_elasticity.h"
#include "runtime/sim/elasticity/reduced_polynomial.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kModes = 9;
constexpr double kRounding = 1e-11;  // sums of hundreds of terms, in another order

class ReducedRings : public testing::TestWithParam<MaterialModel> {
 protected:
  ReducedRings() {
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh_.tet_count());
    materials_ = {1000 * ones, 1e5 * ones, 0.4 * ones, GetParam(), Formulation::kSmoothed, 0.17};
    for (Eigen::Index t = 0; t < mesh_.tet_count() / 2; ++t) materials_.youngs_modulus[t] = 3e5;
    std::vector<std::int32_t> dofs;
    for (std::int32_t i = 0; i < 3 * mesh_.vertex_count(); ++i) dofs.push_back(i);
    whole_ = MeshElasticity(mesh_, materials_, dofs);
    basis_ = 0.05 * test::random_matrix(3 * mesh_.vertex_count(), kModes, 5);
  }

  TetMesh mesh_ = test::box_mesh({4, 2, 2}, {1.0, 0.5, 0.4});
  TetMaterials materials_;
  MeshElasticity whole_;
  RowMatrix basis_;
};

INSTANTIATE_TEST_SUITE_P(Materials, ReducedRings,
                         testing::Values(MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                         MaterialModel::kCorotational),
                         [](const auto& model) { return std::string(name_of(model.param)); });

TEST_P(ReducedRings, AreTheElasticityOfTheMesh) {
  const CubatureData data = all_elements(mesh_, materials_, basis_);
  EXPECT_GT(data.elements.size(), mesh_.vertex_count()) << "vertices of two materials have two rings";
  const runtime::ReducedElasticity reduced(GetParam(), data);
  auto workspace = reduced.make_workspace();
  const Eigen::VectorXd q = test::random_vector(kModes, 6);
  Eigen::VectorXd force, found(kModes);
  LowerTriangle full;
  const double energy = whole_.force_and_stiffness(basis_ * q, runtime::Tangent::kExact, force, full);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(kModes, kModes);
  EXPECT_NEAR(reduced.force_and_stiffness(q, workspace, found, stiffness), energy, kRounding * energy);
  EXPECT_NEAR(reduced.energy(q, workspace), energy, kRounding * energy);
  EXPECT_LE((found - basis_.transpose() * force).norm(), kRounding * found.norm());
  const Eigen::MatrixXd expected = basis_.transpose() * (full.selfadjointView<Eigen::Lower>() * basis_);
  EXPECT_LE((Eigen::MatrixXd(stiffness.selfadjointView<Eigen::Lower>()) - expected).norm(),
            kRounding * expected.norm());
}

// A body in each lane, at poses of its own.
TEST_P(ReducedRings, AreTheSameSideBySide) {
  constexpr std::ptrdiff_t kLanes = runtime::kLanes;
  const runtime::ReducedElasticity reduced(GetParam(), all_elements(mesh_, materials_, basis_));
  auto workspace = reduced.make_workspace();
  reduced.prepare_lanes();
  runtime::AlignedArray q(kModes * kLanes), scratch(kModes * kLanes), force(kModes * kLanes), energy(kLanes),
      of_energy(kLanes), stiffness(runtime::lane_triangle(kModes));
  const Eigen::MatrixXd poses = test::random_matrix(kModes, kLanes, 7);
  for (Eigen::Index i = 0; i < kModes; ++i)
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) q[i * kLanes + lane] = poses(i, lane);
  reduced.lanes_force_and_stiffness(q.data(), Precision::kDouble, scratch.data(), energy.data(), force.data(),
                                    stiffness.data());
  reduced.lanes_energy(q.data(), scratch.data(), of_energy.data());
  for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
    Eigen::VectorXd expected(kModes);
    Eigen::MatrixXd K = Eigen::MatrixXd::Zero(kModes, kModes);
    const double value = reduced.force_and_stiffness(poses.col(lane), workspace, expected, K);
    EXPECT_NEAR(energy[lane], value, kRounding * value);
    EXPECT_NEAR(of_energy[lane], value, kRounding * value);
    for (Eigen::Index i = 0; i < kModes; ++i) {
      EXPECT_NEAR(force[i * kLanes + lane], expected[i], kRounding * expected.norm());
      for (Eigen::Index j = 0; j <= i; ++j)
        EXPECT_NEAR(stiffness[runtime::lane_entry(i, j) + lane], K(i, j), kRounding * K.norm());
    }
  }
}

TEST_P(ReducedRings, AreThePolynomial) {
  if (GetParam() != MaterialModel::kStVenantKirchhoff) GTEST_SKIP() << "no polynomial";
  const runtime::ReducedPolynomial polynomial(reduced_polynomial(mesh_, materials_, basis_));
  auto workspace = polynomial.make_workspace();
  const Eigen::VectorXd q = test::random_vector(kModes, 8);
  Eigen::VectorXd force, found(kModes);
  const double energy = whole_.force(basis_ * q, force);
  EXPECT_NEAR(polynomial.force(q, workspace, found), energy, kRounding * energy);
  EXPECT_LE((found - basis_.transpose() * force).norm(), kRounding * found.norm());
}

}  // namespace
}  // namespace exmat::precompute

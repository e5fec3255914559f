#include "precompute/targets/target_elasticity.h"

#include <gtest/gtest.h>
#include <omp.h>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"
#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/modes/basis.h"
#include "runtime/sim/examples/target_elasticity.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

// Against the elasticity of the mesh itself, deformed from the target.

namespace exmat::precompute {
namespace {

class ElasticForceOf : public testing::TestWithParam<MaterialModel> {
 protected:
  static constexpr Eigen::Index kModes = 10;

  ElasticForceOf() {
    const Eigen::Index count = mesh_.tet_count();
    materials_ = {Eigen::VectorXd::Constant(count, 1000), Eigen::VectorXd::LinSpaced(count, 1e5, 2e5),
                  Eigen::VectorXd::Constant(count, 0.35), GetParam()};
    FlagVector fixed = FlagVector::Zero(mesh_.vertex_count());
    for (Eigen::Index v = 0; v < fixed.size(); ++v) fixed[v] = mesh_.vertices(v, 0) < 1e-9 ? 1 : 0;
    system_ = build_elastic_system(mesh_, materials_, fixed);
    const SemidefiniteSolver solver(system_.stiffness, system_.mass * system_.null_space, "test");
    const auto modes = linear_modes(system_, solver, 8);
    const auto derivatives = modal_derivatives(mesh_, materials_, system_, solver, modes.modes);
    const Eigen::MatrixXd U = modal_basis({system_, modes, derivatives, 1, {}}, kModes);
    // Two displacements that hold the targets, the second one out of reach of the basis; one example of each.
    fields_.resize(U.rows(), 2);
    fields_ << U.col(0), modes.modes.col(7);
    space_.coordinates = {fields_, Eigen::MatrixXd::Zero(2, 3)};
    space_.coordinates.poses(0, 1) = 0.25 / system_.extend(fields_.col(0)).lpNorm<Eigen::Infinity>();
    space_.coordinates.poses(1, 2) = 0.03 / system_.extend(fields_.col(1)).lpNorm<Eigen::Infinity>();
    source_ = pose_source(system_, modes, derivatives, U, 1, Eigen::MatrixXd::Zero(kModes, 0));
    free_basis_ = U;
  }

  TargetElasticityInput input(const Eigen::VectorXd& shares) const {
    return {mesh_,
            materials_,
            source_.basis,
            system_.extend(fields_),
            shares,
            space_,
            free_basis_.transpose() * (system_.mass * fields_)};
  }
  Eigen::VectorXd ones() const { return Eigen::VectorXd::Ones(mesh_.tet_count()); }

  /// U^T of the force on the vertices, and the energy.
  std::pair<Eigen::VectorXd, double> exact(const Eigen::VectorXd& q, const Eigen::VectorXd& y,
                                           const Eigen::VectorXd& shares) const {
    MeshElasticity elasticity(mesh_, materials_, system_.free_dofs);
    elasticity.set_shares(shares);
    const Eigen::VectorXd target = fields_ * y, all = system_.extend(target);
    EXPECT_EQ(elasticity.set_undeformed(mesh_.vertices + all.reshaped<Eigen::RowMajor>(mesh_.vertex_count(), 3)), 0);
    Eigen::VectorXd force;
    const double energy = elasticity.force(free_basis_ * q - target, force);
    return {free_basis_.transpose() * force, energy};
  }
  std::pair<Eigen::VectorXd, double> reduced(const TargetElasticityData& data, const Eigen::VectorXd& q,
                                             const Eigen::VectorXd& y) const {
    const runtime::TargetElasticity elasticity(GetParam(), data, RowMatrix::Identity(2, 2));
    auto workspace = elasticity.make_workspace();
    elasticity.set_target(y, 1, workspace);
    Eigen::VectorXd force = Eigen::VectorXd::Zero(kModes);
    const double energy = elasticity.add_force(q, workspace, force);
    return {force, energy};
  }

  /// Root mean square of |L^-1 (f - f_exact)| / |L^-1 f_exact| at poses and targets of its own.
  double error(const TargetElasticityData& data, const Eigen::VectorXd& shares) const {
    const Eigen::LLT<Eigen::MatrixXd> stiffness(source_.rest_stiffness);
    const RowMatrix poses = draw_poses(source_, 40, 77);
    double sum = 0;
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      const Eigen::Vector3d w = (Eigen::Vector3d::Ones() + test::random_vector(3, static_cast<unsigned>(i))) / 3;
      const Eigen::VectorXd q = poses.row(i), y = space_.coordinates.poses * w;
      const Eigen::VectorXd f = exact(q, y, shares).first;
      const Eigen::VectorXd difference = reduced(data, q, y).first - f;
      sum += Eigen::VectorXd(stiffness.matrixL().solve(difference)).squaredNorm() /
             Eigen::VectorXd(stiffness.matrixL().solve(f)).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(poses.rows()));
  }

  /// In all of the body, and by shares of its parts.
  void expect_all_elements_to_be_the_mesh(Eigen::Index count) const {
    Eigen::VectorXd shares = ones();
    shares.head(20).setZero();
    shares.segment(20, 30).setConstant(0.25);
    const Eigen::VectorXd q = draw_poses(source_, 1, 5).row(0),
                          y = space_.coordinates.poses * Eigen::Vector3d(0.2, 0.5, 0.3);
    for (const Eigen::VectorXd& own : {ones(), shares}) {
      const auto data = all_target_elements(input(own));
      EXPECT_LE(data.elements.size(), count);
      const auto [force, energy] = exact(q, y, own);
      const auto found = reduced(data, q, y);
      EXPECT_NEAR(found.second, energy, 1e-11 * energy);
      EXPECT_LE((found.first - force).norm(), 1e-11 * force.norm());
    }
  }

  TetMesh mesh_ = test::box_mesh({8, 2, 2}, {1.0, 0.25, 0.2});
  TetMaterials materials_;
  ElasticSystem system_;
  Eigen::MatrixXd fields_, free_basis_;
  TargetSpace space_;
  PoseSource source_;
};

INSTANTIATE_TEST_SUITE_P(Materials, ElasticForceOf,
                         testing::Values(MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                         MaterialModel::kCorotational),
                         [](const auto& model) { return std::string(name_of(model.param)); });

TEST_P(ElasticForceOf, AllTetsIsThatOfTheMesh) { expect_all_elements_to_be_the_mesh(mesh_.tet_count()); }

TEST_P(ElasticForceOf, AllRingsIsThatOfTheMesh) {
  materials_.formulation = Formulation::kSmoothed;
  materials_.variance_factor = 0.2;
  expect_all_elements_to_be_the_mesh(elements_of(mesh_, materials_).count());
}

// About as far off at pairs of its own as it says: drawn in the same way, but at full distance from the target.
TEST_P(ElasticForceOf, ChosenTetsIsNearThatOfTheMesh) {
  const auto data = target_elasticity(input(ones()), source_, {.elements = 40, .training_poses = 120});
  EXPECT_LE(data.elements.size(), 40);
  EXPECT_TRUE((data.weights.array() > 0).all());
  const double found = error(data, ones());
  RecordProperty("error", std::to_string(found));
  EXPECT_LE(data.heldout_error, 0.06);
  EXPECT_LE(found, 2 * data.heldout_error);
  EXPECT_GE(found, 0.2 * data.heldout_error);
  EXPECT_EQ(data.control_points, RowMatrix(space_.coordinates.poses.transpose())) << "there is no table";
}

TEST_P(ElasticForceOf, ARegionHasTetsOfItsOwn) {
  Eigen::VectorXd shares = Eigen::VectorXd::Zero(mesh_.tet_count());
  shares.tail(60).setConstant(0.5);
  const auto data = target_elasticity(input(shares), source_, {.elements = 30, .training_poses = 120});
  EXPECT_GE(data.elements.minCoeff(), mesh_.tet_count() - 60);
  EXPECT_LE(error(data, shares), 0.15);
}

TEST_P(ElasticForceOf, AToleranceTakesAsManyTetsAsItNeeds) {
  const auto coarse = target_elasticity(input(ones()), source_, {.tolerance = 0.2, .training_poses = 120});
  const auto fine = target_elasticity(input(ones()), source_, {.tolerance = 0.04, .training_poses = 120});
  EXPECT_LE(coarse.heldout_error, 0.2);
  EXPECT_LE(fine.heldout_error, 0.04);
  EXPECT_LT(coarse.elements.size(), fine.elements.size());
  EXPECT_NEAR(fine.heldout_error, target_elasticity_error(input(ones()), source_, {}, fine.elements, fine.weights),
              1e-12);
}

TEST_P(ElasticForceOf, IsTheSameForEveryNumberOfThreads) {
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const auto one = target_elasticity(input(ones()), source_, {.elements = 12, .training_poses = 30});
  omp_set_num_threads(3);
  const auto three = target_elasticity(input(ones()), source_, {.elements = 12, .training_poses = 30});
  omp_set_num_threads(threads);
  EXPECT_EQ(one.elements, three.elements);
  EXPECT_EQ(one.weights, three.weights);
}

}  // namespace
}  // namespace exmat::precompute

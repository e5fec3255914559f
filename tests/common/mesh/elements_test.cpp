// Smoothed elements by their definition: an affine displacement, sums over tets, modes without energy.
#include "common/mesh/elements.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "common/mesh/assembly.h"
#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat {
namespace elements_test {

constexpr double kRounding = 1e-12;  // sums of some dozens of terms

class SmoothedElements : public testing::Test {
 protected:
  SmoothedElements() {
    const Eigen::Index tets = mesh_.tet_count();
    for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v)
      for (int axis = 0; axis < 3; ++axis)
        mesh_.vertices(v, axis) += 0.04 * std::sin(7.0 * static_cast<double>(v) + axis);
    materials_ = {Eigen::VectorXd::Ones(tets),
                  Eigen::VectorXd::Constant(tets, 1e4),
                  Eigen::VectorXd::Constant(tets, 0.3),
                  MaterialModel::kStVenantKirchhoff,
                  Formulation::kSmoothed,
                  0.2};
  }
  Elements elements() const { return elements_of(mesh_, materials_); }

  static Eigen::Matrix3d displacement_gradient(const Elements& elements, Eigen::Index e, const VertexArray& u) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    const auto vertices = elements.vertices_of(e);
    for (std::size_t j = 0; j < vertices.size(); ++j)
      H += u.row(vertices[j]).transpose() * elements.gradients_of(e).row(static_cast<Eigen::Index>(j));
    return H;
  }
  Eigen::Matrix3d displacement_gradient(Eigen::Index tet, const VertexArray& u) const {
    const VertexArray corners = u(mesh_.tets.row(tet), Eigen::all);
    return corners.transpose() * shape_gradients(tet_positions(mesh_, tet));
  }

  TetMesh mesh_ = test::box_mesh({3, 2, 2}, {1.0, 0.6, 0.7});
  TetMaterials materials_;
};

TEST_F(SmoothedElements, AreOneRingForEachVertexWithAQuarterOfTheVolumeOfItsTets) {
  const Elements all = elements();
  ASSERT_EQ(all.count(), mesh_.vertex_count());
  EXPECT_EQ(all.centres, IndexVector::LinSpaced(all.count(), 0, static_cast<int>(all.count()) - 1));
  const Eigen::VectorXd volumes = tet_volumes(mesh_);
  EXPECT_NEAR(all.volumes.sum(), volumes.sum(), kRounding);
  for (Eigen::Index e = 0; e < all.count(); ++e) {
    double volume = 0;
    for (Eigen::Index t = 0; t < mesh_.tet_count(); ++t)
      if ((mesh_.tets.row(t).array() == static_cast<std::int32_t>(e)).any()) volume += volumes[t] / 4;
    EXPECT_NEAR(all.volumes[e], volume, kRounding);
  }
}

TEST_F(SmoothedElements, GiveTheMeanOfTheGradientsOfTheirTets) {
  const Elements all = elements();
  const VertexArray u = test::random_matrix(mesh_.vertex_count(), 3, 1);
  const Eigen::VectorXd volumes = tet_volumes(mesh_);
  for (Eigen::Index e = 0; e < all.count(); ++e) {
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    for (const auto t : all.tets_of(e)) mean += volumes[t] / 4 / all.volumes[e] * displacement_gradient(t, u);
    EXPECT_LE((displacement_gradient(all, e, u) - mean).norm(), kRounding * mean.norm());
  }
}

TEST_F(SmoothedElements, ReproduceAffineDisplacementsWithoutVariance) {
  const Elements all = elements();
  const Eigen::Matrix3d A = test::random_matrix(3, 3, 2);
  const VertexArray u = (mesh_.vertices * A.transpose()).rowwise() + Eigen::RowVector3d(1, 2, 3);
  for (Eigen::Index e = 0; e < all.count(); ++e)
    EXPECT_LE((displacement_gradient(all, e, u) - A).norm(), kRounding * A.norm());
  const SparseMatrix S = variance_matrix(mesh_, materials_, all);
  EXPECT_LE((S * u).norm(), kRounding * S.norm() * u.norm());
}

// beta mu times the sum over rings of V_t/4 |H_t - H_ring|^2.
TEST_F(SmoothedElements, CountTheVarianceOfTheGradients) {
  const Elements all = elements();
  const SparseMatrix S = variance_matrix(mesh_, materials_, all);
  const VertexArray u = test::random_matrix(mesh_.vertex_count(), 3, 3);
  const Eigen::VectorXd volumes = tet_volumes(mesh_);
  double sum = 0;
  for (Eigen::Index e = 0; e < all.count(); ++e)
    for (const auto t : all.tets_of(e)) {
      const double square = (displacement_gradient(t, u) - displacement_gradient(all, e, u)).squaredNorm();
      sum += materials_.variance_factor * all.lame(e).mu * volumes[t] / 4 * square;
    }
  EXPECT_NEAR(u.cwiseProduct(S * u).sum(), sum, kRounding * sum);
}

// Never without the variance term: rings alone have soft modes that are none of the body.
TEST_F(SmoothedElements, HaveSixModesWithoutEnergyAndNoSoftOnes) {
  const auto eigenvalues = [&] {
    const Eigen::MatrixXd K = elastic_stiffness(mesh_, materials_);
    EXPECT_LE((K - K.transpose()).norm(), kRounding * K.norm());
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(K, Eigen::EigenvaluesOnly).eigenvalues().eval();
  };
  const Eigen::VectorXd values = eigenvalues();
  EXPECT_LE(values.head<6>().cwiseAbs().maxCoeff(), kRounding * values.tail<1>()[0]);
  materials_.formulation = Formulation::kLinear;
  EXPECT_GT(values[6], 0.2 * eigenvalues()[6]);
}

TEST_F(SmoothedElements, AreOneForEachMaterialOfAVertex) {
  for (Eigen::Index t = 0; t < mesh_.tet_count(); ++t)
    if (tet_positions(mesh_, t).col(0).mean() > 0.5) materials_.youngs_modulus[t] = 5e4;
  const Elements all = elements();
  EXPECT_GT(all.count(), mesh_.vertex_count());
  EXPECT_NEAR(all.volumes.sum(), tet_volumes(mesh_).sum(), kRounding);
  for (Eigen::Index e = 0; e < all.count(); ++e) {
    for (const auto t : all.tets_of(e)) {
      EXPECT_EQ(all.youngs_modulus[e], materials_.youngs_modulus[t]);
      EXPECT_TRUE((mesh_.tets.row(t).array() == all.centres[e]).any());
    }
  }
  // The mean of a number of tets is theirs where it is the same in all of a ring.
  EXPECT_NEAR(mean_over_elements(mesh_, all, materials_.youngs_modulus).minCoeff(), 1e4, kRounding * 1e4);
}

TEST_F(SmoothedElements, AreTetsWhereTheFormulationIsLinear) {
  materials_.formulation = Formulation::kLinear;
  const Elements all = elements();
  ASSERT_EQ(all.count(), mesh_.tet_count());
  EXPECT_FALSE(all.smoothed());
  EXPECT_EQ(all.volumes, tet_volumes(mesh_));
  EXPECT_EQ(variance_matrix(mesh_, materials_, all).nonZeros(), 0);
  for (Eigen::Index e = 0; e < all.count(); ++e)
    EXPECT_EQ(all.gradients_of(e), (shape_gradients(tet_positions(mesh_, e))));
}

}  // namespace elements_test
}  // namespace exmat

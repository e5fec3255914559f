// Assembled matrices against sums over the tets.
#include "common/mesh/assembly.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/elastic/material.h"
#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"

namespace exmat {
namespace {

using test::box_mesh;

// Sums of a few hundred terms of like size.
constexpr double kRounding = 1e-13;

/// Tets of all shapes, their vertices in no order that tessellations of boxes have.
TetMesh shaken_mesh() {
  TetMesh mesh = box_mesh({3, 2, 2}, {1.5, 1.0, 0.7});
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    for (int axis = 0; axis < 3; ++axis) mesh.vertices(v, axis) += 0.05 * std::sin(7.0 * static_cast<double>(v) + axis);
  const VertexArray vertices = mesh.vertices;
  const auto n = static_cast<std::int32_t>(mesh.vertex_count());
  const auto moved = [n](std::int32_t v) { return (5 * v + 3) % n; };  // 36 vertices: one to one
  for (std::int32_t v = 0; v < n; ++v) mesh.vertices.row(moved(v)) = vertices.row(v);
  for (auto& vertex : mesh.tets.reshaped()) vertex = moved(vertex);
  return mesh;
}

TetMaterials mixed_materials(Eigen::Index tets) {
  const Eigen::ArrayXd share = Eigen::ArrayXd::LinSpaced(tets, 0, 1);
  return {1000 + 500 * share, 1e5 * (1 + 3 * share), 0.1 + 0.3 * share};
}

Eigen::MatrixXd fields(Eigen::Index rows) {
  Eigen::MatrixXd result(rows, 2);
  for (Eigen::Index i = 0; i < rows; ++i)
    result.row(i) << std::sin(3.0 * static_cast<double>(i)), std::cos(1.0 + static_cast<double>(i));
  return result;
}

TEST(Assembly, StiffnessIsTheWorkOfHookesStress) {
  const TetMesh mesh = shaken_mesh();
  const TetMaterials materials = mixed_materials(mesh.tet_count());
  const SparseMatrix K = elastic_stiffness(mesh, materials);
  const Eigen::MatrixXd uv = fields(3 * mesh.vertex_count());
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  double work = 0, size = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto gradients = shape_gradients(tet_positions(mesh, t));
    Eigen::Matrix3d strain[2];
    for (int k = 0; k < 2; ++k) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      for (int corner = 0; corner < 4; ++corner)
        H += uv.col(k).segment<3>(3 * mesh.tets(t, corner)) * gradients.row(corner);
      strain[k] = 0.5 * (H + H.transpose());
    }
    const LameParameters lame = lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]);
    const Eigen::Matrix3d stress =
        2 * lame.mu * strain[0] + lame.lambda * strain[0].trace() * Eigen::Matrix3d::Identity();
    work += volumes[t] * stress.cwiseProduct(strain[1]).sum();
    size += volumes[t] * stress.norm() * strain[1].norm();
  }
  EXPECT_NEAR(uv.col(1).dot(K * uv.col(0)), work, kRounding * size);
  EXPECT_NEAR(uv.col(0).dot(K * uv.col(1)), work, kRounding * size);
  EXPECT_EQ(K.nonZeros(), 9 * scalar_mass(mesh).nonZeros());
}

TEST(Assembly, MassAndLaplacianIntegrateLinearFields) {
  const TetMesh mesh = shaken_mesh();
  const double volume = tet_volumes(mesh).sum();
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.vertex_count());
  EXPECT_NEAR(ones.dot(scalar_mass(mesh) * ones), volume, kRounding * volume);
  const Eigen::Matrix3d energy = mesh.vertices.transpose() * (laplacian_stiffness(mesh) * mesh.vertices);
  EXPECT_LE((energy - volume * Eigen::Matrix3d::Identity()).norm(), 100 * kRounding * volume);
}

TEST(Assembly, SubmatrixAndExpansionKeepTheEntries) {
  const SparseMatrix scalar = laplacian_stiffness(shaken_mesh());
  const Eigen::MatrixXd dense = scalar;
  const std::vector<std::int32_t> kept{0, 3, 4, 17, 30, 35};
  EXPECT_EQ(Eigen::MatrixXd(submatrix(scalar, kept)), dense(kept, kept));
  const Eigen::MatrixXd expanded = expand_to_vectors(scalar);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_EQ(expanded(Eigen::seqN(axis, dense.rows(), 3), Eigen::seqN(axis, dense.cols(), 3)), dense);
  EXPECT_EQ((expanded.array() != 0).count(), 3 * (dense.array() != 0).count());
}

}  // namespace
}  // namespace exmat

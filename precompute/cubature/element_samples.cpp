#include "precompute/cubature/element_samples.h"

#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

using RowMatrix3Map = Eigen::Map<const RowMatrix3>;

Eigen::Matrix<double, 9, 1> flatten(const Eigen::Matrix3d& matrix) { return matrix.reshaped<Eigen::RowMajor>(); }

}  // namespace

ElementSamples::ElementSamples(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis)
    : mesh_(mesh), materials_(materials), basis_(basis), volumes_(tet_volumes(mesh)) {}

LameParameters ElementSamples::lame(Eigen::Index tet) const {
  return lame_parameters(materials_.youngs_modulus[tet], materials_.poisson_ratio[tet]);
}

RowMatrix ElementSamples::gradient(Eigen::Index tet) const {
  const auto shape = shape_gradients(tet_positions(mesh_, tet));
  RowMatrix B = RowMatrix::Zero(9, modes());
  for (int corner = 0; corner < 4; ++corner)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) B.row(3 * a + b) += shape(corner, b) * basis_.row(3 * mesh_.tets(tet, corner) + a);
  return B;
}

ElementSamples::Response ElementSamples::response(Eigen::Index tet, const RowMatrix& poses) const {
  const RowMatrix B = gradient(tet);
  const Eigen::MatrixXd gradients = B * poses.transpose();
  const auto parameters = lame(tet);
  Response result{{}, Eigen::VectorXd(poses.rows())};
  Eigen::MatrixXd stresses(9, poses.rows());
  with_material(materials_.model, [&](auto material) {
    for (Eigen::Index p = 0; p < poses.rows(); ++p) {
      const Eigen::Matrix3d H = RowMatrix3Map(gradients.col(p).data());
      stresses.col(p) = volumes_[tet] * flatten(material.first_piola_kirchhoff(H, parameters));
      result.energies[p] = volumes_[tet] * material.energy(H, parameters);
    }
  });
  result.forces = B.transpose() * stresses;
  return result;
}

Eigen::MatrixXd ElementSamples::stiffness(Eigen::Index tet, const Eigen::VectorXd& pose) const {
  const RowMatrix B = gradient(tet);
  const Eigen::Matrix<double, 9, 1> flat = B * pose;
  const Eigen::Matrix3d H = RowMatrix3Map(flat.data());
  const Matrix9 tangent =
      with_material(materials_.model, [&](auto material) { return material.tangent(H, lame(tet)); });
  return volumes_[tet] * (B.transpose() * (tangent * B));
}

}  // namespace exmat::precompute

#include "precompute/alignment/arap_energy.h"

#include <Eigen/LU>

#include "common/mesh/geometry.h"
#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

// Newton's iteration for the polar factor [Higham 1986], which is the nearest rotation where det F > 0; the singular
// value decomposition for the rest.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& F) {
  constexpr int kMostIterations = 12;
  constexpr double kConverged = 1e-14;
  const double size = F.norm();
  if (F.determinant() <= 1e-3 * size * size * size) return procrustes_rotation(F);
  Eigen::Matrix3d R = F;
  for (int k = 0; k < kMostIterations; ++k) {
    const Eigen::Matrix3d next = 0.5 * (R + R.inverse().transpose());
    const double change = (next - R).squaredNorm();
    R = next;
    if (change < kConverged * kConverged) return R;
  }
  return procrustes_rotation(F);
}

}  // namespace

ArapEnergy::ArapEnergy(const TetMesh& rest) : tets_(rest.tets), volumes_(tet_volumes(rest)) {
  const double volume = volumes_.sum();
  volumes_ /= volume;
  stiffness_ = laplacian_stiffness(rest) / volume;
  gradients_.resize(static_cast<std::size_t>(rest.tet_count()));
  for (std::size_t t = 0; t < gradients_.size(); ++t)
    gradients_[t] = shape_gradients(tet_positions(rest, static_cast<Eigen::Index>(t)));
}

Eigen::Matrix3d ArapEnergy::deformation_gradient(const VertexArray& positions, Eigen::Index tet) const {
  Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
  for (int corner = 0; corner < 4; ++corner)
    F += positions.row(tets_(tet, corner)).transpose() * gradients_[static_cast<std::size_t>(tet)].row(corner);
  return F;
}

std::vector<Eigen::Matrix3d> ArapEnergy::rotations(const VertexArray& positions) const {
  std::vector<Eigen::Matrix3d> result(gradients_.size());
#pragma omp parallel for schedule(static)
  for (std::size_t t = 0; t < result.size(); ++t)
    result[t] = nearest_rotation(deformation_gradient(positions, static_cast<Eigen::Index>(t)));
  return result;
}

double ArapEnergy::energy(const VertexArray& positions) const {
  const auto R = rotations(positions);
  double sum = 0;
  for (std::size_t t = 0; t < R.size(); ++t) {
    const auto tet = static_cast<Eigen::Index>(t);
    sum += volumes_[tet] * (deformation_gradient(positions, tet) - R[t]).squaredNorm();
  }
  return sum;
}

VertexArray ArapEnergy::load(const std::vector<Eigen::Matrix3d>& rotations) const {
  VertexArray load = VertexArray::Zero(stiffness_.rows(), 3);
  for (std::size_t t = 0; t < rotations.size(); ++t) {
    const auto tet = static_cast<Eigen::Index>(t);
    const Eigen::Matrix<double, 4, 3> local = volumes_[tet] * gradients_[t] * rotations[t].transpose();
    for (int corner = 0; corner < 4; ++corner) load.row(tets_(tet, corner)) += local.row(corner);
  }
  return load;
}

VertexArray ArapEnergy::gradient(const VertexArray& positions) const {
  return 2 * (stiffness_ * positions - load(rotations(positions)));
}

double ArapEnergy::inverted_fraction(const VertexArray& positions) const {
  double sum = 0;
  for (Eigen::Index t = 0; t < tets_.rows(); ++t)
    if (deformation_gradient(positions, t).determinant() < 0) sum += volumes_[t];
  return sum;
}

double ArapEnergy::squeezed_fraction(const VertexArray& positions, double factor) const {
  Eigen::VectorXd ratios(tets_.rows());
  for (Eigen::Index t = 0; t < tets_.rows(); ++t) ratios[t] = deformation_gradient(positions, t).determinant();
  const double whole = ratios.dot(volumes_);
  double sum = 0;
  for (Eigen::Index t = 0; t < tets_.rows(); ++t)
    if (ratios[t] * factor < whole || ratios[t] > factor * whole) sum += volumes_[t];
  return sum;
}

}  // namespace exmat::precompute

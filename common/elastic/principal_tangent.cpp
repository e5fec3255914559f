#include "common/elastic/principal_tangent.h"

#include <Eigen/LU>
#include <cmath>

#include "common/core/decompositions.h"

namespace exmat {
namespace {

Eigen::Matrix<double, 9, 1> flatten(const Eigen::Matrix3d& matrix) { return matrix.reshaped<Eigen::RowMajor>(); }

}  // namespace

SignedSvd signed_svd(const Eigen::Matrix3d& F) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  SignedSvd result{svd.matrixU(), svd.matrixV(), svd.singularValues()};
  if (result.U.determinant() < 0) {
    result.U.col(2) *= -1;
    result.stretches[2] *= -1;
  }
  if (result.V.determinant() < 0) {
    result.V.col(2) *= -1;
    result.stretches[2] *= -1;
  }
  return result;
}

Matrix9 tangent_of(const PrincipalTangent& principal, const SignedSvd& svd) {
  const auto mode = [&svd](int i, int j) { return flatten(svd.U.col(i) * svd.V.col(j).transpose()); };
  Matrix9 tangent = Matrix9::Zero();
  Eigen::Matrix<double, 9, 3> stretches;
  for (int i = 0; i < 3; ++i) stretches.col(i) = mode(i, i);
  tangent += stretches * principal.stretch * stretches.transpose();
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const Eigen::Matrix<double, 9, 1> lower = mode(j, i), upper = mode(i, j);
    const Eigen::Matrix<double, 9, 1> twist = lower - upper, flip = lower + upper;
    tangent += 0.5 * principal.twist[k] * twist * twist.transpose();
    tangent += 0.5 * principal.flip[k] * flip * flip.transpose();
  }
  return tangent;
}

PrincipalTangent positive_semidefinite(const PrincipalTangent& principal) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(principal.stretch);
  const Eigen::Matrix3d& vectors = solver.eigenvectors();
  return {vectors * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * vectors.transpose(),
          principal.twist.cwiseMax(0.0), principal.flip.cwiseMax(0.0)};
}

}  // namespace exmat

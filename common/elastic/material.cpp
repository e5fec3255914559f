#include "common/elastic/material.h"

#include "common/core/decompositions.h"

namespace exmat {

Matrix9 project_positive_semidefinite(const Matrix9& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(symmetric);
  const auto& vectors = solver.eigenvectors();
  return vectors * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * vectors.transpose();
}

}  // namespace exmat

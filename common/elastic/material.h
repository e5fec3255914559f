#pragma once

#include <Eigen/Core>

namespace exmat {

/// Matrices of derivatives by F flatten F_ab to 3a + b, as /cubature/gradient does.
using Matrix9 = Eigen::Matrix<double, 9, 9, Eigen::RowMajor>;

/// Lame parameters [Pa].
struct LameParameters {
  double mu = 0;
  double lambda = 0;
};

/// From Young's modulus > 0 [Pa] and Poisson ratio in (-1, 0.5).
constexpr LameParameters lame_parameters(double youngs_modulus, double poisson_ratio) {
  return {youngs_modulus / (2 * (1 + poisson_ratio)),
          youngs_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))};
}

// A material is a struct of static functions of the displacement gradient H = F - I (small strains keep all their
// digits):
//   energy(H, lame)                     energy density Psi [Pa], 0 at rest
//   first_piola_kirchhoff(H, lame)      P = dPsi/dF [Pa], 3 x 3
//   tangent(H, lame)                    dP/dF [Pa], 9 x 9 symmetric
//   rest_second_derivative(A, B, lame)  d2P/dF2 [A, B] at F = I [Pa], 3 x 3, symmetric in A and B
//   principal_tangent(s, lame)          the eigensystem of the tangent, see principal_tangent.h
// with the tangent of linear elasticity at rest. A new one is one file (see st_venant_kirchhoff.h), its name in
// material_model.cpp, its place in materials.h, and its lanes in runtime/kernels/materials_isa.inl.

/// Nearest positive semi-definite matrix (Frobenius norm): negative eigenvalues set to zero.
Matrix9 project_positive_semidefinite(const Matrix9& symmetric);

}  // namespace exmat

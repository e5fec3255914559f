#pragma once

#include "common/elastic/material.h"
#include "common/elastic/principal_tangent.h"

namespace exmat {

/// St.Venant-Kirchhoff: Psi = lambda/2 tr(E)^2 + mu E:E, E = (F^T F - I)/2. Bonet and Wood 2008, section 6.4.1.
struct StVenantKirchhoff {
  static Eigen::Matrix3d green_strain(const Eigen::Matrix3d& H) {
    return 0.5 * (H + H.transpose() + H.transpose() * H);
  }

  static Eigen::Matrix3d second_piola_kirchhoff(const Eigen::Matrix3d& E, const LameParameters& lame) {
    return lame.lambda * E.trace() * Eigen::Matrix3d::Identity() + 2 * lame.mu * E;
  }

  static double energy(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Eigen::Matrix3d E = green_strain(H);
    const double trace = E.trace();
    return 0.5 * lame.lambda * trace * trace + lame.mu * E.squaredNorm();
  }

  static Eigen::Matrix3d first_piola_kirchhoff(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Eigen::Matrix3d S = second_piola_kirchhoff(green_strain(H), lame);
    return S + H * S;
  }

  /// dP_ab/dF_cd = delta_ac S_db + lambda F_ab F_cd + mu F_ad F_cb + mu delta_bd (F F^T)_ac.
  static Matrix9 tangent(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Eigen::Matrix3d F = H + Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d S = second_piola_kirchhoff(green_strain(H), lame);
    const Eigen::Matrix3d left_cauchy_green = F * F.transpose();
    Matrix9 D;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        for (int c = 0; c < 3; ++c)
          for (int d = 0; d < 3; ++d) {
            double value = lame.lambda * F(a, b) * F(c, d) + lame.mu * F(a, d) * F(c, b);
            if (a == c) value += S(d, b);
            if (b == d) value += lame.mu * left_cauchy_green(a, c);
            D(3 * a + b, 3 * c + d) = value;
          }
    return D;
  }

  static Eigen::Matrix3d rest_second_derivative(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B,
                                                const LameParameters& lame) {
    const auto linear_stress = [&lame](const Eigen::Matrix3d& G) -> Eigen::Matrix3d {
      return second_piola_kirchhoff(0.5 * (G + G.transpose()), lame);
    };
    const Eigen::Matrix3d quadratic_strain = 0.5 * (A.transpose() * B + B.transpose() * A);
    return A * linear_stress(B) + B * linear_stress(A) + second_piola_kirchhoff(quadratic_strain, lame);
  }

  /// By Smith, de Goes and Kim 2019, of Psi_i = (lambda tr E - mu) s_i + mu s_i^3.
  static PrincipalTangent principal_tangent(const Eigen::Vector3d& s, const LameParameters& lame) {
    const double linear = 0.5 * lame.lambda * (s.squaredNorm() - 3) - lame.mu;
    PrincipalTangent principal;
    principal.stretch = lame.lambda * s * s.transpose();
    for (int k = 0; k < 3; ++k) {
      const double a = s[(k + 1) % 3], b = s[(k + 2) % 3];
      principal.stretch(k, k) += linear + 3 * lame.mu * s[k] * s[k];
      principal.twist[k] = linear + lame.mu * (a * a - a * b + b * b);
      principal.flip[k] = linear + lame.mu * (a * a + a * b + b * b);
    }
    return principal;
  }
};

}  // namespace exmat

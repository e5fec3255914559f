#pragma once

#include <Eigen/LU>
#include <algorithm>

#include "common/elastic/material.h"
#include "common/elastic/polar_rotation.h"
#include "common/elastic/principal_tangent.h"

namespace exmat {

/// Corotational linear elasticity: Psi = mu |F - R|^2 + lambda/2 (tr S - 3)^2, F = R S with R the nearest rotation,
/// also where F is inverted; there S has one negative eigenvalue.
///
/// If two eigenvalues of S add up to zero, R is not unique and the energy has a kink.
struct Corotational {
  /// Bounds 1 / (s_i + s_j), so that the tangent is finite at the kink.
  static constexpr double kLeastGap = 1e-6;

  static double energy(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Parts at(H);
    return lame.mu * at.stretch.squaredNorm() + 0.5 * lame.lambda * at.trace * at.trace;
  }

  static Eigen::Matrix3d first_piola_kirchhoff(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Parts at(H);
    return 2 * lame.mu * at.stretch + lame.lambda * at.trace * at.rotation;
  }

  /// From its eigensystem.
  static Matrix9 tangent(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const SignedSvd svd = signed_svd(H + Eigen::Matrix3d::Identity());
    return tangent_of(principal_tangent(svd.stretches, lame), svd);
  }

  /// Second-order terms of P: -mu (W W - W e - e W) + lambda (W:W / 2 I + tr e W), e and W the symmetric and the
  /// skew part of H.
  static Eigen::Matrix3d rest_second_derivative(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B,
                                                const LameParameters& lame) {
    const Eigen::Matrix3d a = 0.5 * (A + A.transpose()), V = 0.5 * (A - A.transpose());
    const Eigen::Matrix3d b = 0.5 * (B + B.transpose()), W = 0.5 * (B - B.transpose());
    return -lame.mu * (V * W + W * V - V * b - W * a - a * W - b * V) +
           lame.lambda * (V.cwiseProduct(W).sum() * Eigen::Matrix3d::Identity() + a.trace() * W + b.trace() * V);
  }

  /// Twists 2 mu + 2 (lambda (tr S - 3) - 2 mu) / (s_i + s_j), flips 2 mu, stretches 2 mu I + lambda 1 1^T.
  static PrincipalTangent principal_tangent(const Eigen::Vector3d& s, const LameParameters& lame) {
    PrincipalTangent principal;
    principal.stretch = 2 * lame.mu * Eigen::Matrix3d::Identity() + Eigen::Matrix3d::Constant(lame.lambda);
    principal.flip.setConstant(2 * lame.mu);
    const double turning = lame.lambda * (s.sum() - 3) - 2 * lame.mu;
    for (int k = 0; k < 3; ++k)
      principal.twist[k] = 2 * lame.mu + 2 * turning / std::max(s[(k + 1) % 3] + s[(k + 2) % 3], kLeastGap);
    return principal;
  }

 private:
  // R, F - R and tr S - 3.
  struct Parts {
    Eigen::Matrix3d rotation, stretch;
    double trace;
    explicit Parts(const Eigen::Matrix3d& H) {
      const Eigen::Matrix3d turned = polar_rotation_less_identity(H);
      rotation = Eigen::Matrix3d::Identity() + turned;
      stretch = H - turned;
      trace = rotation.cwiseProduct(stretch).sum();
    }
  };
};

}  // namespace exmat

#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "common/elastic/material.h"
#include "common/elastic/principal_tangent.h"
#include "common/elastic/st_venant_kirchhoff.h"

namespace exmat {

/// Stable neo-Hookean: Psi = mu'/2 (I_C - 3) + lambda'/2 (J - alpha)^2 - mu'/2 log(I_C + 1) less its value at rest,
/// with mu' = 4/3 mu, lambda' = lambda + 5/6 mu and alpha = 1 + 3/4 mu' / lambda'. Finite for every F, inverted or not.
/// Smith, de Goes and Kim 2018.
///
/// Evaluated by differences from rest: j = J - 1 and a = I_C - 3 from the Green strain, of which nothing of first order
/// is left.
struct StableNeoHookean {
  static double energy(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Parameters p(lame);
    const Invariants at(H);
    return 0.5 * p.lambda * at.j * at.j +
           0.5 * p.mu * (0.75 * at.j * at.j - 3 * at.second - 6 * at.third + log_remainder(0.25 * at.a));
  }

  static Eigen::Matrix3d first_piola_kirchhoff(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Parameters p(lame);
    const Invariants at(H);
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    // mu' 3/4 (F - cof F), mu' (1/4 - 1 / (I_C + 1)) F and lambda' (J - 1) cof F.
    const Eigen::Matrix3d shear = H + H.transpose() - H.trace() * I - cofactors(H);
    return 0.75 * p.mu * shear + 0.25 * p.mu * at.a / (4 + at.a) * (I + H) + p.lambda * at.j * cofactors(I + H);
  }

  /// mu' (1 - 1 / (I_C + 1)) I + 2 mu' / (I_C + 1)^2 F F + lambda' cof F cof F + (lambda' j - 3/4 mu') d cof F / dF.
  static Matrix9 tangent(const Eigen::Matrix3d& H, const LameParameters& lame) {
    const Parameters p(lame);
    const Invariants at(H);
    const Eigen::Matrix3d F = H + Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 9, 1> f = F.reshaped<Eigen::RowMajor>();
    const Eigen::Matrix<double, 9, 1> g = cofactors(F).reshaped<Eigen::RowMajor>();
    const double shear = p.mu * (3 + at.a) / (4 + at.a), pressure = p.lambda * at.j - 0.75 * p.mu;
    Matrix9 D = 2 * p.mu / ((4 + at.a) * (4 + at.a)) * f * f.transpose() + p.lambda * g * g.transpose();
    D.diagonal().array() += shear;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        // d cof_ab: + F of the next row and column, - of the next row and the one before.
        const int next_row = (a + 1) % 3, last_row = (a + 2) % 3, next = (b + 1) % 3, last = (b + 2) % 3;
        D(3 * a + b, 3 * next_row + next) += pressure * F(last_row, last);
        D(3 * a + b, 3 * last_row + last) += pressure * F(next_row, next);
        D(3 * a + b, 3 * next_row + last) -= pressure * F(last_row, next);
        D(3 * a + b, 3 * last_row + next) -= pressure * F(next_row, last);
      }
    return D;
  }

  /// Second-order terms of P: -3/4 mu' cof H + mu'/16 (H:H - t^2) I + mu'/8 t H + lambda' m I
  /// + lambda' t (t I - H^T), t = tr H, m = (t^2 - tr H^2) / 2.
  static Eigen::Matrix3d rest_second_derivative(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B,
                                                const LameParameters& lame) {
    const Parameters p(lame);
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const double a = A.trace(), b = B.trace();
    const double square = A.cwiseProduct(B).sum() - a * b, minors = a * b - (A * B).trace();
    // cof H = (H^2 - t H + m I)^T.
    const Eigen::Matrix3d cofactor = (A * B + B * A - a * B - b * A + minors * I).transpose();
    return -0.75 * p.mu * cofactor + 0.125 * p.mu * (square * I + a * B + b * A) + p.lambda * minors * I +
           p.lambda * (2 * a * b * I - a * B.transpose() - b * A.transpose());
  }

  /// Smith, de Goes and Kim 2018, section 4.
  static PrincipalTangent principal_tangent(const Eigen::Vector3d& s, const LameParameters& lame) {
    const Parameters p(lame);
    const double invariant = s.squaredNorm() + 1;
    const double shear = p.mu * (1 - 1 / invariant), pressure = p.lambda * (s.prod() - 1) - 0.75 * p.mu;
    const Eigen::Vector3d area(s[1] * s[2], s[2] * s[0], s[0] * s[1]);
    PrincipalTangent principal;
    principal.stretch = 2 * p.mu / (invariant * invariant) * s * s.transpose() + p.lambda * area * area.transpose();
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      principal.stretch(k, k) += shear;
      principal.stretch(i, j) += pressure * s[k];
      principal.stretch(j, i) += pressure * s[k];
    }
    principal.twist = shear + (pressure * s).array();
    principal.flip = shear - (pressure * s).array();
    return principal;
  }

 private:
  struct Parameters {
    double mu, lambda;
    explicit Parameters(const LameParameters& lame) : mu(4.0 / 3 * lame.mu), lambda(lame.lambda + 5.0 / 6 * lame.mu) {}
  };

  static Eigen::Matrix3d cofactors(const Eigen::Matrix3d& M) {
    Eigen::Matrix3d cofactors;
    for (int a = 0; a < 3; ++a) cofactors.row(a) = M.row((a + 1) % 3).cross(M.row((a + 2) % 3));
    return cofactors;
  }

  // a = I_C - 3, j = J - 1, and the second and third invariant of the Green strain: I_C = 3 + 2 tr E,
  // J^2 = 1 + 2 tr E + 4 second + 8 third.
  struct Invariants {
    double a, j, second, third;
    explicit Invariants(const Eigen::Matrix3d& H) {
      const Eigen::Matrix3d E = StVenantKirchhoff::green_strain(H);
      const double trace = E.trace(), J = (H + Eigen::Matrix3d::Identity()).determinant();
      a = 2 * trace;
      second = 0.5 * (trace * trace - E.squaredNorm());
      third = E.determinant();
      j = J > 0 ? (2 * trace + 4 * second + 8 * third) / (J + 1) : J - 1;
    }
  };

  // x - log(1 + x) without cancellation, x > -1.
  static double log_remainder(double x) {
    if (std::abs(x) > 0.1) return x - std::log1p(x);
    // log(1 + x) = 2 (z + z^3/3 + z^5/5 + ...), z = x / (2 + x).
    const double z = x / (2 + x), square = z * z;
    double series = 0;
    for (int n = 13; n >= 3; n -= 2) series = series * square + 1.0 / n;
    return z * (x - 2 * square * series);
  }
};

}  // namespace exmat

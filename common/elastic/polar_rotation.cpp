#include "common/elastic/polar_rotation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "common/elastic/principal_tangent.h"

namespace exmat {
namespace {

constexpr int kRefinements = 2;
constexpr double kLeastDeterminant = 1e-12;  // of the axes' stiffness, relative: then the rotation is not unique

Eigen::Matrix3d less_identity(const Eigen::Quaterniond& q) {
  const double w = q.w(), x = q.x(), y = q.y(), z = q.z();
  Eigen::Matrix3d half;
  half << -(y * y + z * z), x * y - w * z, x * z + w * y,  //
      x * y + w * z, -(x * x + z * z), y * z - w * x,      //
      x * z - w * y, y * z + w * x, -(x * x + y * y);
  return 2 * half;
}

}  // namespace

Eigen::Matrix3d polar_rotation_less_identity(const Eigen::Matrix3d& H) {
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const SignedSvd svd = signed_svd(H + I);
  Eigen::Quaterniond q(Eigen::Matrix3d(svd.U * svd.V.transpose()));
  if (q.w() < 0) q.coeffs() *= -1;
  // Newton's method for the largest tr(R^T F), by the difference F - R whose digits are those of H.
  for (int refinement = 0; refinement < kRefinements; ++refinement) {
    const Eigen::Matrix3d turned = less_identity(q);
    const Eigen::Matrix3d M = (I + turned).transpose() * (H - turned);
    const Eigen::Matrix3d S = I + 0.5 * (M + M.transpose());
    const Eigen::Matrix3d G = S.trace() * I - S;
    const Eigen::Vector3d skew(M(2, 1) - M(1, 2), M(0, 2) - M(2, 0), M(1, 0) - M(0, 1));
    const double size = S.norm();
    if (!(G.determinant() > kLeastDeterminant * size * size * size)) break;
    const Eigen::Vector3d half_turn = 0.5 * (G.inverse() * skew);
    q = q * Eigen::Quaterniond(1, half_turn[0], half_turn[1], half_turn[2]);
    q.normalize();
  }
  return less_identity(q);
}

}  // namespace exmat

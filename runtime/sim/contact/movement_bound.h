#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace exmat::runtime {

/// Bound on how far q moves any point of a body: the lesser of two, of which either is often many times the
/// other. r modes.
struct MovementBound {
  double norm = 0;           ///< the largest singular value of the rows of any point [kg^-1/2]
  Eigen::RowVectorXd modes;  ///< [r] how far each mode moves any point [kg^-1/2]

  /// By q [r], or how fast by v [m, m/s].
  template <typename Vector>
  double of(const Eigen::MatrixBase<Vector>& q) const noexcept {
    return std::min(norm * q.norm(), modes.dot(q.cwiseAbs()));
  }

  /// The largest `weights` . |q| of all q that this bounds by `way` [m]. `weights` [r] are 0 where modes are.
  double most(const Eigen::Ref<const Eigen::RowVectorXd>& weights, double way) const noexcept {
    double steepest = norm > 0 ? weights.norm() / norm : 0;
    for (Eigen::Index k = 0; k < modes.size(); ++k)
      if (modes[k] > 0) steepest = std::max(steepest, weights[k] / modes[k]);
    return way * steepest;
  }
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <mutex>
#include <optional>

#include "common/core/arrays.h"
#include "common/model/choices.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// The stiffness of cubature elements of St.Venant-Kirchhoff, a quadratic polynomial of q [r] whatever their number:
/// K_ij = K0_ij + C_ijk q_k + 1/2 D_ijkl q_k q_l. Of kLanes bodies side by side, who share its numbers. Immutable.
class StiffnessPolynomial {
 public:
  /// `gradient` [9s x r] is B; `mu` and `lambda` [s] are Lame's parameters times weights and volumes [N m]. r <=
  /// kMostPolynomialModes.
  StiffnessPolynomial(Eigen::Ref<const RowMatrix> gradient, Eigen::Ref<const Eigen::VectorXd> mu,
                      Eigen::Ref<const Eigen::VectorXd> lambda);

  /// stiffness [lane_triangle(r)] at q [r x kLanes].
  void evaluate_lanes(const double* q, Precision precision, double* stiffness) const noexcept;

  StiffnessPolynomialArrays arrays() const noexcept;

  /// Operations for one body.
  static double flops(Eigen::Index modes);

 private:
  Eigen::Index modes_ = 0;
  AlignedArray constant_, numbers_;
  AlignedArray rounded_;  ///< holds floats
};

/// One that is made when it is first asked for.
struct LazyStiffnessPolynomial {
  std::once_flag once;
  std::optional<StiffnessPolynomial> made;
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>

#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// The exact reduced energy of St.Venant-Kirchhoff, a quartic polynomial of q [r]. docs/method.md, "Exact polynomial";
/// Barbic and James 2005. With K3 = C q and K4 = 1/2 D q q (PolynomialData): stiffness K + K3 + K4, force (K + K3/2 +
/// K4/3) q, energy 1/2 q^T (K + K3/3 + K4/6) q. Immutable; all scratch is the caller's, no call allocates or throws.
class ReducedPolynomial {
 public:
  struct Workspace {
    AlignedArray pairs, cubic, quartic;  ///< R each: products q_i q_j (i > j) and q_i^2 / 2, K3, K4
  };

  explicit ReducedPolynomial(const PolynomialData& data);

  Workspace make_workspace() const;

  Eigen::Index modes() const { return modes_; }

  /// As ReducedElasticity; each costs about the same.
  double energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept;
  double force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept;
  double force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                             Eigen::MatrixXd& stiffness) const noexcept;

  double flops() const { return 2.0 * static_cast<double>(pairs() * (pairs() + modes_)); }
  double bytes() const { return static_cast<double>(sizeof(double) * (quartic_.size() + cubic_.size())); }

 private:
  Eigen::Index pairs() const { return modes_ * (modes_ + 1) / 2; }
  Eigen::Index blocks() const { return padded(pairs()) / kLanes; }
  double contract(const Eigen::VectorXd& q, Workspace& workspace) const noexcept;

  Eigen::Index modes_ = 0;
  AlignedArray stiffness_;  ///< R
  AlignedArray cubic_;      ///< padded(R) x r, by columns
  AlignedArray quartic_;    ///< see Kernels::symmetric_product
};

}  // namespace exmat::runtime

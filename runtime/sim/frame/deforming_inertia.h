#pragma once

#include <Eigen/Core>

#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// Rotation of a free body x = c + R (X + U q) by its moments: no sum over vertices. docs/step_in_detail.md, "Free
/// bodies". r modes; body frame. Second moments P_ab(q) = P0_ab + p1_ab . q + q^T S_ab q, inertia J = tr(P) I - P,
/// angular momentum of the deformation h_c = q^T A_c v, A_c = S_ab - S_ba with (c, a, b) cyclic. S_xx + S_yy + S_zz is
/// the mass of the modes, the identity. Immutable; no call allocates or throws.
class DeformingInertia {
 public:
  /// Moments that depend on q alone.
  struct Moments {
    Eigen::Index modes = 0;
    AlignedArray products;    ///< S_ab q of the six symmetric S_ab, and H^T: rotation_products()
    Eigen::Matrix3d inertia;  ///< J

    /// H^T [r x 3], H = dh/dv, column c = -A_c q.
    Eigen::Map<const Eigen::MatrixX3d> deformation() const noexcept {
      return {products.data() + rotation_turns(modes), modes, 3};
    }
    Eigen::Map<Eigen::MatrixX3d> deformation() noexcept { return {products.data() + rotation_turns(modes), modes, 3}; }
  };

  DeformingInertia() = default;
  explicit DeformingInertia(const RigidData& data);

  Moments make_moments() const;

  Eigen::Index modes() const { return linear_.rows(); }
  double mass() const { return mass_; }
  const Eigen::Vector3d& centre_of_mass() const { return centre_of_mass_; }  ///< at rest, world [m]

  void moments(const Eigen::VectorXd& q, Moments& moments) const noexcept;
  /// And turning_products() of another vector.
  void moments(const Eigen::VectorXd& q, const Eigen::VectorXd& other, Moments& moments,
               AlignedArray& other_products) const noexcept;

  /// `products` [padded(3 r)] = -A_c v, r each.
  void turning_products(const Eigen::VectorXd& v, AlignedArray& products) const noexcept;

  /// `force` [r] = d/dq (1/2 w^T J w) for the spin w, which is centrifugal, + sum_c of by_velocity_c A_c v + by_pose_c
  /// A_c q; `velocity_products` are turning_products() of v.
  void force(const Moments& moments, const AlignedArray& velocity_products, const Eigen::Vector3d& spin,
             const Eigen::Vector3d& by_velocity, const Eigen::Vector3d& by_pose, Eigen::VectorXd& force) const noexcept;

  /// `product` [r] = sum_c w_c A_c v; scratch padded(3 r).
  void gyroscopic_product(const Eigen::Vector3d& spin, const Eigen::VectorXd& v, AlignedArray& scratch,
                          Eigen::VectorXd& product) const noexcept;

  /// sum_c w_c A_c [r x r], antisymmetric, added `factor` times.
  void add_gyroscopic(const Eigen::Vector3d& spin, double factor, Eigen::MatrixXd& matrix) const noexcept;

  /// d2/dq2 (1/2 w^T J w) [r x r], positive semi-definite, added `factor` times to the lower triangle.
  void add_centrifugal(const Eigen::Vector3d& spin, double factor, Eigen::MatrixXd& matrix) const noexcept;

  /// True if the Hessian c_v^2 I + ... is to have what the centrifugal force takes from it: where that is neither so
  /// much that it could leave it indefinite nor too little to change an iteration.
  static bool softens(const Eigen::Vector3d& spin, double velocity_factor) noexcept;
  /// Adds what the centrifugal force takes, if softens().
  void add_softening(const Eigen::Vector3d& spin, double velocity_factor, Eigen::MatrixXd& hessian) const noexcept;

  /// Those of one body, and the constants of those of several.
  RotationArrays arrays() const noexcept;
  LaneRotationArrays lane_arrays() const noexcept;

 private:
  void set_inertia(const Eigen::Matrix<double, 6, 1>& changes, Moments& moments) const noexcept;

  static constexpr int kSymmetric = 6;
  static constexpr int kProducts = 9;

  double mass_ = 0;
  Eigen::Vector3d centre_of_mass_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second_moments_ = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 6, 1> pairs_ = Eigen::Matrix<double, 6, 1>::Zero();  ///< second moments at rest
  Eigen::MatrixXd linear_;                                                   ///< r x 6, p1_ab
  AlignedArray stacked_;                  ///< kProducts padded(r) x r by columns: S_ab and A_c
  AlignedArray panels_, turning_panels_;  ///< see RotationArrays
};

}  // namespace exmat::runtime

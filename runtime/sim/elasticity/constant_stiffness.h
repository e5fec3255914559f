#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// 1/2 x^T V x with a constant V [r x r], symmetric and positive semi-definite: the variance term of smoothed elements
/// (common/mesh/elements.h). Empty, and of no cost, where V is zero. Immutable; all scratch is the caller's, no call
/// allocates or throws.
class ConstantStiffness {
 public:
  ConstantStiffness() = default;
  /// `matrix` is V; one without entries counts as zero.
  explicit ConstantStiffness(const RowMatrix& matrix);

  bool empty() const { return modes_ == 0; }

  /// The value at x [r]; leaves V x in the scratch [padded(r)].
  double energy(const Eigen::VectorXd& x, double* scratch) const noexcept;
  /// Adds V x to `force` [r]. Returns the value.
  double add_force(const Eigen::VectorXd& x, double* scratch, Eigen::VectorXd& force) const noexcept;
  /// Adds V to the lower triangle of `stiffness` [r x r].
  void add_stiffness(Eigen::MatrixXd& stiffness) const noexcept;

  /// The same of kLanes bodies side by side (kernels.h): x, scratch and forces [r x kLanes], energies [kLanes],
  /// stiffness of lane_triangle(r) doubles.
  void add_lanes_energy(const double* x, double* scratch, double* energy) const noexcept;
  void add_lanes_force(const double* x, double* scratch, double* energy, double* force) const noexcept;
  void add_lanes_stiffness(double* stiffness) const noexcept;

 private:
  Eigen::Index modes_ = 0;
  AlignedArray columns_;   ///< padded(r) x r by columns
  AlignedArray triangle_;  ///< lane_triangle(r) / kLanes
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "common/elastic/material_model.h"
#include "common/model/choices.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/kernels/kernels.h"

namespace exmat::runtime {

/// Which tangent dP/dF a stiffness is built of.
enum class Tangent {
  kExact,
  kPositiveSemidefinite,  ///< negative eigenvalues of every element's 9 x 9 tangent set to zero, by its
                          ///< eigensystem where it is that of one material
};

/// The law of a material; its parameters are the caller's to set.
ElementLaw::Kind law_kind(MaterialModel model);

/// Sum over s elements of a law of the displacement gradients H_j = B_j x, x [r]: value, gradient and Hessian. Holds B
/// alone; the law comes with each call. Immutable; all scratch is the caller's, no call allocates or throws.
class ElementPotential {
 public:
  /// Sized once by make_workspace(); any ElementPotential of the same s and r may share it.
  struct Workspace {
    AlignedArray force, stiffness, tangents;
    AlignedArray constant;         ///< padded(r), of a ConstantStiffness beside the elements
    Eigen::VectorXd unused_force;  ///< r
  };

  ElementPotential() = default;

  /// `gradient` [9s x r] is B, row 3a + b of an element dF_ab/dx.
  explicit ElementPotential(const RowMatrix& gradient);

  Workspace make_workspace() const;

  Eigen::Index modes() const { return modes_; }
  Eigen::Index elements() const { return elements_; }
  Eigen::Index panels() const { return padded(elements_) / kLanes; }
  auto gradient() const {  ///< B [9s x r], a view
    return Eigen::Map<const RowMatrix, Eigen::Unaligned, Eigen::OuterStride<>>(
        by_element_.data(), 9 * elements_, modes_, Eigen::OuterStride<>(padded(modes_)));
  }

  double energy(const ElementLaw& law, const Eigen::VectorXd& x) const noexcept;

  /// `force` [r] = its derivative. Returns the energy.
  double force(const ElementLaw& law, const Eigen::VectorXd& x, Workspace& workspace,
               Eigen::VectorXd& force) const noexcept;

  /// And the lower triangle of `stiffness` [r x r]; the upper one is left as it was.
  double force_and_stiffness(const ElementLaw& law, const Eigen::VectorXd& x, Workspace& workspace,
                             Eigen::VectorXd& force, Eigen::MatrixXd& stiffness) const noexcept;

  /// That lower triangle alone.
  void stiffness(const ElementLaw& law, const Eigen::VectorXd& x, Tangent tangent, Workspace& workspace,
                 Eigen::MatrixXd& stiffness) const noexcept;

  /// The same for kLanes bodies side by side, by a law of one material: see Kernels.
  void lanes_energy(const ElementLaw& law, const double* x, double* energy) const noexcept {
    kernels().lanes_energy(arrays(), law, x, energy);
  }
  void lanes_force(const ElementLaw& law, const double* x, double* energy, double* force) const noexcept {
    kernels().lanes_force(arrays(), law, x, energy, force);
  }
  void lanes_force_and_stiffness(const ElementLaw& law, const double* x, Precision precision, double* energy,
                                 double* force, double* stiffness) const noexcept {
    const auto evaluate = precision == Precision::kMixed ? kernels().lanes_force_and_mixed_stiffness
                                                         : kernels().lanes_force_and_stiffness;
    evaluate(arrays(), law, x, energy, force, stiffness);
  }

  /// Floating-point operations: products with B, and half of the symmetric product B^T (D B). docs/step_in_detail.md,
  /// "Inner loops".
  double force_flops() const { return 36.0 * static_cast<double>(elements_ * modes_); }
  double stiffness_flops() const {
    return 162.0 * static_cast<double>(elements_ * modes_) +
           9.0 * static_cast<double>(elements_ * modes_ * (modes_ + 1));
  }
  /// Bytes of the constant arrays that one evaluation reads.
  double force_bytes() const { return static_cast<double>(sizeof(double) * by_mode_.size()); }
  double stiffness_bytes() const { return static_cast<double>(sizeof(double) * by_element_.size()); }

 private:
  ElementArrays arrays() const noexcept;
  void projected_tangents(const ElementLaw& law, const Eigen::VectorXd& x, AlignedArray& tangents) const noexcept;

  Eigen::Index elements_ = 0, modes_ = 0;
  AlignedArray by_mode_, by_element_;
  AlignedArray by_pair_;  ///< holds floats
};

}  // namespace exmat::runtime

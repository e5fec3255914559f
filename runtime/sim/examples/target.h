#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "common/core/arrays.h"
#include "common/core/error.h"
#include "common/model/reduced_model.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/elasticity/reduced_elasticity.h"
#include "runtime/sim/solver/newton.h"

namespace exmat::runtime {

/// Target p*(w) = argmin_p sum_k w_k E_k(p) over p = Z y, Z [r x d] a basis of the range of T^+ in which the stiffness
/// at rest is the identity, so that |y| is an energy norm. docs/step_in_detail.md, "Target". Immutable; no call of
/// solve() allocates or throws.
///
/// With F_jk as the undeformed shape, the Green strain of E_k is F_jk^-T (E - E_jk) F_jk^-1, linear in that of F_j(p):
/// sum_k w_k E_k of St.Venant-Kirchhoff is one quadratic form of E for each element, whatever the number of examples.
/// Other materials add up the examples, those of weight zero left out.
class TargetSolver {
 public:
  static constexpr int kMaxIterations = 50;

  struct Workspace {
    NewtonWorkspace newton;
    ElementPotential::Workspace elements;
    AlignedArray quadratic;      ///< quadratic form of the blended examples
    AlignedArray shift_weights;  ///< K
  };

  TargetSolver() = default;

  /// For K >= 1 examples. A complaint (without a file) where an example inverts a cubature element, det F_jk <= 0:
  /// names both.
  std::optional<Complaint> build(MaterialModel material, const CubatureData& cubature,
                                 const std::vector<ExampleData>& examples, const RowMatrix& target_basis,
                                 EnergyReference reference);

  Workspace make_workspace() const;

  Eigen::Index dimension() const { return basis_.cols(); }         ///< d
  Eigen::Index elements() const { return potential_.elements(); }  ///< s
  const ElementPotential& potential() const { return potential_; }
  const RowMatrix& basis() const { return basis_; }                             ///< Z [r x d]
  const Eigen::VectorXd& example(Eigen::Index k) const { return centres_[k]; }  ///< y_k [d]

  /// `y` [d] = sum_k w_k y_k, a start where there is no earlier target.
  void start(const Eigen::VectorXd& weights, Eigen::VectorXd& y) const noexcept;

  /// Improves `y` [d] towards the minimum by at most `max_iterations` of Newton's method; weights [K] >= 0.
  NewtonReport solve(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::VectorXd& y,
                     int max_iterations = kMaxIterations) const noexcept;

  /// sum_k w_k E_k [J], and its derivative by y.
  double energy(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace) const noexcept;
  double force(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace,
               Eigen::VectorXd& force) const noexcept;
  /// Lower triangle of the second derivative [d x d]; the upper one is left as it was.
  void hessian(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace,
               Eigen::MatrixXd& hessian) const noexcept;

 private:
  class Problem;

  Eigen::Index examples() const { return static_cast<Eigen::Index>(centres_.size()); }
  Eigen::Index quadratic_size() const { return potential_.panels() * kQuadraticNumbers * kLanes; }
  ElementLaw law(const Eigen::VectorXd& weights, Workspace& workspace) const noexcept;
  void set_quadratic(const CubatureData& cubature, const Eigen::VectorXd& displacement_gradients);
  void set_shift(Eigen::Index k, const Eigen::VectorXd& displacement_gradients);
  void set_inverse(Eigen::Index k, const Eigen::VectorXd& displacement_gradients);

  bool quadratic_ = false;  ///< one quadratic form serves: St.Venant-Kirchhoff and kExample
  ElementLaw::Kind material_ = ElementLaw::Kind::kStVenantKirchhoff;
  RowMatrix basis_;
  ElementPotential potential_;
  std::vector<Eigen::VectorXd> centres_;  ///< K, y_k [d]
  std::vector<AlignedArray> quadratics_;  ///< K, see ElementLaw; where one quadratic form serves
  WeightedLame lame_;                     ///< otherwise
  AlignedArray shifts_;                   ///< otherwise
  AlignedArray inverses_;                 ///< otherwise, kExample only
  double force_tolerance_ = 0;            ///< [J^1/2]
};

}  // namespace exmat::runtime

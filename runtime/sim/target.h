#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/core/arrays.h"
#include "common/core/error.h"
#include "common/model/reduced_model.h"
#include "runtime/sim/newton.h"
#include "runtime/sim/reduced_elasticity.h"

namespace exmat::runtime {

/// The undeformed shape of an example's energy. method.md, section 5.
enum class EnergyReference {
  kExample,  ///< E_k(p) = sum_j w_j V_j det F_jk Psi(F_j(p) F_jk^-1)
  kRest,     ///< E_k(p) = sum_j w_j V_j Psi(I + B_j (p - p_k))
};

/// Target p*(w) = argmin_p sum_k w_k E_k(p) over p = Z y, Z [r x d] a basis of the range of T^+ in which the stiffness
/// at rest is the identity, so that |y| is an energy norm. method.md, section 5. F_j(p) F_jk^-1 - I = B_j (p - p_k)
/// F_jk^-1 is linear in y - y_k, so that every E_k is a ReducedElasticity of y - y_k. Immutable; no call of solve()
/// allocates or throws.
class TargetSolver {
 public:
  struct Workspace {
    NewtonWorkspace newton;
    ReducedElasticity::Workspace elasticity;
    Eigen::VectorXd shifted, force;  ///< d
    Eigen::MatrixXd stiffness;       ///< d x d
  };

  TargetSolver() = default;

  /// For K >= 1 examples. A complaint (without a file) where an example inverts a cubature element, det F_jk <= 0:
  /// names both.
  std::optional<Complaint> build(Material material, const CubatureData& cubature,
                                 const std::vector<ExampleData>& examples, const RowMatrix& target_basis,
                                 EnergyReference reference);

  Workspace make_workspace() const;

  Eigen::Index dimension() const { return basis_.cols(); }                      ///< d
  const RowMatrix& basis() const { return basis_; }                             ///< Z [r x d]
  const Eigen::VectorXd& example(Eigen::Index k) const { return centres_[k]; }  ///< y_k [d]

  /// `y` [d] = sum_k w_k y_k, a start where there is no earlier target.
  void start(const Eigen::VectorXd& weights, Eigen::VectorXd& y) const noexcept;

  /// Improves `y` [d] to the minimum by Newton's method; weights [K] >= 0, examples of weight 0 cost nothing.
  NewtonReport solve(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::VectorXd& y) const noexcept;

  /// sum_k w_k E_k [J], and its derivative by y.
  double energy(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace) const noexcept;
  double force(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace,
               Eigen::VectorXd& force) const noexcept;

 private:
  class Problem;

  RowMatrix basis_;
  std::vector<ReducedElasticity> energies_;  ///< K, of y - y_k
  std::vector<Eigen::VectorXd> centres_;     ///< K, y_k [d]
  double force_tolerance_ = 0;               ///< [J^1/2]
};

}  // namespace exmat::runtime

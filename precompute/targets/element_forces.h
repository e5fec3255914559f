#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/targets/element_parts.h"
#include "precompute/targets/mesh_target.h"
#include "runtime/kernels/kernels.h"

namespace exmat::precompute {

/// The force of sum_k w_k E_k over all elements of a mesh, by the displacements of its vertices: what it takes does not
/// grow with elements times coordinates. With it a target of some of the elements becomes that of all. The same for
/// every number of threads.
class ElementForces {
 public:
  /// All but the coordinates must outlive this. Elements that an example turns inside out are left out where the
  /// energies start from examples.
  ElementForces(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                EnergyReference reference);

  const Elements& elements() const { return elements_; }
  const std::vector<Eigen::Index>& members() const { return members_; }  ///< that take part, ascending

  struct Answer {
    bool converged = false;
    double residual = 0;  ///< |force| in coordinates of unit stiffness at rest
  };

  /// Takes the columns of `y` [d x N], in the coordinates of a solver that some of the elements stand for all
  /// in, to the minima of all at `weights` [N x K]: quasi-Newton steps (BFGS) that begin with the solver's Hessian,
  /// side by side.
  std::vector<Answer> polish(const runtime::TargetSolver& solver, const RowMatrix& weights, Eigen::MatrixXd& y) const;

  /// [d x N] by the coordinates `p` [d x N], at weights [N x K].
  Eigen::MatrixXd forces(const RowMatrix& weights, const Eigen::MatrixXd& p) const;

 private:
  struct Batch;
  void add_forces(std::size_t part, Batch& batch) const;
  Eigen::MatrixXd forces_of_part(std::size_t part, const RowMatrix& weights, const Eigen::MatrixXd& p) const;

  const ObjectData& object_;
  EnergyReference reference_;
  Elements elements_;
  RowMatrix fields_;                       // 3n x d
  std::vector<Eigen::VectorXd> examples_;  // [3n] displacements
  std::vector<Eigen::Index> members_;
  std::vector<ElementPart> parts_;
};

}  // namespace exmat::precompute

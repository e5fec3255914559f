#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/targets/mesh_target.h"

namespace exmat::precompute {

/// The force of sum_k w_k E_k over all tets of a mesh, by the displacements of its vertices: what it takes does not
/// grow with tets times coordinates. With it a target of some of the tets becomes that of all.
class TetForces {
 public:
  /// All but the coordinates must outlive this. Tets that an example turns inside out are left out where the energies
  /// start from examples.
  TetForces(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
            EnergyReference reference);

  const std::vector<Eigen::Index>& tets() const { return tets_; }  ///< that take part, ascending

  struct Answer {
    bool converged = false;
    double residual = 0;  ///< |force| in coordinates of unit stiffness at rest
  };

  /// Takes `y`, in the coordinates of a solver that some of the tets or elements stand for all in, to the minimum of
  /// all: quasi-Newton steps (BFGS) that begin with the solver's Hessian.
  Answer polish(const runtime::TargetSolver& solver, const Eigen::VectorXd& weights,
                runtime::TargetSolver::Workspace& workspace, Eigen::VectorXd& y) const;

  /// [d] by the coordinates p.
  Eigen::VectorXd force(const Eigen::VectorXd& weights, const Eigen::VectorXd& p) const;

 private:
  const ObjectData& object_;
  EnergyReference reference_;
  RowMatrix fields_;                       // 3n x d
  std::vector<Eigen::VectorXd> examples_;  // [3n] displacements
  std::vector<Eigen::Index> tets_;
  std::vector<Eigen::Matrix3d> shapes_;  // of those: columns are the gradients of the shape functions of corners 1 to 3
  std::vector<LameParameters> lame_;     // times the volume
};

}  // namespace exmat::precompute

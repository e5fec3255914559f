#pragma once

#include <Eigen/Core>

#include "common/mesh/assembly.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// The frame that moves with a free body of n vertices: at its centre of mass c, turned by the rotation R that fits the
/// rest shape best in the mass. In it the deformation u = R^T (x - c) - X, X about the centre of mass at rest, has no
/// rigid part: sum m u = 0 and sum m X x u = 0, which are the conditions on a free body's modal basis. docs/method.md,
/// "Modal basis".
class FittedFrame {
 public:
  /// `mass` [n x n], weighted by density.
  FittedFrame(const TetMesh& mesh, const SparseMatrix& mass);

  /// Pose of the frame, and what its derivatives need.
  struct Placement {
    Eigen::Vector3d centre;    ///< c, world [m]
    Eigen::Matrix3d rotation;  ///< R
    VertexArray positions;     ///< n x 3, R^T (x - c)
    Eigen::Matrix3d spin;      ///< A^-1: angular velocity, in the frame, of sum m X x R^T x'
  };
  /// For world displacements [3n] from rest.
  Placement place(const Eigen::VectorXd& displacement) const;

  /// [3n] u.
  Eigen::VectorXd deformation(const Placement& placement) const;

  /// [3n] derivative J of u in a world direction [3n]: of velocities, the rate u' at which the body deforms.
  Eigen::VectorXd rate(const Placement& placement, const Eigen::VectorXd& direction) const;

  /// [3n] J^T g, world forces that do on any x' the work that g [3n] does on u'. Their sum and their torque are 0.
  Eigen::VectorXd force(const Placement& placement, const Eigen::VectorXd& g) const;

  /// [3n] components of a field in the world and in the frame.
  static Eigen::VectorXd to_world(const Placement& placement, const Eigen::VectorXd& field);
  static Eigen::VectorXd to_frame(const Placement& placement, const Eigen::VectorXd& field);

  double mass() const { return mass_; }
  const Eigen::Vector3d& centre_at_rest() const { return centre_; }

 private:
  double mass_ = 0;
  Eigen::Vector3d centre_;
  VertexArray rest_;         // X
  VertexArray mass_rest_;    // M X
  Eigen::VectorXd weights_;  // M 1 / mass
};

}  // namespace exmat::precompute

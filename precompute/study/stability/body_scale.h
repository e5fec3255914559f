#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/sim/step/model.h"
#include "runtime/sim/step/state.h"

namespace exmat::precompute {

/// Size and softness of a reduced body: the scales that bounds of its motion are made of.
struct BodyScale {
  double size = 0;                 ///< L, diagonal of the bounding box at rest [m]
  Eigen::MatrixXd rest_stiffness;  ///< r x r
  double reach = 0;                ///< largest |U_v q| over |q| in the norm of rest_stiffness [m J^-1/2], bound

  /// sqrt(f^T K^-1 f) of a generalised force [r]: the root of twice the energy that it holds the body at.
  double load_norm(const Eigen::VectorXd& force) const;
};

/// `vertices` [n x 3] at rest, `basis` [3n x r] of all of them.
BodyScale measure_scale(const VertexArray& vertices, const RowMatrix& basis, const runtime::InternalForce& elasticity);

/// The largest |U_v q| over |q| in the norm of `stiffness`.
double reach_of(const RowMatrix& basis, const Eigen::MatrixXd& stiffness);

/// The largest displacement of a vertex by q [m].
double largest_displacement(const RowMatrix& basis, const Eigen::VectorXd& q);

/// q of the displacements nearest to a field [n x 3] by least squares.
Eigen::VectorXd nearest_pose(const RowMatrix& basis, const VertexArray& field);

/// Random coordinates, the same each time, that displace a vertex by `reach` [m].
Eigen::VectorXd random_pose(const RowMatrix& basis, double reach);

/// The angular momentum of a free body about its centre of mass, world [kg m^2/s]. It is computed of the motion itself;
/// the state's own variable only stands for it.
Eigen::Vector3d angular_momentum(const runtime::DeformingInertia& inertia, const runtime::State& state);

}  // namespace exmat::precompute

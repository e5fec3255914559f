#pragma once

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"

namespace exmat::precompute {

/// Moments of a free body with basis U [3n x r] that its rigid motion needs, no sum over vertices at run time.
/// docs/method.md, section 6.
RigidData rigid_moments(const TetMesh& mesh, const Eigen::VectorXd& density, const RowMatrix& basis);

}  // namespace exmat::precompute

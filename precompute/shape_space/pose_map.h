#pragma once

#include "precompute/fem/elastic_system.h"
#include "precompute/modes/field_clamp.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// [3n x k] displacements of a clamped body about the mean of its fixed vertices: the constant function, which the
/// shape space leaves out, put back. Those of a free body, whose mean is 0, stay.
void hold_fixed_mean(const FlagVector& fixed, Eigen::Ref<Eigen::MatrixXd> displacements);

/// [3n x k] displacements V^(1/3) Phi Lambda^-1 of changes of descriptor [3m x k], entry 3i + axis, about the mean of
/// the fixed vertices as above.
Eigen::MatrixXd carried_fields(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                               const Eigen::MatrixXd& changes);

/// [f x 3m] free rows of the displacements that unit changes of descriptor stand for, column 3i + axis, of the whole
/// body: carried_fields() with the fixed vertices of a clamped body put back, by a FieldClamp. docs/method.md, "Direct
/// projection".
Eigen::MatrixXd whole_body_poses(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                                 const FieldClamp& clamp);

/// [r x 3m] reduced coordinates U^T M w of the poses w [f x 3m] of unit changes. `basis` is U, 3n x r. T^+ where w is
/// that of a free body as a whole.
RowMatrix pose_map(const Eigen::MatrixXd& poses, const ElasticSystem& system, const RowMatrix& basis);

}  // namespace exmat::precompute

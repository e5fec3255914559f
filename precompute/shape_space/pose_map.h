#pragma once

#include "precompute/fem/elastic_system.h"
#include "precompute/modes/field_clamp.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// [3n x k] displacements of a clamped body about the mean of its fixed vertices: the constant function, which the
/// shape space leaves out, put back. Those of a free body, whose mean is 0, stay.
void hold_fixed_mean(const FlagVector& fixed, Eigen::Ref<Eigen::MatrixXd> displacements);

/// [f x 3m] free rows of the displacements that changes of descriptor stand for, C V^(1/3) (Phi Lambda^-1 (x) I_3): C
/// puts the fixed vertices of a clamped body back, on the mean by hold_fixed_mean(), the rest by a FieldClamp.
/// method.md, sections 4 and 5.
Eigen::MatrixXd pose_fields(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                            const ElasticSystem& system, const FieldClamp& clamp);

/// [r x 3m] reduced coordinates of pose_fields(), U^T M times them: T^+ without C, and so for a free body, where
/// `reduced_from_shape` is returned. `basis` is U, 3n x r.
RowMatrix pose_map(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                   const ElasticSystem& system, const FieldClamp& clamp, const RowMatrix& basis,
                   const RowMatrix& reduced_from_shape);

}  // namespace exmat::precompute

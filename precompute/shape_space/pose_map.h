#pragma once

#include <functional>

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

/// [f x k] free rows of the displacements that changes of descriptor [3m x k], entry 3i + axis, stand for.
using PoseFields = std::function<Eigen::MatrixXd(const Eigen::MatrixXd& changes)>;

/// Those of the whole body: carried_fields() with the fixed vertices of a clamped body put back, by a FieldClamp.
/// docs/method.md, sections 4 and 5. All are kept by reference.
PoseFields whole_body_poses(const LaplaceBasis& object, const Eigen::VectorXd& weights, const FlagVector& fixed,
                            const FieldClamp& clamp);

/// [r x 3m] reduced coordinates U^T M w of the pose w that each unit change of descriptor stands for. `basis` is U,
/// 3n x r. T^+ where w is that of a free body as a whole.
RowMatrix pose_map(const PoseFields& poses, Eigen::Index functions, const ElasticSystem& system,
                   const RowMatrix& basis);

}  // namespace exmat::precompute

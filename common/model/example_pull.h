#pragma once

#include <cmath>

#include "common/model/reduced_model.h"

namespace exmat {

/// [r x 3m] U^T P of the displacements that a change of descriptor stands for, P = W W^T the filter of the example
/// force: T^+ where density is uniform, T^T s^2 elsewhere.
inline RowMatrix pull_from_shape(const ProjectionData& projection) {
  if (projection.filter_scale.size() == 0) return projection.reduced_from_shape;
  RowMatrix pull = projection.shape_from_reduced.transpose();
  for (Eigen::Index i = 0; i < pull.cols(); ++i) pull.col(i) *= std::pow(projection.filter_scale[i / 3], 2);
  return pull;
}

}  // namespace exmat

#pragma once

#include <optional>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/targets/target_space.h"

namespace exmat::precompute {

/// /full_space of a body with /object, /shape_space and /examples; `targets` are those of its whole-body examples.
/// Nothing where parts of it have other densities: the filter of the example force is not symmetric then. `elastic`:
/// with the shapes that an elastic force takes.
std::optional<FullSpaceData> full_space_data(const ReducedModel& model, const ElasticSystem& system,
                                             const TargetSpace& targets, bool elastic);

/// [m x 3] coefficients W^T u of displacements [3n].
Eigen::MatrixXd filter_coefficients(const FullSpaceData& data, const Eigen::VectorXd& displacements);

}  // namespace exmat::precompute

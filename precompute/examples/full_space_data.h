#pragma once

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/region_view.h"
#include "precompute/targets/target_space.h"

namespace exmat::precompute {

/// /full_space of examples, the whole body's or, with its `view`, a region's, of a body with /object and /shape_space;
/// `targets` are theirs. `elastic`: with the shapes that an elastic force takes.
FullSpaceData full_space_data(const ReducedModel& model, const ElasticSystem& system, const RegionView* view,
                              const ExampleSet& examples, const TargetSpace& targets, bool elastic);

/// [m x 3] coefficients W^T u of displacements [3n] that the examples see.
Eigen::MatrixXd filter_coefficients(const RowMatrix& filter, const Eigen::VectorXd& displacements);

}  // namespace exmat::precompute

#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/core/arrays.h"
#include "common/hdf5/value_checks.h"
#include "common/model/reduced_model.h"

namespace exmat {

// Checks of a table of targets beyond the schema.

/// Fault unless the rows are all vectors of integers >= 0 that add up to `degree`, lexicographic, descending.
std::optional<ValueFault> check_exponent_rows(std::int64_t degree, const IndexMatrix& rows);

/// Fault unless they begin at 0 and end at 1, with others between for two examples only.
std::optional<ValueFault> check_knots(const Eigen::VectorXd& knots, Eigen::Index examples);

/// The first fault of a skeleton whose arrays fit each other in size, or nothing.
struct PlacedFault {
  std::string place, expected, found;
};
std::optional<PlacedFault> skeleton_fault(const SkeletonData& skeleton);

/// Fault of the dataset `place` unless each row of these weights of bones adds up to 1.
std::optional<PlacedFault> bone_weights_fault(const std::string& place, const RowMatrix& weights);

}  // namespace exmat

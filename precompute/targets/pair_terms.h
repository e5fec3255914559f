#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/model/reduced_model.h"
#include "precompute/targets/target_table.h"

namespace exmat::precompute {

/// The table of the targets of many examples as terms of one and two of them. p*(w) is solved for between the rest pose
/// and each example, then at equal weights of any two; only of those whose targets are not the sum of their terms the
/// triangle with the rest pose is solved, too. Degrees grow until the error is within the tolerance, which what is left
/// out shares. The largest error found with two, three and more examples at once is that of the table, which may be
/// above the tolerance: what more than two examples do to each other is left out. Nothing where p*(w) was not found.
/// docs/method.md, "Targets of many examples". Otherwise as build_target_table().
std::optional<TargetTableData> build_pair_terms(const runtime::TargetSolver& target, const Eigen::MatrixXd& poses,
                                                const TargetTableOptions& options, TargetTableReport& report);

}  // namespace exmat::precompute

#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/targets/minimum_finder.h"
#include "precompute/targets/table_error.h"
#include "runtime/sim/examples/target.h"

namespace exmat::precompute {

inline constexpr int kPieceDegree = 7;  ///< needs about the fewest control points for errors of 1e-3 to 1e-6

struct PieceOptions {
  double tolerance = 0;  ///< largest error, as TargetTableData has it, at all samples
  Eigen::Index most_pieces = 0;
};

struct PieceReport {
  Eigen::Index pieces = 0;  ///< number in the last table
  double error = 0;         ///< error of the last table
  bool lost = false;        ///< p*(w) or its derivative was not found at some weights
};

/// The table of two examples in pieces of one degree, halved until the error at the nodes, at independent weights in
/// each piece and at `checks` is within the tolerance. At its ends a piece has the values and slopes of p*(w), which
/// makes the table C1: with the weights (1 - t, t), H dy/dt = grad E_0 - grad E_1, H the Hessian of the minimum. The
/// other control points are fitted by least squares. Nothing beyond the most pieces, or where a piece shorter than
/// 2^-20 is not enough, as at a jump. Of TargetTableData all but energy_reference. docs/method.md, "Table of targets".
std::optional<TargetTableData> build_target_pieces(const runtime::TargetSolver& target, const Eigen::MatrixXd& poses,
                                                   const TargetSamples& checks, const PieceOptions& options,
                                                   MinimumFinder& finder, PieceReport& report);

}  // namespace exmat::precompute

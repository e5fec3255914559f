#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/targets/minimum_finder.h"
#include "runtime/sim/examples/target.h"

namespace exmat::precompute {

/// Most examples, the rest pose among them, whose table is one polynomial of all weights; of more it is the sum of
/// terms of one and two.
inline constexpr std::int64_t kMostPolynomialExamples = 4;

struct TargetTableOptions {
  double tolerance = 1e-4;  ///< largest error, as TargetTableData has it [Limit: > 0]
  EnergyReference energy_reference = EnergyReference::kExample;
  int first_degree = 4;                    ///< to be tried
  int most_degree = 0;                     ///< limit for one polynomial; 0: 40 for K = 2, 24 for K = 3, 14 for K = 4
  std::int64_t most_pieces = 256;          ///< for K = 2
  const ElementForces* all = nullptr;      ///< forces of all elements, where the solver has a few: targets are of all
  MinimumFinder::Correction correction{};  ///< correction of the solver's targets; for one polynomial alone
};

/// One table that was tried, and its largest error at the weights of the check.
struct TargetFit {
  int degree = 0;
  double error = 0;
  std::int64_t pieces = 1;
};

struct TargetTableReport {
  std::string message;          ///< result in words, or why there is none and what to do
  int degree = 0;               ///< degree of the last fit
  std::int64_t pieces = 1;      ///< pieces of the last fit
  double error = 0;             ///< error of the last fit
  std::vector<TargetFit> fits;  ///< in order
  int solves = 0;               ///< number of times that p*(w) was solved for
  double seconds = 0;
};

/// The table of the targets of K >= 2 examples, whose poses [x x K] are those of the solver in
/// the x coordinates that it was built in; control points are in these. p*(w) is solved at the nodes of Isaac 2020 and
/// fitted by least squares, by polynomials of growing degree until the error as the run time decodes it, also at
/// further weights inside and on every edge and face of the simplex, is below the tolerance. Where no degree allowed
/// gets there, K = 2 takes pieces (target_pieces.h); otherwise there is nothing, as where p*(w) jumps from one minimum
/// to another. Of more than kMostPolynomialExamples see pair_terms.h. The same in every run and for every number of
/// threads. docs/method.md, "Table of targets".
std::optional<TargetTableData> build_target_table(const runtime::TargetSolver& target, const Eigen::MatrixXd& poses,
                                                  const TargetTableOptions& options, TargetTableReport& report);

/// Adds a linear function of the weights to the targets of a table: sum_k w_k times column k of `shifts` [r x K].
/// Exact, since Bernstein polynomials of any degree hold linear functions.
void shift_targets(const Eigen::MatrixXd& shifts, TargetTableData& table);

}  // namespace exmat::precompute

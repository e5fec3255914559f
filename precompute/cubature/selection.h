#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

namespace exmat::precompute {

/// Sparse non-negative least squares: few columns of A [rows x candidates] whose weighted sum is b.
struct SelectionProblem {
  Eigen::MatrixXd columns;  ///< A
  Eigen::VectorXd target;   ///< b
};

struct Selection {
  std::vector<Eigen::Index> members;  ///< columns, ascending
  Eigen::VectorXd weights;            ///< > 0, one per member
  double relative_residual = 0;       ///< |A w - b| / |b|
};

/// Called with the selection so far; true ends the search. Called after every `interval` added columns.
struct StopRule {
  std::size_t interval = 1;
  std::function<bool(const Selection&)> satisfied;
};

/// Greedy: add the column of largest normalised residual correlation, non-negative least squares on the support, until
/// `count` columns or the stop rule; then swaps while they help. Fewer columns come back only where no other can lower
/// the residual. `start` (of an earlier pass) may be empty. docs/method.md, section 3.2.
Selection select_greedy_swap(const SelectionProblem& problem, std::size_t count, const std::vector<Eigen::Index>& start,
                             const StopRule* stop);

/// The greedy of An et al. 2008, section 4: each round looks at 100 random candidates; no swaps.
Selection select_greedy_random(const SelectionProblem& problem, std::size_t count,
                               const std::vector<Eigen::Index>& start, const StopRule* stop, std::uint64_t seed);

/// Non-negative hard thresholding pursuit, von Tycowicz et al. 2013, section 5: gradient step, keep the `count`
/// largest, non-negative least squares on them, until the support repeats.
Selection select_hard_thresholding(const SelectionProblem& problem, std::size_t count);

}  // namespace exmat::precompute

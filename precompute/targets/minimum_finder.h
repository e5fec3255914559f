#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/arrays.h"
#include "precompute/targets/element_forces.h"
#include "runtime/sim/examples/target.h"

namespace exmat::precompute {

/// Answers nearer to each other than this share of a table's tolerance are one minimum.
inline constexpr double kSameMinimum = 0.1;

/// p*(w) in the coordinates y of TargetSolver: of the minima that several starts lead to, the lowest; from the blend of
/// the examples where none leads to one.
class MinimumFinder {
 public:
  using Starts = std::function<std::vector<Eigen::VectorXd>(const Eigen::VectorXd& weights, Eigen::Index row)>;

  /// Answers nearer to each other than `same_distance` in y are one minimum. Where the target is that of some tets,
  /// `all` makes them the minima of all.
  MinimumFinder(const runtime::TargetSolver& target, double same_distance, const ElementForces* all = nullptr)
      : target_(target), same_distance_(same_distance), all_(all) {}

  /// Starts are near minima of all tets: the target of some would lead away from them.
  void starts_are_near() { near_ = true; }

  /// A vector that is added to each answer.
  using Correction = std::function<Eigen::VectorXd(const Eigen::VectorXd& weights)>;
  void correct_by(Correction correction) { correction_ = std::move(correction); }

  /// [n x d] for weights [n x K], each found by itself; NaN where no start led to a minimum. `stage` names the work.
  RowMatrix find(const RowMatrix& weights, const Starts& starts, const std::string& stage);

  int solves() const { return solves_; }
  int ambiguous() const { return ambiguous_; }  ///< weights with more than one minimum

 private:
  struct Candidate {
    Eigen::Index row = 0;  ///< row of its weights
    Eigen::VectorXd y;
    bool found = true;
  };
  struct Minimum {
    Eigen::VectorXd y;
    bool found = false;
    bool only = true;  ///< all starts led to it
  };
  void descend(const RowMatrix& weights, std::vector<Candidate>& candidates) const;
  void add(const RowMatrix& weights, std::vector<Candidate> candidates, std::vector<Minimum>& minima) const;
  std::vector<Minimum> lowest(const RowMatrix& weights, const std::vector<std::vector<Eigen::VectorXd>>& starts) const;

  const runtime::TargetSolver& target_;
  double same_distance_;
  const ElementForces* all_;
  bool near_ = false;
  Correction correction_;
  int solves_ = 0;
  int ambiguous_ = 0;
};

/// sum_k w_k y_k.
Eigen::VectorXd blend(const runtime::TargetSolver& target, const Eigen::VectorXd& weights);

/// Starts from the blend alone. `target` must outlive them.
MinimumFinder::Starts from_blend(const runtime::TargetSolver& target);

/// The blend, then y_k of every example with a share in the weights.
std::vector<Eigen::VectorXd> blend_and_examples(const runtime::TargetSolver& target, const Eigen::VectorXd& weights);

}  // namespace exmat::precompute

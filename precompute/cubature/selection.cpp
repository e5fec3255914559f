#include "precompute/cubature/selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "common/core/decompositions.h"
#include "common/core/progress.h"

namespace exmat::precompute {
namespace {

constexpr int kSwapRounds = 100;
constexpr std::size_t kSwapTries = 3;        // members tried for removal each round
constexpr std::size_t kSwapCandidates = 64;  // columns whose exact gain is computed
constexpr double kSwapGain = 1e-6;           // of the squared residual, below which a swap is noise
constexpr std::size_t kRandomCandidates = 100;
constexpr int kThresholdingRounds = 50;
constexpr Eigen::Index kBlock = 64;          // columns of A that meet the new ones at once
constexpr double kCorrelationFloor = 1e-12;  // of |b|: no column helps any more

using Members = std::vector<Eigen::Index>;

// The normal equations of the problem, columns of G = A^T A computed when they are first asked for.
class NormalEquations {
 public:
  explicit NormalEquations(const SelectionProblem& problem) : problem_(problem) {
    const Eigen::Index n = problem.columns.cols();
    linear_.resize(n);
    norms_.resize(n);
#pragma omp parallel for schedule(static)
    for (Eigen::Index e = 0; e < n; ++e) {
      linear_[e] = problem.columns.col(e).dot(problem.target);
      norms_[e] = problem.columns.col(e).norm();
    }
    target_squared_ = problem.target.squaredNorm();
  }

  const Eigen::VectorXd& linear() const { return linear_; }
  const Eigen::VectorXd& norms() const { return norms_; }
  double target_squared() const { return target_squared_; }
  bool usable(Eigen::Index e) const { return norms_[e] > 0; }

  const Eigen::VectorXd& column(Eigen::Index e) {
    if (!columns_.contains(e)) compute({e});
    return columns_.at(e);
  }

  // Those that are not there yet, all in one pass over A.
  void compute(const Members& wanted) {
    Members missing;
    for (const Eigen::Index e : wanted)
      if (!columns_.contains(e)) missing.push_back(e);
    if (missing.empty()) return;
    const Eigen::Index n = linear_.size(), count = std::ssize(missing), blocks = (n + kBlock - 1) / kBlock;
    const Eigen::MatrixXd own = problem_.columns(Eigen::all, missing);
    Eigen::MatrixXd products(n, count);
#pragma omp parallel for schedule(static)
    for (Eigen::Index block = 0; block < blocks; ++block) {
      const Eigen::Index begin = block * kBlock, size = std::min(kBlock, n - begin);
      products.middleRows(begin, size).noalias() = problem_.columns.middleCols(begin, size).transpose() * own;
    }
    for (Eigen::Index k = 0; k < count; ++k) columns_[missing[static_cast<std::size_t>(k)]] = products.col(k);
  }

  // h - G w, the negative gradient.
  Eigen::VectorXd correlation(const Members& members, const Eigen::VectorXd& weights) {
    Eigen::VectorXd result = linear_;
    for (std::size_t k = 0; k < members.size(); ++k)
      result -= weights[static_cast<Eigen::Index>(k)] * column(members[k]);
    return result;
  }

 private:
  const SelectionProblem& problem_;
  Eigen::VectorXd linear_, norms_;
  double target_squared_ = 0;
  std::map<Eigen::Index, Eigen::VectorXd> columns_;
};

// A support with its non-negative least squares weights.
struct Support {
  Members members;
  Eigen::VectorXd weights;
  Eigen::MatrixXd gram;  // of the members

  bool contains(Eigen::Index e) const { return std::find(members.begin(), members.end(), e) != members.end(); }
  void add(NormalEquations& equations, Eigen::Index e) {
    members.push_back(e);
    const auto size = std::ssize(members);
    weights.conservativeResize(size);
    weights[size - 1] = 0;
    gram.conservativeResize(size, size);
    gram.col(size - 1) = equations.column(e)(members);
    gram.row(size - 1) = gram.col(size - 1).transpose();
  }
  void remove(std::size_t position) {
    const auto p = static_cast<Eigen::Index>(position), size = std::ssize(members);
    members.erase(members.begin() + p);
    Members kept(static_cast<std::size_t>(size));
    std::iota(kept.begin(), kept.end(), 0);
    kept.erase(kept.begin() + p);
    weights = Eigen::VectorXd(weights(kept));
    gram = Eigen::MatrixXd(gram(kept, kept));
  }
  double squared_residual(const NormalEquations& equations) const {
    const double linear = weights.dot(equations.linear()(members));
    return std::max(0.0, equations.target_squared() - 2 * linear + weights.dot(gram * weights));
  }
};

// Non-negative least squares on the support, from its feasible weights: Lawson and Hanson's inner loop. Zeros leave the
// support.
void fit_weights(const NormalEquations& equations, Support& support) {
  while (!support.members.empty()) {
    const Eigen::VectorXd rhs = equations.linear()(support.members);
    const Eigen::VectorXd free = support.gram.ldlt().solve(rhs);
    double step = 1;
    Eigen::Index blocking = -1;
    for (Eigen::Index k = 0; k < free.size(); ++k) {
      if (free[k] > 0) continue;
      const double limit = support.weights[k] > 0 ? support.weights[k] / (support.weights[k] - free[k]) : 0.0;
      if (blocking < 0 || limit < step) {
        step = limit;
        blocking = k;
      }
    }
    if (blocking < 0) {
      support.weights = free;
      return;
    }
    support.weights += step * (free - support.weights);
    support.remove(static_cast<std::size_t>(blocking));
  }
}

Selection finish(const NormalEquations& equations, const Support& support) {
  std::vector<std::size_t> order(support.members.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return support.members[a] < support.members[b]; });
  Selection selection;
  selection.weights.resize(static_cast<Eigen::Index>(order.size()));
  for (std::size_t k = 0; k < order.size(); ++k) {
    selection.members.push_back(support.members[order[k]]);
    selection.weights[static_cast<Eigen::Index>(k)] = support.weights[static_cast<Eigen::Index>(order[k])];
  }
  selection.relative_residual = std::sqrt(support.squared_residual(equations) / equations.target_squared());
  return selection;
}

// The usable column outside the support of largest correlation per norm among the offered ones, or -1.
template <typename Candidates>
Eigen::Index best_candidate(const NormalEquations& equations, const Eigen::VectorXd& correlation,
                            const Support& support, const Candidates& candidates) {
  Eigen::Index best = -1;
  double best_score = kCorrelationFloor * std::sqrt(equations.target_squared());
  for (const Eigen::Index e : candidates) {
    if (!equations.usable(e)) continue;
    const double score = correlation[e] / equations.norms()[e];
    if (score > best_score && !support.contains(e)) {
      best_score = score;
      best = e;
    }
  }
  return best;
}

// Grows the support to `count` members; `offer` gives the candidates of a round.
template <typename Offer>
void grow(NormalEquations& equations, Support& support, std::size_t count, const StopRule* stop, const Offer& offer) {
  Progress progress("cubature elements", static_cast<std::int64_t>(count));
  for (std::size_t round = 0; support.members.size() < count && round < 20 * count; ++round) {
    progress.reach(static_cast<std::int64_t>(support.members.size()));
    const auto correlation = equations.correlation(support.members, support.weights);
    const Eigen::Index next = best_candidate(equations, correlation, support, offer());
    if (next < 0) break;
    support.add(equations, next);
    fit_weights(equations, support);
    if (stop != nullptr && support.members.size() % stop->interval == 0 && stop->satisfied(finish(equations, support)))
      break;
  }
}

// G^-1 of the members.
Eigen::MatrixXd inverse_of(const Support& support) {
  const auto size = std::ssize(support.members);
  return support.gram.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
}

// Rise of the squared residual where a member is removed: w_i^2 / (G^-1)_ii.
Eigen::VectorXd costs_of_removal(const Support& support, const Eigen::MatrixXd& inverse) {
  return support.weights.cwiseAbs2().cwiseQuotient(inverse.diagonal().cwiseMax(1e-300));
}

// Positions of the members of least cost.
std::vector<std::size_t> cheapest_members(const Eigen::VectorXd& costs) {
  std::vector<std::size_t> order(static_cast<std::size_t>(costs.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return costs[static_cast<Eigen::Index>(a)] < costs[static_cast<Eigen::Index>(b)];
  });
  order.resize(std::min(order.size(), kSwapTries));
  return order;
}

// The support without a member, and G^-1 of what is left, from that of all: no factorisation where all weights stay
// positive.
struct Removal {
  Support support;
  Eigen::MatrixXd inverse;
  bool all_stay = true;

  Removal(const NormalEquations& equations, const Support& from, const Eigen::MatrixXd& inverse_of_all,
          std::size_t position)
      : support(from) {
    const auto p = static_cast<Eigen::Index>(position);
    const Eigen::VectorXd along = inverse_of_all.col(p) / inverse_of_all(p, p);
    support.weights -= from.weights[p] * along;
    const Eigen::MatrixXd whole = inverse_of_all - along * inverse_of_all.row(p);
    support.remove(position);
    all_stay = support.weights.size() == 0 || support.weights.minCoeff() > 0;
    if (all_stay) {
      Members kept(from.members.size());
      std::iota(kept.begin(), kept.end(), 0);
      kept.erase(kept.begin() + p);
      inverse = whole(kept, kept);
      return;
    }
    support = from;
    support.remove(position);
    fit_weights(equations, support);
    inverse = inverse_of(support);
  }
};

// A column outside the support and what its addition lowers the squared residual by, as far as weights stay positive:
// g^2 / Schur complement, the largest among those of largest g^2 / G_ee.
struct Gain {
  Eigen::Index column = -1;
  double squared = 0;
};

Gain best_gain(NormalEquations& equations, const Removal& removal, const Eigen::VectorXd& correlation) {
  const Members& members = removal.support.members;
  Members candidates;
  for (Eigen::Index e = 0; e < correlation.size(); ++e)
    if (equations.usable(e) && correlation[e] > 0 && !removal.support.contains(e)) candidates.push_back(e);
  const auto score = [&](Eigen::Index e) { return correlation[e] / equations.norms()[e]; };
  const std::size_t kept = std::min(candidates.size(), kSwapCandidates);
  std::partial_sort(
      candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(kept), candidates.end(),
      [&](Eigen::Index a, Eigen::Index b) { return score(a) > score(b) || (score(a) == score(b) && a < b); });
  candidates.resize(kept);
  Eigen::MatrixXd couplings(std::ssize(members), std::ssize(candidates));
  for (std::size_t k = 0; k < members.size(); ++k)
    couplings.row(static_cast<Eigen::Index>(k)) = equations.column(members[k])(candidates).transpose();
  const Eigen::RowVectorXd shared = couplings.cwiseProduct(removal.inverse * couplings).colwise().sum();
  Gain best;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Eigen::Index e = candidates[i];
    const double own = equations.norms()[e] * equations.norms()[e];
    const double schur = std::max(own - shared[static_cast<Eigen::Index>(i)], 1e-12 * own);
    const double gain = correlation[e] * correlation[e] / schur;
    if (gain > best.squared) best = {e, gain};
  }
  return best;
}

// One accepted swap, or false.
bool swap_once(NormalEquations& equations, Support& support, double& squared) {
  const Eigen::MatrixXd inverse = inverse_of(support);
  const Eigen::VectorXd costs = costs_of_removal(support, inverse);
  const double wanted = (1 - kSwapGain) * squared;
  for (const std::size_t position : cheapest_members(costs)) {
    Removal removal(equations, support, inverse, position);
    Support& trial = removal.support;
    const Gain gain = best_gain(equations, removal, equations.correlation(trial.members, trial.weights));
    if (gain.column < 0) continue;
    // Weights that would be negative leave more than this, never less.
    if (removal.all_stay && squared + costs[static_cast<Eigen::Index>(position)] - gain.squared >= wanted) continue;
    trial.add(equations, gain.column);
    fit_weights(equations, trial);
    const double trial_squared = trial.squared_residual(equations);
    if (trial_squared >= wanted) continue;
    support = std::move(trial);
    squared = trial_squared;
    return true;
  }
  return false;
}

Support initial_support(NormalEquations& equations, const Members& start) {
  Support support;
  equations.compute(start);
  for (const Eigen::Index e : start) {
    support.add(equations, e);
    fit_weights(equations, support);
  }
  return support;
}

}  // namespace

Selection select_greedy_swap(const SelectionProblem& problem, std::size_t count, const std::vector<Eigen::Index>& start,
                             const StopRule* stop) {
  NormalEquations equations(problem);
  Support support = initial_support(equations, start);
  Members all(static_cast<std::size_t>(problem.columns.cols()));
  std::iota(all.begin(), all.end(), 0);
  const auto offer_all = [&all]() -> const Members& { return all; };
  const auto improve = [&] {
    const std::size_t reached = support.members.size();
    double squared = support.squared_residual(equations);
    for (int round = 0; round < kSwapRounds && swap_once(equations, support, squared); ++round) {
      // A swap may drop members whose weights became zero: their places are filled again.
      grow(equations, support, reached, nullptr, offer_all);
      squared = support.squared_residual(equations);
    }
  };
  // Swaps fit the training poses better, and may break the stop rule's measure: then the support grows on.
  for (;;) {
    const std::size_t before = support.members.size();
    grow(equations, support, count, stop, offer_all);
    improve();
    const bool open = stop != nullptr && support.members.size() < count && support.members.size() > before;
    if (!open || stop->satisfied(finish(equations, support))) break;
  }
  return finish(equations, support);
}

Selection select_greedy_random(const SelectionProblem& problem, std::size_t count,
                               const std::vector<Eigen::Index>& start, const StopRule* stop, std::uint64_t seed) {
  NormalEquations equations(problem);
  Support support = initial_support(equations, start);
  std::mt19937_64 generator(seed);
  std::uniform_int_distribution<Eigen::Index> any(0, problem.columns.cols() - 1);
  grow(equations, support, count, stop, [&]() {
    Members candidates(kRandomCandidates);
    std::generate(candidates.begin(), candidates.end(), [&]() { return any(generator); });
    return candidates;
  });
  return finish(equations, support);
}

Selection select_hard_thresholding(const SelectionProblem& problem, std::size_t count) {
  NormalEquations equations(problem);
  // Columns are taken as normalised: one step length suits all of them.
  const Eigen::VectorXd scale = equations.norms().unaryExpr([](double norm) { return norm > 0 ? 1 / norm : 0.0; });
  Support support, best;
  double best_squared = std::numeric_limits<double>::infinity();
  std::set<Members> seen;
  for (int round = 0; round < kThresholdingRounds; ++round) {
    const Eigen::VectorXd gradient = scale.cwiseProduct(equations.correlation(support.members, support.weights));
    // Normalised step: |g_S|^2 / |A g_S|^2 over the support, or over the `count` largest entries before there is one.
    Eigen::VectorXd point = Eigen::VectorXd::Zero(gradient.size());
    for (std::size_t k = 0; k < support.members.size(); ++k)
      point[support.members[k]] = support.weights[static_cast<Eigen::Index>(k)] / scale[support.members[k]];
    Members order(static_cast<std::size_t>(gradient.size()));
    std::iota(order.begin(), order.end(), 0);
    const auto largest_first = [&order, count](const Eigen::VectorXd& values) {
      std::stable_sort(order.begin(), order.end(),
                       [&values](Eigen::Index a, Eigen::Index b) { return values[a] > values[b]; });
      return Members(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(std::min(count, order.size())));
    };
    const Members directions = support.members.empty() ? largest_first(gradient) : support.members;
    const Eigen::VectorXd along = gradient(directions);
    const Eigen::VectorXd image = problem.columns(Eigen::all, directions) * along.cwiseProduct(scale(directions));
    const double curvature = image.squaredNorm();
    if (curvature > 0) point += along.squaredNorm() / curvature * gradient;
    Support next;
    const Members largest = largest_first(point);
    equations.compute(largest);
    for (const Eigen::Index e : largest)
      if (point[e] > 0) {
        next.add(equations, e);
        next.weights[next.weights.size() - 1] = point[e] * scale[e];
      }
    fit_weights(equations, next);
    support = next;
    const double squared = support.squared_residual(equations);
    if (squared < best_squared) {
      best_squared = squared;
      best = support;
    }
    Members key = support.members;
    std::sort(key.begin(), key.end());
    if (!seen.insert(key).second) break;
  }
  return finish(equations, best);
}

}  // namespace exmat::precompute

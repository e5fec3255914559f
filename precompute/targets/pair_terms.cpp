#include "precompute/targets/pair_terms.h"

#include <algorithm>
#include <fmt/format.h>
#include <utility>
#include <vector>

#include "common/core/decompositions.h"
#include "precompute/targets/simplex_points.h"
#include "precompute/targets/table_error.h"
#include "runtime/sim/examples/bernstein_basis.h"
#include "runtime/sim/examples/target_table.h"

namespace exmat::precompute {
namespace {

using runtime::BernsteinBasis;
using runtime::TargetSolver;

constexpr int kMostSingleDegree = 8;
constexpr double kTermOversampling = 1.25;  // degree of the nodes over that of a term
constexpr int kPairDegrees[] = {4, 7, 10};  // that the nodes of a pair are for
// A term's share of the tolerance. Terms of pairs add up to no more than twice the largest that is left out, since they
// are 4 w_k w_l of it and the weights add up to 1.
constexpr double kTermShare = 0.3;
constexpr int kTermChecks = 48;  // weights of each number of examples at once
constexpr int kExamplesAtOnce[] = {2, 3, 5, 10};

// Values of Bernstein polynomials [n x N] of the weights of some examples and of what they leave.
struct Term {
  std::vector<Eigen::Index> members;  ///< one or two
  IndexMatrix exponents;              ///< N x (members + 1), of what they leave first
  RowMatrix control_points;           ///< N x d, in y
};

// Those that are zero where a weight of a member is; in the order of the bundle.
IndexMatrix term_exponents(int degree, int members) {
  std::vector<Eigen::Vector3i> rows;
  for (int a = 1; a <= degree; ++a) {
    if (members == 1) rows.emplace_back(degree - a, a, 0);
    for (int b = 1; members == 2 && b <= degree - a; ++b) rows.emplace_back(degree - a - b, a, b);
  }
  IndexMatrix exponents(std::ssize(rows), members + 1);
  for (Eigen::Index i = 0; i < exponents.rows(); ++i)
    exponents.row(i) = rows[static_cast<std::size_t>(i)].head(members + 1).transpose();
  return exponents;
}

Eigen::MatrixXd term_values(const IndexMatrix& exponents, const RowMatrix& local) {
  const BernsteinBasis basis(exponents.row(0).sum(), static_cast<int>(exponents.cols()));
  const Eigen::MatrixXd all = collocation(basis, local);
  Eigen::MatrixXd values(local.rows(), exponents.rows());
  for (Eigen::Index i = 0; i < exponents.rows(); ++i)
    values.col(i) = all.col(basis.number(exponents.row(i).transpose()));
  return values;
}

// Nodes where no member's weight is zero.
RowMatrix term_nodes(int degree, int members) {
  const RowMatrix all = interpolation_nodes(BernsteinBasis(degree, members + 1).exponents());
  std::vector<Eigen::Index> inside;
  for (Eigen::Index i = 0; i < all.rows(); ++i)
    if ((all.row(i).tail(members).array() > 0).all()) inside.push_back(i);
  return all(inside, Eigen::all);
}

int node_degree(int degree) { return static_cast<int>(kTermOversampling * degree + 0.999); }

class TermBuilder {
 public:
  TermBuilder(const TargetSolver& target, const Eigen::MatrixXd& poses, const TargetTableOptions& options,
              TargetTableReport& report)
      : target_(target),
        poses_(poses),
        options_(options),
        report_(report),
        examples_(poses.cols()),
        error_(target, examples_),
        enough_(kTermShare * options.tolerance * error_.scale()),
        finder_(target, kSameMinimum * options.tolerance * error_.scale(), options.all) {}

  std::optional<TargetTableData> run();

 private:
  RowMatrix spread(const std::vector<std::vector<Eigen::Index>>& members, const RowMatrix& local) const;
  RowMatrix sum(const RowMatrix& weights) const;
  bool solve(const std::vector<std::vector<Eigen::Index>>& members, const RowMatrix& local, const char* stage,
             RowMatrix& rest);
  double fit(const RowMatrix& local, const RowMatrix& rest, Term& term) const;
  bool add_single_terms();
  bool add_pair_terms();
  bool add_parabolas(const RowMatrix& middle, const RowMatrix& rest_of_all,
                     std::vector<std::vector<Eigen::Index>>& left, std::vector<Term>& found);
  Eigen::Index pair_number(const std::vector<Eigen::Index>& pair) const {  ///< in lexicographic order
    const Eigen::Index k = pair[0] - 1, count = examples_ - 1;
    return k * (2 * count - k - 1) / 2 + pair[1] - pair[0] - 1;
  }
  TargetTableData table() const;
  TargetSamples checks();
  std::string message(const TargetTableData& data, const Eigen::VectorXd& errors) const;

  const TargetSolver& target_;
  const Eigen::MatrixXd& poses_;
  const TargetTableOptions& options_;
  TargetTableReport& report_;
  Eigen::Index examples_;  ///< K
  TableError error_;
  double enough_;  ///< distance in y that a term may be off
  MinimumFinder finder_;
  std::vector<Term> terms_;
  std::size_t pairs_ = 0;
};

// Weights of all examples [members * n x K] from those of members and what they leave.
RowMatrix TermBuilder::spread(const std::vector<std::vector<Eigen::Index>>& members, const RowMatrix& local) const {
  RowMatrix weights = RowMatrix::Zero(std::ssize(members) * local.rows(), examples_);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    const auto& own = members[static_cast<std::size_t>(i / local.rows())];
    const auto at = local.row(i % local.rows());
    weights(i, 0) = at[0];
    for (std::size_t m = 0; m < own.size(); ++m) weights(i, own[m]) = at[static_cast<Eigen::Index>(m) + 1];
  }
  return weights;
}

// The terms so far [n x d], in y.
RowMatrix TermBuilder::sum(const RowMatrix& weights) const {
  RowMatrix y = RowMatrix::Zero(weights.rows(), target_.dimension());
  y.rowwise() += target_.example(0).transpose();
  for (const Term& term : terms_) {
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < weights.rows(); ++i)
      if (std::ranges::all_of(term.members, [&](Eigen::Index k) { return weights(i, k) > 0; })) rows.push_back(i);
    if (rows.empty()) continue;
    RowMatrix local(std::ssize(rows), std::ssize(term.members) + 1);
    for (std::size_t m = 0; m < term.members.size(); ++m)
      local.col(static_cast<Eigen::Index>(m) + 1) = weights(rows, term.members[m]);
    local.col(0) = 1 - local.rightCols(std::ssize(term.members)).rowwise().sum().array();
    y(rows, Eigen::all) += term_values(term.exponents, local) * term.control_points;
  }
  return y;
}

// What the terms so far leave of the targets of some examples; false where one was not found.
bool TermBuilder::solve(const std::vector<std::vector<Eigen::Index>>& members, const RowMatrix& local,
                        const char* stage, RowMatrix& rest) {
  const RowMatrix weights = spread(members, local), before = sum(weights);
  const auto starts = [&](const Eigen::VectorXd&, Eigen::Index row) {
    return std::vector<Eigen::VectorXd>{before.row(row).transpose()};
  };
  rest = finder_.find(weights, starts, stage) - before;
  return rest.allFinite();
}

// By least squares; largest distance at the nodes.
double TermBuilder::fit(const RowMatrix& local, const RowMatrix& rest, Term& term) const {
  const Eigen::MatrixXd values = term_values(term.exponents, local);
  term.control_points = values.householderQr().solve(Eigen::MatrixXd(rest));
  return (values * term.control_points - rest).rowwise().norm().maxCoeff();
}

// The control point at a corner is the example itself, which the last node is.
bool TermBuilder::add_single_terms() {
  std::vector<std::vector<Eigen::Index>> members;
  for (Eigen::Index k = 1; k < examples_; ++k) members.push_back({k});
  const RowMatrix local = term_nodes(node_degree(kMostSingleDegree), 1);
  const RowMatrix weights = spread(members, local);
  const RowMatrix minima = finder_.find(weights, from_blend(target_), "targets of one example");
  if (!minima.allFinite()) return false;
  for (std::size_t k = 0; k < members.size(); ++k) {
    const RowMatrix own = minima.middleRows(static_cast<Eigen::Index>(k) * local.rows(), local.rows());
    const Eigen::RowVectorXd corner = (target_.example(members[k][0]) - target_.example(0)).transpose();
    Term best;
    for (int degree = 1; degree <= kMostSingleDegree; ++degree) {
      Term term{members[k], term_exponents(degree, 1), {}};
      const Eigen::MatrixXd values = term_values(term.exponents, local);
      const RowMatrix rest = own.rowwise() - target_.example(0).transpose();
      term.control_points.resize(degree, rest.cols());
      term.control_points.row(degree - 1) = corner;
      if (degree > 1)
        term.control_points.topRows(degree - 1) =
            values.leftCols(degree - 1).householderQr().solve(Eigen::MatrixXd(rest - values.col(degree - 1) * corner));
      best = std::move(term);
      if ((values * best.control_points - rest).rowwise().norm().maxCoeff() <= enough_) break;
    }
    terms_.push_back(std::move(best));
  }
  return true;
}

// Many pairs need one control point: that which is right at equal weights, where it is so nearer to each of the three
// corners, too. Leaves the others; false where a target was not found.
bool TermBuilder::add_parabolas(const RowMatrix& middle, const RowMatrix& rest_of_all,
                                std::vector<std::vector<Eigen::Index>>& left, std::vector<Term>& found) {
  const RowMatrix others = (RowMatrix(3, 3) << 0.4, 0.3, 0.3, 0, 0.25, 0.75, 0, 0.75, 0.25).finished();
  RowMatrix rest;
  if (!solve(left, others, "targets of two examples", rest)) return false;
  std::vector<std::vector<Eigen::Index>> open;
  for (std::size_t i = 0; i < left.size(); ++i) {
    Term term{left[i], term_exponents(2, 2), {}};
    fit(middle, rest_of_all.row(pair_number(left[i])), term);
    const RowMatrix there = term_values(term.exponents, others) * term.control_points;
    const auto own = rest.middleRows(static_cast<Eigen::Index>(i) * others.rows(), others.rows());
    if ((there - own).rowwise().norm().maxCoeff() <= enough_)
      found.push_back(std::move(term));
    else
      open.push_back(left[i]);
  }
  left = std::move(open);
  return true;
}

bool TermBuilder::add_pair_terms() {
  std::vector<std::vector<Eigen::Index>> members, left;
  for (Eigen::Index k = 1; k < examples_; ++k)
    for (Eigen::Index l = k + 1; l < examples_; ++l) members.push_back({k, l});
  RowMatrix rest;
  const RowMatrix middle = Eigen::RowVector3d(0, 0.5, 0.5);
  if (!solve(members, middle, "targets of any two examples", rest)) return false;
  for (std::size_t i = 0; i < members.size(); ++i)
    if (rest.row(static_cast<Eigen::Index>(i)).norm() > enough_) left.push_back(members[i]);
  pairs_ = left.size();
  std::vector<Term> found;
  if (!add_parabolas(middle, rest, left, found)) return false;
  for (const int most : kPairDegrees) {
    if (left.empty()) break;
    const RowMatrix local = term_nodes(node_degree(most), 2);
    if (!solve(left, local, "targets of two examples", rest)) return false;
    std::vector<std::vector<Eigen::Index>> open;
    for (std::size_t i = 0; i < left.size(); ++i) {
      const RowMatrix own = rest.middleRows(static_cast<Eigen::Index>(i) * local.rows(), local.rows());
      for (int degree = 2; degree <= most; ++degree) {
        Term term{left[i], term_exponents(degree, 2), {}};
        const bool fits = fit(local, own, term) <= enough_;
        if (!fits && degree == most && most != std::ranges::max(kPairDegrees))
          open.push_back(left[i]);
        else if (fits || degree == most)
          found.push_back(std::move(term));
        if (fits) break;
      }
    }
    left = std::move(open);
  }
  std::ranges::sort(found, {}, &Term::members);
  terms_.insert(terms_.end(), std::make_move_iterator(found.begin()), std::make_move_iterator(found.end()));
  return true;
}

TargetTableData TermBuilder::table() const {
  TargetTableData data;
  Eigen::Index rows = 1;
  for (const Term& term : terms_) rows += term.exponents.rows();
  data.energy_reference = options_.energy_reference;
  data.exponents = IndexMatrix::Zero(rows, examples_);
  data.control_points.resize(rows, poses_.rows());
  data.control_points.row(0) = poses_.col(0).transpose();
  Eigen::Index row = 1;
  for (const Term& term : terms_) {
    const Eigen::Index count = term.exponents.rows();
    data.degree = std::max<std::int64_t>(data.degree, term.exponents.row(0).sum());
    data.exponents.block(row, 0, count, 1) = term.exponents.col(0);
    for (std::size_t m = 0; m < term.members.size(); ++m)
      data.exponents.block(row, term.members[m], count, 1) = term.exponents.col(static_cast<Eigen::Index>(m) + 1);
    data.control_points.middleRows(row, count) = term.control_points * target_.basis().transpose();
    row += count;
  }
  return data;
}

TargetSamples TermBuilder::checks() {
  RowMatrix weights(0, examples_);
  for (const int together : kExamplesAtOnce) {
    weights.conservativeResize(weights.rows() + kTermChecks, Eigen::NoChange);
    weights.bottomRows(kTermChecks) =
        some_together(examples_, together, kTermChecks, static_cast<std::uint64_t>(together));
  }
  return {weights, finder_.find(weights, from_blend(target_), "targets to check the table by")};
}

std::string TermBuilder::message(const TargetTableData& data, const Eigen::VectorXd& errors) const {
  std::string by_number;
  for (std::size_t i = 0; i < std::size(kExamplesAtOnce); ++i)
    by_number += fmt::format("{}{:.2g} of {}", i == 0 ? "" : ", ",
                             errors.segment(static_cast<Eigen::Index>(i) * kTermChecks, kTermChecks).maxCoeff(),
                             kExamplesAtOnce[i]);
  return fmt::format(
      "table of targets: {} of {} pairs of examples are not the sum of the two, {} control points, errors {} at once "
      "(tolerance {:.2g}){}",
      pairs_, (examples_ - 1) * (examples_ - 2) / 2, data.control_points.rows(), by_number, options_.tolerance,
      data.error <= options_.tolerance ? "" : "; milder examples are nearer to what is solved for");
}

std::optional<TargetTableData> TermBuilder::run() {
  std::optional<TargetTableData> data;
  if (add_single_terms() && add_pair_terms()) {
    const TargetSamples samples = checks();
    if (samples.minima.allFinite()) {
      data = table();
      const Eigen::VectorXd errors = error_.errors(runtime::TargetTable(*data), samples);
      data->error = errors.maxCoeff();
      report_.message = message(*data, errors);
    }
  }
  if (!data)
    report_.message =
        "no table of targets: p*(w) was not found at some weights w; use \"target\": \"solve\" in the scene or milder "
        "examples";
  else
    report_.fits.push_back({static_cast<int>(data->degree), data->error});
  report_.degree = data ? static_cast<int>(data->degree) : 0;
  report_.error = data ? data->error : 0;
  report_.solves = finder_.solves();
  return data;
}

}  // namespace

std::optional<TargetTableData> build_pair_terms(const TargetSolver& target, const Eigen::MatrixXd& poses,
                                                const TargetTableOptions& options, TargetTableReport& report) {
  return TermBuilder(target, poses, options, report).run();
}

}  // namespace exmat::precompute

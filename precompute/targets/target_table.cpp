#include "precompute/targets/target_table.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/core/decompositions.h"
#include "common/core/timer.h"
#include "precompute/targets/minimum_finder.h"
#include "precompute/targets/pair_terms.h"
#include "precompute/targets/simplex_points.h"
#include "precompute/targets/table_error.h"
#include "precompute/targets/target_pieces.h"
#include "runtime/sim/examples/bernstein_basis.h"
#include "runtime/sim/examples/target.h"
#include "runtime/sim/examples/target_table.h"

namespace exmat::precompute {
namespace {

using runtime::BernsteinBasis;
using runtime::TargetSolver;
using runtime::TargetTable;

constexpr int kDegreeStep = 2;
constexpr int kDegreesPerGrid = 2;        // degrees that are fitted to the same nodes
constexpr double kOversampling = 1.25;    // degree of the nodes over that of the polynomial
constexpr int kChecksPerDimension = 64;   // weights on every edge; twice as many on every face
constexpr Eigen::Index kTableStarts = 4;  // every fourth weight is solved from every start
constexpr double kMargin = 0.7;           // of the tolerance: more may turn up between the checks

int most_degree(const TargetTableOptions& options, Eigen::Index examples) {
  if (options.most_degree > 0) return std::min(options.most_degree, BernsteinBasis::kMostDegree);
  return examples == 2 ? 40 : examples == 3 ? 24 : 14;
}

class TableBuilder {
 public:
  TableBuilder(const TargetSolver& target, const Eigen::MatrixXd& poses, const TargetTableOptions& options,
               TargetTableReport& report);

  std::optional<TargetTableData> run();

 private:
  TargetSamples solve_checks();
  TargetSamples solve_nodes(int degree);
  TargetTableData fit(int degree, const TargetSamples& nodes) const;
  std::optional<TargetTableData> one_polynomial(const TargetSamples& checks);
  std::optional<TargetTableData> pieces(const TargetSamples& checks);
  void record(const TargetFit& fit);
  std::string lost_message() const;
  std::string success_message(const TargetTableData& data) const;
  std::string refusal_message() const;

  const TargetSolver& target_;
  const Eigen::MatrixXd& poses_;
  const TargetTableOptions& options_;
  TargetTableReport& report_;
  Eigen::Index examples_;  ///< K
  TableError error_;
  MinimumFinder finder_;
  std::optional<TargetTable> former_;  ///< table of the degree before
  bool lost_ = false;                  ///< p*(w) was not found at some weights
  bool lost_between_ = false;          ///< only in or between pieces
};

TableBuilder::TableBuilder(const TargetSolver& target, const Eigen::MatrixXd& poses, const TargetTableOptions& options,
                           TargetTableReport& report)
    : target_(target),
      poses_(poses),
      options_(options),
      report_(report),
      examples_(poses.cols()),
      error_(target, examples_),
      finder_(target, kSameMinimum * options.tolerance * error_.scale(), options.all) {
  if (options.correction) finder_.correct_by(options.correction);
}

// Not from the table, which must not confirm itself.
TargetSamples TableBuilder::solve_checks() {
  const RowMatrix weights = spread_points(examples_, kChecksPerDimension);
  const auto starts = [&](const Eigen::VectorXd& w, Eigen::Index row) -> std::vector<Eigen::VectorXd> {
    if (row % kTableStarts == 0) return blend_and_examples(target_, w);
    return {blend(target_, w)};
  };
  return {weights, finder_.find(weights, starts, "targets to check the table by")};
}

TargetSamples TableBuilder::solve_nodes(int degree) {
  const RowMatrix weights = interpolation_nodes(BernsteinBasis(degree, static_cast<int>(examples_)).exponents());
  const auto starts = [&](const Eigen::VectorXd& w, Eigen::Index row) {
    std::vector<Eigen::VectorXd> from;
    if (former_) from.emplace_back(error_.decode(*former_, w.transpose()).row(0).transpose());
    if (!former_ || row % kTableStarts == 0) from.push_back(blend(target_, w));
    return from;
  };
  return {weights, finder_.find(weights, starts, "targets of the table")};
}

// Least squares over the nodes; the control points at the corners are the examples themselves.
TargetTableData TableBuilder::fit(int degree, const TargetSamples& nodes) const {
  const BernsteinBasis basis(degree, static_cast<int>(examples_));
  TargetTableData data;
  data.degree = degree;
  data.energy_reference = options_.energy_reference;
  data.exponents = basis.exponents();
  data.control_points.resize(basis.size(), poses_.rows());
  const Eigen::MatrixXd values = collocation(basis, nodes.weights);
  Eigen::MatrixXd rest = nodes.minima;
  std::vector<Eigen::Index> free;
  for (Eigen::Index n = 0; n < basis.size(); ++n) {
    Eigen::Index k = 0;
    if (data.exponents.row(n).maxCoeff(&k) < degree) {
      free.push_back(n);
      continue;
    }
    data.control_points.row(n) = poses_.col(k).transpose();
    rest -= values.col(n) * target_.example(k).transpose();
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> solver(values(Eigen::all, free));
  data.control_points(free, Eigen::all) = solver.solve(rest) * target_.basis().transpose();
  return data;
}

constexpr const char* kAdvice = "use \"target\": \"solve\" in the scene, a larger targets.tolerance or milder examples";

std::string TableBuilder::lost_message() const {
  return fmt::format("no table of targets: p*(w) was not found at some weights w; {}", kAdvice);
}

std::string TableBuilder::success_message(const TargetTableData& data) const {
  const std::string kind = report_.pieces == 1 ? fmt::format("degree {}", data.degree)
                                               : fmt::format("{} pieces of degree {}", report_.pieces, data.degree);
  return fmt::format("table of targets: {}, {} control points, error {:.2g} (tolerance {:.2g})", kind,
                     data.control_points.rows(), data.error, options_.tolerance);
}

std::string TableBuilder::refusal_message() const {
  std::string tries;
  for (const TargetFit& fit : report_.fits) {
    if (fit.pieces > 1)
      tries += fmt::format(", {:.2g} in {} pieces of degree {}", fit.error, fit.pieces, fit.degree);
    else
      tries = fmt::format("error {:.2g} at degree {}, the highest", fit.error, fit.degree);
  }
  if (lost_between_) tries += ", where p*(w) was not found or has no derivative at some weights";
  const std::string several =
      finder_.ambiguous() == 0 ? "" : fmt::format(", more than one minimum at {} weights", finder_.ambiguous());
  return fmt::format("no table of targets: {} (tolerance {:.2g}){}; {}", tries, options_.tolerance, several, kAdvice);
}

void TableBuilder::record(const TargetFit& fit) {
  report_.degree = fit.degree;
  report_.pieces = fit.pieces;
  report_.error = fit.error;
  report_.fits.push_back(fit);
}

std::optional<TargetTableData> TableBuilder::one_polynomial(const TargetSamples& checks) {
  const int most = most_degree(options_, examples_);
  TargetSamples nodes;
  int served = 0;  // largest degree that the nodes are for
  for (int degree = std::min(options_.first_degree, most); degree <= most; degree += kDegreeStep) {
    if (degree > served) {
      served = std::min(most, degree + kDegreeStep * (kDegreesPerGrid - 1));
      nodes = solve_nodes(static_cast<int>(std::ceil(kOversampling * served)));
    }
    lost_ = !nodes.minima.allFinite();
    if (lost_) return std::nullopt;
    TargetTableData data = fit(degree, nodes);
    former_.emplace(data);
    data.error = std::max(error_.errors(*former_, checks).maxCoeff(), error_.errors(*former_, nodes).maxCoeff());
    record({degree, data.error});
    if (data.error <= kMargin * options_.tolerance) return data;
  }
  return std::nullopt;
}

std::optional<TargetTableData> TableBuilder::pieces(const TargetSamples& checks) {
  PieceReport report;
  auto data = build_target_pieces(target_, poses_, checks, {kMargin * options_.tolerance, options_.most_pieces},
                                  finder_, report);
  lost_between_ = report.lost;
  if (report.pieces > 0) record({kPieceDegree, report.error, report.pieces});
  if (data) data->energy_reference = options_.energy_reference;
  return data;
}

std::optional<TargetTableData> TableBuilder::run() {
  const TargetSamples checks = solve_checks();
  lost_ = !checks.minima.allFinite();
  std::optional<TargetTableData> data;
  if (!lost_) data = one_polynomial(checks);
  if (!lost_ && !data && examples_ == 2 && !options_.correction) data = pieces(checks);
  report_.solves = finder_.solves();
  report_.message = data ? success_message(*data) : lost_ ? lost_message() : refusal_message();
  return data;
}

}  // namespace

std::optional<TargetTableData> build_target_table(const TargetSolver& target, const Eigen::MatrixXd& poses,
                                                  const TargetTableOptions& options, TargetTableReport& report) {
  const Timer timer;
  report = {};
  if (poses.cols() < 2) {
    report.message = "no table of targets: one example alone needs none";
    return std::nullopt;
  }
  auto data = poses.cols() > kMostPolynomialExamples ? build_pair_terms(target, poses, options, report)
                                                     : TableBuilder(target, poses, options, report).run();
  report.seconds = timer.seconds();
  return data;
}

void shift_targets(const Eigen::MatrixXd& shifts, TargetTableData& table) {
  const Eigen::Index points = table.exponents.rows(), pieces = table.knots.size() - 1;
  if (is_of_pairs(table.exponents)) {  // the constant and the terms of one example are the linear functions
    table.control_points.row(0) += shifts.col(0).transpose();
    for (Eigen::Index row = 1; row < points; ++row)
      for (Eigen::Index k = 1; k < shifts.cols(); ++k)
        if (const auto a = table.exponents.row(row); a[k] > 0 && a[0] + a[k] == a.sum())
          table.control_points.row(row) +=
              static_cast<double>(a[k]) / a.sum() * (shifts.col(k) - shifts.col(0)).transpose();
    return;
  }
  for (Eigen::Index row = 0; row < pieces * points; ++row) {
    Eigen::VectorXd weights =
        table.exponents.row(row % points).cast<double>().transpose() / static_cast<double>(table.degree);
    if (pieces > 1) {  // of two examples, from one knot to the next
      const Eigen::Index piece = row / points;
      weights[1] = table.knots[piece] + weights[1] * (table.knots[piece + 1] - table.knots[piece]);
      weights[0] = 1 - weights[1];
    }
    table.control_points.row(row) += (shifts * weights).transpose();
  }
}

}  // namespace exmat::precompute

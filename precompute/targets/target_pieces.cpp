#include "precompute/targets/target_pieces.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/core/decompositions.h"
#include "precompute/targets/simplex_points.h"

namespace exmat::precompute {
namespace {

using runtime::BernsteinBasis;
using runtime::TargetSolver;
using runtime::TargetTable;

constexpr int kNodes = kPieceDegree;     // inside each piece, for kPieceDegree - 3 control points
constexpr int kChecks = 12;              // further weights in each piece
constexpr Eigen::Index kEveryStart = 4;  // every fourth of them is solved from every example
constexpr double kShortest = 0x1p-20;    // piece that is halved

/// p*(w) at the weights (1 - t, t).
struct Knot {
  double t = 0;
  Eigen::VectorXd y, y_slope;    ///< d, and by t
  Eigen::VectorXd value, slope;  ///< r, the same in reduced coordinates
};

struct Piece {
  Knot begin, end;
  RowMatrix control_points;  ///< N x r; none before the fit

  double length() const { return end.t - begin.t; }
  double at(double s) const { return begin.t + s * length(); }
  /// y by cubic Hermite interpolation.
  Eigen::VectorXd hermite(double t) const;
};

Eigen::VectorXd Piece::hermite(double t) const {
  const double s = (t - begin.t) / length(), u = 1 - s;
  return u * u * ((1 + 2 * s) * begin.y + s * length() * begin.y_slope) +
         s * s * ((1 + 2 * u) * end.y - u * length() * end.y_slope);
}

Eigen::RowVector2d weights_at(double t) { return {1 - t, t}; }

class PieceBuilder {
 public:
  PieceBuilder(const TargetSolver& target, const Eigen::MatrixXd& poses, const TargetSamples& checks,
               const PieceOptions& options, MinimumFinder& finder, PieceReport& report);

  std::optional<TargetTableData> run();

 private:
  Knot knot(double t, Eigen::VectorXd y) const;
  std::vector<Piece> halve(const std::vector<Piece>& pieces, const std::vector<bool>& which);
  void fit_new(std::vector<Piece>& pieces);
  void fit(const Eigen::Ref<const RowMatrix>& minima, Piece& piece) const;
  TargetTableData assemble(const std::vector<Piece>& pieces) const;
  bool is_lost(const std::vector<Piece>& pieces) const;
  bool may_halve(const std::vector<Piece>& pieces, const std::vector<bool>& which) const;

  const TargetSolver& target_;
  const Eigen::MatrixXd& poses_;
  const PieceOptions& options_;
  MinimumFinder& finder_;
  PieceReport& report_;
  TableError error_;
  BernsteinBasis basis_{kPieceDegree, 2};
  TargetSamples samples_;   ///< all weights that were solved
  RowMatrix points_;        ///< [kNodes + kChecks x 2] in a piece: the nodes, then the checks
  Eigen::MatrixXd values_;  ///< kNodes x N
  Eigen::HouseholderQR<Eigen::MatrixXd> inner_values_;  ///< values for the control points that the ends leave free
};

PieceBuilder::PieceBuilder(const TargetSolver& target, const Eigen::MatrixXd& poses, const TargetSamples& checks,
                           const PieceOptions& options, MinimumFinder& finder, PieceReport& report)
    : target_(target),
      poses_(poses),
      options_(options),
      finder_(finder),
      report_(report),
      error_(target, 2),
      samples_(checks),
      points_(kNodes + kChecks, 2) {
  points_.topRows(kNodes) = interpolation_nodes(BernsteinBasis(kNodes + 1, 2).exponents()).middleRows(1, kNodes);
  points_.bottomRows(kChecks) = spread_points(2, kChecks);
  values_ = collocation(basis_, points_.topRows(kNodes));
  inner_values_.compute(values_.middleCols(2, basis_.size() - 4));
}

// NaN where the minimum is not strict to rounding.
Knot PieceBuilder::knot(double t, Eigen::VectorXd y) const {
  auto workspace = target_.make_workspace();
  const Eigen::Index d = y.size();
  Eigen::VectorXd first(d), second(d);
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(d, d);
  target_.force(weights_at(0).transpose(), y, workspace, first);
  target_.force(weights_at(1).transpose(), y, workspace, second);
  target_.hessian(weights_at(t).transpose(), y, workspace, hessian);
  const Eigen::LLT<Eigen::MatrixXd> cholesky(hessian);
  Knot knot{t, std::move(y), cholesky.solve(first - second), {}, {}};
  if (cholesky.info() != Eigen::Success) knot.y_slope.setConstant(std::numeric_limits<double>::quiet_NaN());
  knot.value = target_.basis() * knot.y;
  knot.slope = target_.basis() * knot.y_slope;
  return knot;
}

std::vector<Piece> PieceBuilder::halve(const std::vector<Piece>& pieces, const std::vector<bool>& which) {
  std::vector<const Piece*> halved;
  for (std::size_t i = 0; i < pieces.size(); ++i)
    if (which[i]) halved.push_back(&pieces[i]);
  TargetSamples middles;
  middles.weights.resize(std::ssize(halved), 2);
  for (std::size_t i = 0; i < halved.size(); ++i)
    middles.weights.row(static_cast<Eigen::Index>(i)) = weights_at(halved[i]->at(0.5));
  const auto starts = [&](const Eigen::VectorXd& w, Eigen::Index row) {
    auto from = blend_and_examples(target_, w);
    from.push_back(halved[static_cast<std::size_t>(row)]->hermite(w[1]));
    return from;
  };
  middles.minima = finder_.find(middles.weights, starts, "targets between the pieces of the table");
  samples_.append(middles);

  std::vector<Piece> finer;
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (!which[i]) {
      finer.push_back(pieces[i]);
      continue;
    }
    const Knot middle = knot(pieces[i].at(0.5), middles.minima.row(row++).transpose());
    finer.push_back({pieces[i].begin, middle, {}});
    finer.push_back({middle, pieces[i].end, {}});
  }
  return finer;
}

// The nodes are solved from the table too, the checks are not: it must not confirm itself.
void PieceBuilder::fit_new(std::vector<Piece>& pieces) {
  std::vector<Piece*> fresh;
  for (Piece& piece : pieces)
    if (piece.control_points.size() == 0) fresh.push_back(&piece);
  const Eigen::Index count = points_.rows();
  TargetSamples inside;
  inside.weights.resize(std::ssize(fresh) * count, 2);
  for (Eigen::Index i = 0; i < inside.weights.rows(); ++i)
    inside.weights.row(i) = weights_at(fresh[static_cast<std::size_t>(i / count)]->at(points_(i % count, 1)));
  const auto starts = [&](const Eigen::VectorXd& w, Eigen::Index row) -> std::vector<Eigen::VectorXd> {
    const Eigen::Index point = row % count;
    if (point < kNodes) return {blend(target_, w), fresh[static_cast<std::size_t>(row / count)]->hermite(w[1])};
    if ((point - kNodes) % kEveryStart == 0) return blend_and_examples(target_, w);
    return {blend(target_, w)};
  };
  inside.minima = finder_.find(inside.weights, starts, "targets in the pieces of the table");
  samples_.append(inside);
  for (std::size_t i = 0; i < fresh.size(); ++i)
    fit(inside.minima.middleRows(static_cast<Eigen::Index>(i) * count, kNodes), *fresh[i]);
}

void PieceBuilder::fit(const Eigen::Ref<const RowMatrix>& minima, Piece& piece) const {
  const Eigen::Index last = kPieceDegree;
  const double step = piece.length() / kPieceDegree;  // of t to the next control point
  RowMatrix y = RowMatrix::Zero(basis_.size(), minima.cols());
  y.row(0) = piece.begin.y.transpose();
  y.row(1) = (piece.begin.y + step * piece.begin.y_slope).transpose();
  y.row(last - 1) = (piece.end.y - step * piece.end.y_slope).transpose();
  y.row(last) = piece.end.y.transpose();
  const Eigen::MatrixXd rest = minima - values_ * y;
  y.middleRows(2, last - 3) = inner_values_.solve(rest);
  piece.control_points = y * target_.basis().transpose();
  piece.control_points.row(0) = piece.begin.value.transpose();
  piece.control_points.row(1) = (piece.begin.value + step * piece.begin.slope).transpose();
  piece.control_points.row(last - 1) = (piece.end.value - step * piece.end.slope).transpose();
  piece.control_points.row(last) = piece.end.value.transpose();
}

TargetTableData PieceBuilder::assemble(const std::vector<Piece>& pieces) const {
  const auto count = static_cast<Eigen::Index>(pieces.size());
  TargetTableData data;
  data.degree = kPieceDegree;
  data.exponents = basis_.exponents();
  data.control_points.resize(count * basis_.size(), target_.basis().rows());
  data.knots.resize(count + 1);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Piece& piece = pieces[static_cast<std::size_t>(i)];
    data.control_points.middleRows(i * basis_.size(), basis_.size()) = piece.control_points;
    data.knots[i] = piece.begin.t;
  }
  data.knots[count] = 1;
  return data;
}

bool PieceBuilder::is_lost(const std::vector<Piece>& pieces) const {
  const auto is_found = [](const Piece& piece) {
    return piece.begin.y_slope.allFinite() && piece.end.y_slope.allFinite();
  };
  return !samples_.minima.allFinite() || !std::all_of(pieces.begin(), pieces.end(), is_found);
}

bool PieceBuilder::may_halve(const std::vector<Piece>& pieces, const std::vector<bool>& which) const {
  const auto more = std::count(which.begin(), which.end(), true);
  if (std::ssize(pieces) + more > options_.most_pieces) return false;
  for (std::size_t i = 0; i < pieces.size(); ++i)
    if (which[i] && pieces[i].length() <= kShortest) return false;
  return true;
}

std::optional<TargetTableData> PieceBuilder::run() {
  Piece whole{knot(0, target_.example(0)), knot(1, target_.example(1)), {}};
  whole.begin.value = poses_.col(0);
  whole.end.value = poses_.col(1);
  for (std::vector<Piece> pieces{whole};;) {
    fit_new(pieces);
    report_.lost = is_lost(pieces);
    if (report_.lost) return std::nullopt;
    TargetTableData data = assemble(pieces);
    const TargetTable table(data);
    const Eigen::VectorXd errors = error_.errors(table, samples_);
    data.error = errors.maxCoeff();
    report_.pieces = table.pieces();
    report_.error = data.error;
    if (data.error <= options_.tolerance) return data;
    std::vector<bool> coarse(pieces.size(), false);
    for (Eigen::Index i = 0; i < errors.size(); ++i)
      if (errors[i] > options_.tolerance)
        coarse[static_cast<std::size_t>(table.piece(samples_.weights.row(i).transpose()))] = true;
    if (!may_halve(pieces, coarse)) return std::nullopt;
    pieces = halve(pieces, coarse);
  }
}

}  // namespace

std::optional<TargetTableData> build_target_pieces(const TargetSolver& target, const Eigen::MatrixXd& poses,
                                                   const TargetSamples& checks, const PieceOptions& options,
                                                   MinimumFinder& finder, PieceReport& report) {
  report = {};
  return PieceBuilder(target, poses, checks, options, finder, report).run();
}

}  // namespace exmat::precompute

#include "precompute/solvers/davidson.h"

#include <algorithm>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/core/progress.h"
#include "precompute/solvers/tall.h"

namespace exmat::precompute {
namespace {

// Limit of |K^-1 (K x - lambda M x)| in the norm of M, where |x| is 1.
constexpr double kTolerable = 1e-6;  // where rounding stops it; refinement in long double has the rest
constexpr int kPatience = 4;         // steps that bring the worst pair no nearer by half
constexpr int kMostExpansions = 300;
constexpr double kIndependent = 1e-13;  // of eigenvalues of a Gram matrix of unit diagonal
// Pairs beside those that are wanted, a share and a number, make these converge sooner, and cost little: reading the
// factors takes most of the time.
constexpr double kMoreShare = 0.6;
constexpr Eigen::Index kMore = 7;
constexpr Eigen::Index kBlocks = 6;  // that the space holds before it begins anew

class Davidson {
 public:
  Davidson(const SparseMatrix& stiffness, const SparseMatrix& mass, const MixedSolver& solver,
           const Eigen::MatrixXd& found, Eigen::Index count, double accuracy)
      : stiffness_(stiffness),
        mass_(mass),
        solver_(solver),
        accuracy_(accuracy),
        found_(found),
        mass_found_(product(mass, found_)) {
    free_ = mass.rows() - solver.nullity() - found.cols();
    count_ = count;
    pairs_ =
        std::min(free_, count + std::max(kMore, static_cast<Eigen::Index>(kMoreShare * static_cast<double>(count))));
    const Eigen::Index most = std::min(free_, kBlocks * pairs_);
    space_.resize(mass.rows(), most);
    projected_ = Eigen::MatrixXd::Zero(most, most);
  }

  Eigen::MatrixXd solve();

 private:
  RowMatrix start() const;
  void make_independent(RowMatrix& columns) const;
  void extend(RowMatrix columns);
  void restart(const Eigen::MatrixXd& directions, const Eigen::VectorXd& values);
  auto own() const { return space_.leftCols(size_); }
  bool is_whole() const { return size_ == free_; }

  const SparseMatrix &stiffness_, &mass_;
  const MixedSolver& solver_;
  double accuracy_;
  RowMatrix found_, mass_found_;
  Eigen::Index count_ = 0, pairs_ = 0, size_ = 0;
  Eigen::Index free_ = 0;      // dimensions of the complement
  RowMatrix space_;            // M-orthonormal columns, the first size_
  Eigen::MatrixXd projected_;  // K in the space
};

// Every column has components along all eigenvectors, and is the same in every run.
RowMatrix Davidson::start() const {
  std::mt19937_64 generator(1 + static_cast<unsigned>(found_.cols()));
  RowMatrix columns(mass_.rows(), pairs_);
  for (Eigen::Index k = 0; k < columns.size(); ++k) columns.data()[k] = static_cast<double>(generator()) / 0x1p63 - 1.0;
  RowMatrix loads = product(mass_, columns);
  solver_.precondition(loads);
  return loads;
}

// M-orthonormal among themselves; those that depend on the others go. Stathopoulos and Wu 2002.
void Davidson::make_independent(RowMatrix& columns) const {
  const Eigen::MatrixXd gram = inner(columns, product(mass_, columns));
  const Eigen::VectorXd scale = gram.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> unit(
      Eigen::MatrixXd(scale.asDiagonal() * gram * scale.asDiagonal()));
  const Eigen::VectorXd& values = unit.eigenvalues();
  const Eigen::Index kept = (values.array() > kIndependent * values.maxCoeff()).count();
  const Eigen::MatrixXd turn = scale.asDiagonal() * unit.eigenvectors().rightCols(kept) *
                               values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
  RowMatrix independent = RowMatrix::Zero(columns.rows(), kept);
  add_product(1, columns, turn, independent);
  columns = std::move(independent);
}

void Davidson::extend(RowMatrix columns) {
  for (int pass = 0; pass < 2; ++pass) {
    add_product(-1, found_, inner(mass_found_, columns), columns);
    add_product(-1, own(), inner(own(), product(mass_, columns)), columns);
    make_independent(columns);
  }
  const Eigen::Index more = std::min(columns.cols(), space_.cols() - size_);
  space_.middleCols(size_, more) = columns.leftCols(more);
  size_ += more;
  const Eigen::MatrixXd images = inner(own(), product(stiffness_, columns.leftCols(more)));
  projected_.block(0, size_ - more, size_, more) = images;
  projected_.block(size_ - more, 0, more, size_) = images.transpose();
}

void Davidson::restart(const Eigen::MatrixXd& directions, const Eigen::VectorXd& values) {
  RowMatrix kept = RowMatrix::Zero(space_.rows(), directions.cols());
  add_product(1, own(), directions, kept);
  size_ = directions.cols();
  space_.leftCols(size_) = kept;
  projected_.setZero();
  projected_.diagonal().head(size_) = values;
}

Eigen::MatrixXd Davidson::solve() {
  Progress progress("eigenpairs", count_);
  extend(start());
  double nearest = std::numeric_limits<double>::infinity();
  for (int step = 0, waited = 0; step < kMostExpansions; ++step) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz(Eigen::MatrixXd(projected_.topLeftCorner(size_, size_)));
    const Eigen::Index pairs = std::min(pairs_, size_);
    RowMatrix vectors = RowMatrix::Zero(space_.rows(), pairs);
    add_product(1, own(), ritz.eigenvectors().leftCols(pairs), vectors);
    RowMatrix steps = product(stiffness_, vectors), masses = product(mass_, vectors);
    combine(Eigen::RowVectorXd::Ones(pairs), -ritz.eigenvalues().head(pairs).transpose(), masses, steps);
    solver_.precondition(steps);
    product(mass_, steps, masses);
    const Eigen::VectorXd errors = column_dots(steps, masses).cwiseMax(0).cwiseSqrt().transpose();
    const double worst = errors.head(std::min(count_, pairs)).maxCoeff();
    progress.reach((errors.head(std::min(count_, pairs)).array() <= accuracy_).count());
    waited = worst < nearest / 2 ? 0 : waited + 1;
    nearest = std::min(nearest, worst);
    if (worst <= accuracy_ || (worst <= kTolerable && waited >= kPatience) || is_whole())
      return vectors.leftCols(count_);
    std::vector<Eigen::Index> open;
    for (Eigen::Index k = 0; k < pairs; ++k)
      if (errors[k] > accuracy_) open.push_back(k);
    if (size_ + std::ssize(open) > space_.cols()) {
      const Eigen::Index kept = std::min(size_, 2 * pairs_);
      restart(ritz.eigenvectors().leftCols(kept), ritz.eigenvalues().head(kept));
    }
    extend(steps(Eigen::all, open));
  }
  throw WorkError("eigensolver: " + std::to_string(count_) + " eigenpairs do not converge in " +
                  std::to_string(kMostExpansions) + " steps; use --eigensolver direct");
}

}  // namespace

Eigen::MatrixXd davidson_eigenvectors(const SparseMatrix& stiffness, const SparseMatrix& mass,
                                      const MixedSolver& solver, const Eigen::MatrixXd& found, Eigen::Index count,
                                      double accuracy) {
  return Davidson(stiffness, mass, solver, found, count, accuracy).solve();
}

}  // namespace exmat::precompute

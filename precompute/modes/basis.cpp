#include "precompute/modes/basis.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/config/asset_config.h"
#include "common/core/decompositions.h"
#include "common/core/error.h"

namespace exmat::precompute {
namespace {

// Largest displacement of the first mode in the snapshots, as a share of the body's size.
constexpr double kSnapshotAmplitude = 0.25;
// Principal components below this, relative to the largest singular value, are rounding.
constexpr double kRankTolerance = 1e-9;
// Share of an example's displacement that a basis of its own choice of size may lose.
constexpr double kFieldLoss = 0.02;
// The same of a basis that has modes of its own for what the motions that it learns from do not show.
constexpr double kShownLoss = 0.005;
// The same of one of a given size that learns from the motions of a scene: more is a pose that they do not show.
constexpr double kUnshownLoss = 0.15;
// Share of modes beside the motions of a scene, in norm.
constexpr double kUnseenShare = 0.03;

Eigen::MatrixXd scaled_snapshots(const BasisInput& input) {
  const auto& lambda = input.modes.eigenvalues;
  const Eigen::Index k = lambda.size();
  const Eigen::MatrixXd first = input.system.extend(input.modes.modes.leftCols(1));
  const double largest = first.reshaped<Eigen::RowMajor>(first.rows() / 3, 3).rowwise().norm().maxCoeff();
  const double a = kSnapshotAmplitude * input.body_size / largest;
  Eigen::MatrixXd snapshots(input.modes.modes.rows(), k + input.derivatives.cols());
  for (Eigen::Index i = 0; i < k; ++i) snapshots.col(i) = a * lambda[0] / lambda[i] * input.modes.modes.col(i);
  for (Eigen::Index j = 0; j < k; ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      const double share = (i == j ? 0.5 : 1.0) * a * a * lambda[0] * lambda[0] / (lambda[i] * lambda[j]);
      snapshots.col(k + pair_index(i, j)) = share * input.derivatives.col(pair_index(i, j));
    }
  return snapshots;
}

// Leading principal components in the M product, at most `size` of them.
Eigen::MatrixXd principal_components(const SparseMatrix& mass, const Eigen::MatrixXd& columns, Eigen::Index size) {
  if (columns.cols() > columns.rows()) {  // of a small mesh: the smaller of the two matrices of products
    const Eigen::LLT<Eigen::MatrixXd> factor{Eigen::MatrixXd(mass)};
    const Eigen::MatrixXd scaled = factor.matrixU() * columns;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> products(Eigen::MatrixXd(scaled * scaled.transpose()));
    const Eigen::VectorXd values = products.eigenvalues().reverse();
    const Eigen::Index rank = (values.array() > kRankTolerance * kRankTolerance * values[0]).count();
    return factor.matrixU().solve(products.eigenvectors().rowwise().reverse().leftCols(std::min(size, rank)));
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(Eigen::MatrixXd(columns.transpose() * (mass * columns)));
  const Eigen::VectorXd values = gram.eigenvalues().reverse();
  const double smallest = kRankTolerance * kRankTolerance * values[0];
  const Eigen::Index rank = (values.array() > smallest).count();
  const Eigen::Index kept = std::min(size, rank);
  const Eigen::MatrixXd directions = gram.eigenvectors().rowwise().reverse().leftCols(kept);
  return columns * directions * values.head(kept).cwiseSqrt().cwiseInverse().asDiagonal();
}

// Q -= R (R^T M Q).
void remove_components(const SparseMatrix& mass, const Eigen::MatrixXd& orthonormal, Eigen::MatrixXd& columns) {
  if (orthonormal.cols() > 0) columns -= orthonormal * (orthonormal.transpose() * (mass * columns));
}

void orthonormalise(const SparseMatrix& mass, Eigen::MatrixXd& columns) {
  const Eigen::MatrixXd gram = columns.transpose() * (mass * columns);
  gram.llt().matrixU().solveInPlace<Eigen::OnTheRight>(columns);
}

void require_modes(Eigen::Index found, int size) {
  if (found >= size) return;
  throw InputError({"", "/basis/size", "at most " + std::to_string(found) + ", the number of independent snapshots",
                    std::to_string(size), "ask for fewer, or for more basis.linear_modes"});
}

// Fills the basis up to so many with the principal components of the columns, in its complement and the `norm` product.
void fill_up(const ElasticSystem& system, const SparseMatrix& norm, Eigen::MatrixXd columns, int size,
             Eigen::MatrixXd& basis) {
  remove_components(system.mass, basis, columns);
  const Eigen::Index before = basis.cols(), deforming = system.mass.rows() - system.null_space.cols();
  const Eigen::MatrixXd components = principal_components(norm, columns, size - before);
  require_modes(std::min(before + components.cols(), deforming), size);
  basis.conservativeResize(Eigen::NoChange, size);
  basis.rightCols(size - before) = components;
}

void finish(const BasisInput& input, Eigen::MatrixXd& basis) {
  for (int pass = 0; pass < 2; ++pass) {
    remove_components(input.system.mass, input.system.null_space, basis);
    orthonormalise(input.system.mass, basis);
  }
  fix_signs(basis);
}

// Example fields of unit norm each, without rigid motions.
Eigen::MatrixXd unit_fields(const ElasticSystem& system, Eigen::MatrixXd fields) {
  remove_components(system.mass, system.null_space, fields);
  for (auto field : fields.colwise()) field /= std::sqrt(field.dot(system.mass * field));
  return fields;
}

// Largest share of a field of unit norm that an orthonormal basis does not hold.
double largest_loss(const SparseMatrix& mass, const Eigen::MatrixXd& basis, Eigen::MatrixXd fields) {
  remove_components(mass, basis, fields);
  return std::sqrt(fields.cwiseProduct(mass * fields).colwise().sum().maxCoeff());
}

// Adds modes for what it loses of fields of unit norm.
void add_unshown(const SparseMatrix& mass, Eigen::MatrixXd fields, Eigen::MatrixXd& basis) {
  remove_components(mass, basis, fields);
  const Eigen::MatrixXd components = principal_components(mass, fields, fields.cols());
  Eigen::Index count = 0;
  while (count < components.cols() && largest_loss(mass, components.leftCols(count), fields) > kShownLoss) ++count;
  basis.conservativeResize(Eigen::NoChange, basis.cols() + count);
  basis.rightCols(count) = components.leftCols(count);
}

// Example fields may take as many modes of a basis.
Eigen::Index most_fields(int size) { return std::max({1, size / 2, size - kBasisSize / 2}); }

// All of the columns have unit norm together.
Eigen::MatrixXd of_unit_norm(const SparseMatrix& norm, const Eigen::MatrixXd& columns) {
  return columns / std::sqrt(columns.cwiseProduct(norm * columns).sum());
}

}  // namespace

int basis_size_for(const ElasticSystem& system, const Eigen::MatrixXd& fields) {
  if (fields.cols() <= most_fields(kBasisSize)) return kBasisSize;
  const Eigen::MatrixXd unit = unit_fields(system, fields);
  const Eigen::MatrixXd components = principal_components(system.mass, unit, unit.cols());
  const Eigen::MatrixXd shares = components.transpose() * (system.mass * unit);
  Eigen::Index count = most_fields(kBasisSize);
  const auto lost = [&] { return shares.bottomRows(shares.rows() - count).colwise().norm().maxCoeff(); };
  while (count < shares.rows() && lost() > kFieldLoss) ++count;
  return static_cast<int>(count) + kBasisSize / 2;
}

Eigen::MatrixXd modal_basis(const BasisInput& input, int size) {
  const auto& mass = input.system.mass;
  Eigen::MatrixXd basis(mass.rows(), 0);
  if (input.example_fields.cols() > 0)
    basis = principal_components(mass, unit_fields(input.system, input.example_fields), most_fields(size));
  fill_up(input.system, mass, scaled_snapshots(input), size, basis);
  finish(input, basis);
  return basis;
}

Eigen::MatrixXd trained_basis(const BasisInput& input, const Eigen::MatrixXd& snapshots, bool general, int size,
                              bool grows) {
  const ElasticSystem& system = input.system;
  const Eigen::VectorXd& values = input.modes.eigenvalues;
  const double decay = values[general ? 0 : std::min<Eigen::Index>(4, values.size() - 1)];
  const SparseMatrix norm = system.mass + system.stiffness / decay;
  Eigen::MatrixXd modal = of_unit_norm(norm, scaled_snapshots(input));
  if (const Eigen::Index fields = input.example_fields.cols(); fields > 0) {
    modal.conservativeResize(Eigen::NoChange, modal.cols() + fields);
    modal.rightCols(fields) = of_unit_norm(norm, input.example_fields);
    modal = of_unit_norm(norm, modal);
  }
  Eigen::MatrixXd columns(snapshots.rows(), snapshots.cols() + modal.cols());
  columns << of_unit_norm(norm, snapshots), (general ? 1 : kUnseenShare) * modal;
  remove_components(system.mass, system.null_space, columns);
  const auto with_first = [&](Eigen::MatrixXd basis) {
    fill_up(system, norm, columns, size, basis);
    orthonormalise(system.mass, basis);
    finish(input, basis);
    return basis;
  };
  if (input.example_fields.cols() == 0) return with_first(Eigen::MatrixXd(columns.rows(), 0));
  const Eigen::MatrixXd fields = unit_fields(system, input.example_fields);
  if (fields.cols() <= most_fields(kBasisSize)) {  // runs of a few loads may show them by themselves
    Eigen::MatrixXd basis = with_first(Eigen::MatrixXd(columns.rows(), 0));
    if (grows) {
      add_unshown(system.mass, fields, basis);
      finish(input, basis);
      return basis;
    }
    if (largest_loss(system.mass, basis, fields) <= kUnshownLoss) return basis;
  }
  return with_first(principal_components(system.mass, fields, most_fields(size)));
}

}  // namespace exmat::precompute

#include "precompute/alignment/functional_map.h"

#include <algorithm>
#include <cmath>

#include "common/core/decompositions.h"
#include "common/mesh/farthest_points.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kScoredFunctions = 20;
constexpr double kCommutativity = 1e-3;  // weight of |C Lambda_b - Lambda_a C|^2 relative to the descriptors
constexpr double kRidge = 1e-9;

}  // namespace

ZoomOut::ZoomOut(const AlignedShape& a, const AlignedShape& b, std::vector<Eigen::Index> sizes, Eigen::Index samples)
    : sizes_(std::move(sizes)),
      samples_(farthest_points(a.basis.vertices, samples)),
      functions_a_(a.basis.eigenfunctions.leftCols(sizes_.back())(samples_, Eigen::all)),
      functions_b_(b.basis.eigenfunctions.leftCols(sizes_.back())) {
  for (const Eigen::Index size : sizes_) trees_.emplace_back(functions_b_.leftCols(size));
}

IndexVector ZoomOut::points(const Eigen::MatrixXd& map) const {
  const auto at = std::find(sizes_.begin(), sizes_.end(), map.cols());
  const RowMatrix queries = functions_a_.leftCols(map.rows()) * map;
  if (at != sizes_.end()) return trees_[static_cast<std::size_t>(at - sizes_.begin())].nearest(queries);
  return KdTree(functions_b_.leftCols(map.cols())).nearest(queries);
}

// With the constant function in the least squares, which samples do not keep orthogonal to the others.
Eigen::MatrixXd ZoomOut::map_of(const IndexVector& points, Eigen::Index size) const {
  Eigen::MatrixXd functions(functions_a_.rows(), size + 1);
  functions << functions_a_.leftCols(size), Eigen::VectorXd::Ones(functions_a_.rows());
  const Eigen::MatrixXd values = functions_b_(points, Eigen::seqN(0, size));
  return functions.colPivHouseholderQr().solve(values).topRows(size);
}

Eigen::MatrixXd ZoomOut::refine(Eigen::MatrixXd map) const {
  for (const Eigen::Index size : sizes_) map = map_of(points(map), size);
  return map_of(points(map), sizes_.back());
}

std::vector<Eigen::Index> zoom_out_sizes(Eigen::Index available) {
  std::vector<Eigen::Index> sizes;
  for (Eigen::Index size = 20; size <= std::min<Eigen::Index>(40, available); size += 4) sizes.push_back(size);
  if (sizes.empty()) sizes.push_back(available);
  return sizes;
}

Eigen::MatrixXd map_of_points(const AlignedShape& a, const AlignedShape& b, const SparseMatrix& points,
                              Eigen::Index size) {
  return a.basis.eigenfunctions.leftCols(size).transpose() *
         (a.basis.mass * (points * b.basis.eigenfunctions.leftCols(size)));
}

double orthogonality_defect(const Eigen::MatrixXd& map) {
  const Eigen::Index size = std::min({kScoredFunctions, map.rows(), map.cols()});
  const auto block = map.topLeftCorner(size, size);
  const Eigen::MatrixXd defect = block.transpose() * block - Eigen::MatrixXd::Identity(size, size);
  return defect.norm() / std::sqrt(static_cast<double>(size));
}

MapScore score_map(const ArapEnergy& arap, const Eigen::MatrixXd& map, const VertexArray& pull_back) {
  return {orthogonality_defect(map), arap.energy(pull_back), arap.inverted_fraction(pull_back)};
}

Eigen::MatrixXd heat_kernels(const Eigen::VectorXd& eigenvalues, const Eigen::MatrixXd& values,
                             const Eigen::VectorXd& times) {
  Eigen::MatrixXd kernels(values.cols(), values.rows() * times.size());
  for (Eigen::Index s = 0; s < times.size(); ++s) {
    const Eigen::VectorXd decay = (-times[s] * eigenvalues).array().exp();
    kernels.middleCols(s * values.rows(), values.rows()) = decay.asDiagonal() * values.transpose();
  }
  return kernels.colwise().normalized();
}

Eigen::MatrixXd descriptor_map(const Eigen::VectorXd& lambda_a, const Eigen::MatrixXd& F,
                               const Eigen::VectorXd& lambda_b, const Eigen::MatrixXd& G) {
  const Eigen::MatrixXd gram = G * G.transpose(), right = G * F.transpose();
  const double weight = kCommutativity * gram.trace() / std::pow(lambda_a[lambda_a.size() - 1], 2);
  // The rows of C are independent: gaps of eigenvalues penalise its entries.
  Eigen::MatrixXd map(lambda_a.size(), lambda_b.size());
  for (Eigen::Index row = 0; row < map.rows(); ++row) {
    Eigen::MatrixXd system = gram;
    system.diagonal().array() += weight * (lambda_b.array() - lambda_a[row]).square() + kRidge * gram.trace();
    map.row(row) = system.llt().solve(right.col(row)).transpose();
  }
  return polar_factor(map);
}

Eigen::MatrixXd landmark_kernels(const LaplaceBasis& basis, const SparseMatrix& points) {
  const Eigen::Vector4d times(0.05, 0.1, 0.2, 0.4);
  return heat_kernels(basis.eigenvalues, points * basis.eigenfunctions, times / basis.eigenvalues[0]);
}

Eigen::MatrixXd landmark_map(const AlignedShape& a, const SparseMatrix& on_a, const AlignedShape& b,
                             const SparseMatrix& on_b, Eigen::Index size) {
  const LaplaceBasis basis_a = first_functions(a.basis, size), basis_b = first_functions(b.basis, size);
  return descriptor_map(basis_a.eigenvalues, landmark_kernels(basis_a, on_a), basis_b.eigenvalues,
                        landmark_kernels(basis_b, on_b));
}

}  // namespace exmat::precompute

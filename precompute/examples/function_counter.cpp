#include "precompute/examples/function_counter.h"

#include <algorithm>

#include "common/core/arrays.h"
#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {

Eigen::Index FunctionCounter::needed(const Eigen::VectorXd& field, double share) {
  if (!basis_) basis_ = laplace_basis(mesh_, std::min(kMostEigenfunctions, mesh_.vertex_count() - 2), name_);
  const VertexArray displacement = field.reshaped<Eigen::RowMajor>(field.size() / 3, 3);
  const double whole = (displacement.transpose() * (basis_->mass * displacement)).trace();
  const Eigen::VectorXd shares = coefficients(*basis_, displacement).rowwise().squaredNorm() / whole;
  double carried = 0;
  for (Eigen::Index count = 1; count < shares.size(); ++count) {
    carried += shares[count - 1];
    if (1 - carried <= share * share && !splits_cluster(basis_->eigenvalues, count)) return count;
  }
  return 0;
}

}  // namespace exmat::precompute

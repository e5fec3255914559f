#pragma once

#include <vector>

#include "precompute/alignment/aligned_shape.h"
#include "precompute/alignment/arap_energy.h"
#include "precompute/alignment/kd_tree.h"

namespace exmat::precompute {

// A functional map C [k_a x k_b] takes coefficients of a function on b to those of the function pulled back to a:
// Phi_b[p] ~ Phi_a C for a map p from points of a to points of b. Ovsjanikov et al. 2012.

/// ZoomOut [Melzi et al. 2019] between two shapes: alternately p = nearest rows of Phi_b to those of Phi_a C, and C
/// from p with more functions. Maps use samples of a, all vertices of b.
class ZoomOut {
 public:
  /// The sizes k of the maps, ascending; `samples` bounds the vertices of a that are used.
  ZoomOut(const AlignedShape& a, const AlignedShape& b, std::vector<Eigen::Index> sizes, Eigen::Index samples = 600);

  /// From a map of any size up to the first of the sizes (a smaller one is used as it is) to one of the last size.
  Eigen::MatrixXd refine(Eigen::MatrixXd map) const;

  /// The vertex of b that belongs to each sample of a.
  IndexVector points(const Eigen::MatrixXd& map) const;
  const std::vector<Eigen::Index>& samples() const { return samples_; }

 private:
  Eigen::MatrixXd map_of(const IndexVector& points, Eigen::Index size) const;

  std::vector<Eigen::Index> sizes_, samples_;
  RowMatrix functions_a_;  // at the samples
  RowMatrix functions_b_;
  std::vector<KdTree> trees_;  // of the rows of Phi_b, one for each size
};

/// The sizes of ZoomOut, 20 to 40 in steps of 4, cut to `available` functions.
std::vector<Eigen::Index> zoom_out_sizes(Eigen::Index available);

/// Map of `size` functions from values of b at points of a: Phi_a^T M_a (P Phi_b), P [n_a x n_b].
Eigen::MatrixXd map_of_points(const AlignedShape& a, const AlignedShape& b, const SparseMatrix& points,
                              Eigen::Index size);

/// |C^T C - I|_F / sqrt(k) over the first k = min(20, size) functions: how far from an isometry of function spaces.
double orthogonality_defect(const Eigen::MatrixXd& map);

/// Score of a functional map. docs/alignment.md, step 4.
struct MapScore {
  double orthogonality = 0;  ///< orthogonality_defect
  double distortion = 0;     ///< mean |F - R|^2 of the low-pass pull-back
  double inverted = 0;       ///< share of the volume with det F < 0

  /// J of the selection.
  double total() const { return orthogonality + distortion + 2 * inverted; }
};
/// `pull_back` [n_a x 3] positions of b carried to a; `arap` that of a at rest.
MapScore score_map(const ArapEnergy& arap, const Eigen::MatrixXd& map, const VertexArray& pull_back);

/// [k x l s] coefficients of heat kernels at l points for each of s times: exp(-lambda_i t) phi_i(point), scaled to
/// unit norm for each point and time. `values` [l x k] of the functions at the points.
Eigen::MatrixXd heat_kernels(const Eigen::VectorXd& eigenvalues, const Eigen::MatrixXd& values,
                             const Eigen::VectorXd& times);

/// [k x 4 l] heat kernels of the k functions of a basis at l points, at t = {.05, .1, .2, .4} / lambda_1. `points`
/// [l x n] interpolates.
Eigen::MatrixXd landmark_kernels(const LaplaceBasis& basis, const SparseMatrix& points);

/// Map [k_a x k_b] with orthonormal rows or columns from coefficients F [k_a x q], G [k_b x q] of corresponding
/// functions: least squares C G ~ F, regularised to commute with the Laplacians, then the polar factor.
Eigen::MatrixXd descriptor_map(const Eigen::VectorXd& lambda_a, const Eigen::MatrixXd& F,
                               const Eigen::VectorXd& lambda_b, const Eigen::MatrixXd& G);

/// descriptor_map of size x size of the landmark_kernels of corresponding points.
Eigen::MatrixXd landmark_map(const AlignedShape& a, const SparseMatrix& on_a, const AlignedShape& b,
                             const SparseMatrix& on_b, Eigen::Index size);

}  // namespace exmat::precompute

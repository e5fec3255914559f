#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "common/core/decompositions.h"
#include "common/model/reduced_model.h"

namespace exmat::runtime {

/// Share of a load that a modal basis can answer. docs/method.md, "Load capacity".
///
/// A load f that acts for one step of backward Euler of length h on a body at rest moves it by h^2 A^-1 f, with
/// A = M + h^2 K of all degrees of freedom, and does the work h^2 f^T A^-1 f. Within the span of B, the modes and the
/// rigid motions of a free body, it does h^2 g^T (B^T A B)^-1 g with g = B^T f, which is never more. The share that is
/// missing is what the basis loses. h = 1 / w, w the lowest natural frequency within the span: inertia and elasticity
/// count alike where the body moves most.
class LoadCapacity {
 public:
  /// Takes a bundle's /object and /modal, complete. `spread` >= 0 [m]: how far from its point a force is spread.
  LoadCapacity(const ReducedModel& model, double spread);

  double time_scale() const { return time_scale_; }  ///< h [s]

  /// [3n] of forces [k x 3] at `places` [k x 3] of the rest shape: each spread over the vertices of the surface within
  /// reach, by area and distance; at the nearest one where none is.
  Eigen::VectorXd spread_load(const VertexArray& places, const VertexArray& forces) const;

  /// The share of the work of a load [3n] that the basis loses, in [0, 1]; 0 of no load.
  double lost_share(const Eigen::VectorXd& load) const;

 private:
  Eigen::Index unknowns() const { return reduced_basis_.rows(); }
  void weigh_surface(const ObjectData& object);

  double spread_, time_scale_ = 0;
  VertexArray vertices_;                                    ///< n x 3
  Eigen::VectorXd areas_;                                   ///< n, of the surface; 0 inside
  std::vector<Eigen::Index> place_;                         ///< n, the first unknown of each vertex; -1 of fixed ones
  Eigen::MatrixXd reduced_basis_;                           ///< unknowns x columns of B
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> full_;  ///< factor of A
  Eigen::LLT<Eigen::MatrixXd> reduced_;                     ///< factor of B^T A B
};

}  // namespace exmat::runtime

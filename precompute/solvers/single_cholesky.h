#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "common/mesh/assembly.h"
#include "precompute/solvers/elimination.h"

namespace exmat::precompute {

/// Vertices of a symmetric matrix whose rows come in blocks of `block`, a vertex each.
Graph graph_of(const SparseMatrix& matrix, int block);

/// By nested dissection, where vertices stand for `block` rows. What it took for the last graph is kept: matrices of
/// one mesh share ordering and symbolic analysis.
std::shared_ptr<const Elimination> dissected_elimination(const Graph& graph, int block);

/// L L^T in single precision, of a symmetric matrix that is scaled to a unit diagonal: half the memory of factors in
/// double and, with threads, a fraction of the time. Multifrontal, solutions too: subtrees of the elimination are side
/// by side, so that every part of L is read once for all right-hand sides. Results are the same for every number of
/// threads.
class SingleCholesky {
 public:
  SingleCholesky(std::shared_ptr<const Elimination> plan, int block);

  /// Bytes of L for such a plan, and of what a factorisation needs beside it with `threads` threads, about.
  static std::int64_t bytes(const Elimination& plan, int block, int threads);

  /// Factorises `matrix` without the rows and columns of `left_out`, ascending. False where it is not positive definite
  /// as far as single precision sees; then there are no factors.
  bool factorise(const SparseMatrix& matrix, const std::vector<Eigen::Index>& left_out);

  /// X [n x k] so that A X = B, about; zeros in the rows that are left out, whatever B has there. B may be X.
  void solve(const RowMatrix& B, RowMatrix& X) const;

 private:
  struct Scratch;
  /// The nodes below each node and itself, which end with it.
  struct Subtree {
    std::size_t first = 0;
    double operations = 0, entries = 0;  ///< cost of a factorisation and size of L, without block^3 and block^2
    bool has_parent = false;
  };
  enum class Order { kChildrenFirst, kParentsFirst };
  /// work(node, shared) of all nodes by several threads; `shared`: more than one of them may work for it. Subtrees with
  /// little of what `size` is are one thread's.
  template <typename Work>
  void visit(Order order, double Subtree::*size, int threads, const Work& work) const;
  float* part(std::size_t node) const { return factors_.get() + begins_[node]; }
  bool eliminate(std::size_t node, const SparseMatrix& matrix, bool shared, Scratch& scratch,
                 std::vector<std::vector<float>>& updates) const;
  void assemble(std::size_t node, const SparseMatrix& matrix, const Scratch& scratch) const;
  void solve_some(const RowMatrix& B, Eigen::Index begin, Eigen::Index count, RowMatrix& X) const;
  void solve_down(std::size_t node, bool shared, Eigen::MatrixXf& x, std::vector<Eigen::MatrixXf>& updates) const;
  void solve_up(std::size_t node, bool shared, Eigen::MatrixXf& x) const;

  std::shared_ptr<const Elimination> plan_;
  int block_;
  std::vector<Subtree> subtrees_;
  double operations_ = 0, entries_ = 0;  // of all
  std::vector<std::int64_t> begins_;     // of each node's part, [(columns + rows) x columns] by columns
  std::unique_ptr<float[]> factors_;
  std::vector<std::int32_t> original_;  // the vertex of each place
  Eigen::VectorXd scale_;               // of each row: the diagonal^-1/2, 0 where it is left out
};

}  // namespace exmat::precompute

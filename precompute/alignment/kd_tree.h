#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// Nearest points in any number of dimensions: nanoflann's k-d tree behind an interface of our own. Searches are exact
/// and may run in several threads.
class KdTree {
 public:
  /// [k x d] points, k >= 1; copied.
  explicit KdTree(RowMatrix points);
  ~KdTree();
  KdTree(KdTree&&) noexcept;
  KdTree& operator=(KdTree&&) noexcept;

  const RowMatrix& points() const;

  /// Index of the point nearest to each of [q x d] queries. In parallel.
  IndexVector nearest(const RowMatrix& queries) const;

  /// The `count` points nearest to a query of d numbers (all of them where there are fewer), nearest first.
  std::vector<std::int32_t> nearest(const double* query, Eigen::Index count) const;

  /// The points nearer than `radius` to a query of d numbers, in no particular order.
  std::vector<std::int32_t> within(const double* query, double radius) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace exmat::precompute

#include "precompute/alignment/kd_tree.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>

namespace exmat::precompute {
namespace {

constexpr std::size_t kLeafSize = 12;

// What nanoflann reads points through.
struct PointCloud {
  RowMatrix points;

  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.rows()); }
  double kdtree_get_pt(std::size_t point, std::size_t axis) const {
    return points(static_cast<Eigen::Index>(point), static_cast<Eigen::Index>(axis));
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Index =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Adaptor<double, PointCloud>, PointCloud, -1, std::uint32_t>;

}  // namespace

struct KdTree::Tree {
  explicit Tree(RowMatrix points)
      : cloud{std::move(points)},
        index(static_cast<int>(cloud.points.cols()), cloud, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {}

  std::pair<std::uint32_t, double> nearest(const double* query) const {
    std::uint32_t found = 0;
    double squared = 0;
    index.knnSearch(query, 1, &found, &squared);
    return {found, squared};
  }

  PointCloud cloud;
  Index index;
};

KdTree::KdTree(RowMatrix points) : tree_(std::make_unique<Tree>(std::move(points))) {}
KdTree::~KdTree() = default;
KdTree::KdTree(KdTree&&) noexcept = default;
KdTree& KdTree::operator=(KdTree&&) noexcept = default;

const RowMatrix& KdTree::points() const { return tree_->cloud.points; }

IndexVector KdTree::nearest(const RowMatrix& queries) const {
  IndexVector result(queries.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index k = 0; k < queries.rows(); ++k)
    result[k] = static_cast<std::int32_t>(tree_->nearest(queries.row(k).data()).first);
  return result;
}

std::vector<std::int32_t> KdTree::nearest(const double* query, Eigen::Index count) const {
  std::vector<std::uint32_t> found(static_cast<std::size_t>(std::min(count, points().rows())));
  std::vector<double> squared(found.size());
  tree_->index.knnSearch(query, found.size(), found.data(), squared.data());
  return {found.begin(), found.end()};
}

double KdTree::distance(const double* query) const { return std::sqrt(tree_->nearest(query).second); }

}  // namespace exmat::precompute

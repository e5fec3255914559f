#include "precompute/alignment/kd_tree.h"

#include <algorithm>
#include <nanoflann.hpp>

namespace exmat::precompute {
namespace {

constexpr std::size_t kLeafSize = 12;

// Adaptor that nanoflann reads points through.
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

}  // namespace

// One tree for any number of dimensions; those of positions, with and without normals, are known to the compiler.
struct KdTree::Tree {
  explicit Tree(RowMatrix points) : cloud{std::move(points)} {}
  virtual ~Tree() = default;
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;
  virtual void search(const double* query, std::size_t count, std::uint32_t* found, double* squared) const = 0;
  virtual std::vector<std::int32_t> within(const double* query, double squared_radius) const = 0;

  std::pair<std::uint32_t, double> nearest(const double* query) const {
    std::uint32_t found = 0;
    double squared = 0;
    search(query, 1, &found, &squared);
    return {found, squared};
  }

  PointCloud cloud;
};

namespace {

template <int kDimensions, typename Tree>
struct TreeOf final : Tree {
  using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Adaptor<double, PointCloud>, PointCloud, kDimensions,
                                                    std::uint32_t>;

  explicit TreeOf(RowMatrix points)
      : Tree(std::move(points)),
        index(static_cast<int>(this->cloud.points.cols()), this->cloud,
              nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {}

  void search(const double* query, std::size_t count, std::uint32_t* found, double* squared) const override {
    index.knnSearch(query, count, found, squared);
  }
  std::vector<std::int32_t> within(const double* query, double squared_radius) const override {
    std::vector<std::pair<std::uint32_t, double>> found;
    index.radiusSearch(query, squared_radius, found, nanoflann::SearchParams(32, 0, false));
    std::vector<std::int32_t> points;
    for (const auto& [point, squared] : found) points.push_back(static_cast<std::int32_t>(point));
    return points;
  }

  Index index;
};

template <typename Tree>
std::unique_ptr<Tree> make_tree(RowMatrix points) {
  if (points.cols() == 3) return std::make_unique<TreeOf<3, Tree>>(std::move(points));
  if (points.cols() == 6) return std::make_unique<TreeOf<6, Tree>>(std::move(points));
  return std::make_unique<TreeOf<-1, Tree>>(std::move(points));
}

}  // namespace

KdTree::KdTree(RowMatrix points) : tree_(make_tree<Tree>(std::move(points))) {}
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
  tree_->search(query, found.size(), found.data(), squared.data());
  return {found.begin(), found.end()};
}

std::vector<std::int32_t> KdTree::within(const double* query, double radius) const {
  return tree_->within(query, radius * radius);
}

}  // namespace exmat::precompute

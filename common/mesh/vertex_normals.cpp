#include "common/mesh/vertex_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>

namespace exmat {
namespace {

constexpr double kHardEdge = 0.5;       // cosine of the angle from which on an edge is one
constexpr double kSameNormal = 0.9998;  // cosine of the angle below which normals that are given are one

Eigen::RowVector3d unit(const Eigen::RowVector3d& vector) {
  const double length = vector.norm();
  return length > 0 ? Eigen::RowVector3d(vector / length) : Eigen::RowVector3d::UnitZ();
}

/// Vertices at one place, two at least in each set.
std::vector<std::vector<Eigen::Index>> coincident(const VertexArray& vertices) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(vertices.rows()));
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](Eigen::Index k) { return std::tuple(vertices(k, 0), vertices(k, 1), vertices(k, 2), k); };
  std::ranges::sort(order, {}, key);
  std::vector<std::vector<Eigen::Index>> sets;
  for (auto first = order.begin(); first != order.end();) {
    const auto last = std::find_if(first, order.end(), [&](auto k) { return vertices.row(k) != vertices.row(*first); });
    if (last - first > 1) sets.emplace_back(first, last);
    first = last;
  }
  return sets;
}

}  // namespace

VertexNormals::VertexNormals(const VertexArray& vertices, TriangleArray triangles, const VertexArray& given)
    : triangles_(std::move(triangles)) {
  const VertexArray sums = area_sums(vertices);
  const auto has_area = [&](Eigen::Index vertex) { return !sums.row(vertex).isZero(0); };
  for (std::vector<Eigen::Index>& set : coincident(vertices)) {
    std::stable_partition(set.begin(), set.end(), has_area);
    std::vector<std::vector<Eigen::Index>> groups;
    for (const Eigen::Index vertex : set) {
      const auto smooth = [&](const auto& group) {
        if (given.rows() > 0 && !given.row(vertex).isZero(0) && !given.row(group.front()).isZero(0))
          return given.row(vertex).dot(given.row(group.front())) > kSameNormal;
        return !has_area(vertex) || unit(sums.row(group.front())).dot(unit(sums.row(vertex))) > kHardEdge;
      };
      const auto group = std::ranges::find_if(groups, smooth);
      if (group == groups.end())
        groups.push_back({vertex});
      else
        group->push_back(vertex);
    }
    for (auto& group : groups)
      if (group.size() > 1) groups_.push_back(std::move(group));
  }
}

template <class Positions, class Sums>
void VertexNormals::set_area_sums(const Positions& positions, Sums& sums) const {
  using Row = Eigen::Matrix<typename Sums::Scalar, 1, 3>;
  sums.setZero();
  for (const auto corners : triangles_.rowwise()) {
    const Row from = positions.row(corners[0]);
    const Row first = positions.row(corners[1]) - from, second = positions.row(corners[2]) - from;
    const Row area = first.cross(second);
    for (const std::int32_t corner : corners) sums.row(corner) += area;
  }
}

VertexArray VertexNormals::area_sums(const VertexArray& positions) const {
  VertexArray sums(positions.rows(), 3);
  set_area_sums(positions, sums);
  return sums;
}

template <class Sums>
void VertexNormals::share(Sums& sums) const {
  for (const std::vector<Eigen::Index>& group : groups_) {
    Eigen::Matrix<typename Sums::Scalar, 1, 3> sum;
    sum.setZero();
    for (const Eigen::Index vertex : group) sum += sums.row(vertex);
    for (const Eigen::Index vertex : group) sums.row(vertex) = sum;
  }
}

VertexArray VertexNormals::at(const VertexArray& positions) const {
  VertexArray normals = area_sums(positions);
  share(normals);
  for (auto normal : normals.rowwise()) normal = unit(normal);
  return normals;
}

void VertexNormals::read(std::span<const float> positions, std::span<float> normals) const noexcept {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  const Eigen::Map<const Rows> from(positions.data(), std::ssize(positions) / 3, 3);
  Eigen::Map<Rows> sums(normals.data(), from.rows(), 3);
  set_area_sums(from, sums);
  share(sums);
  for (auto normal : sums.rowwise()) normal = unit(normal.template cast<double>()).template cast<float>();
}

RowMatrix VertexNormals::derivatives(const VertexArray& positions, const RowMatrix& displacements) const {
  VertexArray sums = area_sums(positions);
  share(sums);
  RowMatrix derivatives(displacements.rows(), displacements.cols());
  for (Eigen::Index column = 0; column < displacements.cols(); ++column) {
    const auto moved = [&](Eigen::Index vertex) {
      return Eigen::RowVector3d(displacements.block<3, 1>(3 * vertex, column).transpose());
    };
    VertexArray change = VertexArray::Zero(positions.rows(), 3);
    for (const auto corners : triangles_.rowwise()) {
      const Eigen::RowVector3d from = positions.row(corners[0]), start = moved(corners[0]);
      const Eigen::RowVector3d first = positions.row(corners[1]) - from, second = positions.row(corners[2]) - from;
      const Eigen::RowVector3d area =
          (moved(corners[1]) - start).cross(second) + first.cross(moved(corners[2]) - start);
      for (const std::int32_t corner : corners) change.row(corner) += area;
    }
    share(change);
    for (Eigen::Index vertex = 0; vertex < positions.rows(); ++vertex) {
      const double length = sums.row(vertex).norm();
      const Eigen::RowVector3d normal = unit(sums.row(vertex));
      const Eigen::RowVector3d turned = change.row(vertex) - normal * normal.dot(change.row(vertex));
      derivatives.block<3, 1>(3 * vertex, column) =
          length > 0 ? Eigen::Vector3d(turned.transpose() / length) : Eigen::Vector3d::Zero();
    }
  }
  return derivatives;
}

}  // namespace exmat

#include "runtime/sim/contact/rigid_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "common/core/thread_team.h"

namespace exmat::runtime {
namespace {

constexpr int kLeafFaces = 4;
constexpr double kNoMeshDistance = 1e-12;  // of the size: below it normals of the surface say which way is out
constexpr int kMostCells = 16;             // along the longest axis
constexpr double kMeshRounded = 1e-6;      // of a distance in single precision, and more

int corner_of(double u, double v) { return u > 0 ? 0 : v > 0 ? 1 : 2; }

}  // namespace

RigidMesh::RigidMesh(const VertexArray& vertices, const TriangleArray& triangles, double thickness)
    : thickness_(thickness) {
  const auto count = static_cast<int>(triangles.rows());
  std::vector<Box> boxes(static_cast<std::size_t>(count));
  for (int t = 0; t < count; ++t) {
    const auto corner = [&](int c) -> Eigen::Vector3d { return vertices.row(triangles(t, c)); };
    boxes[static_cast<std::size_t>(t)] = {corner(0).cwiseMin(corner(1)).cwiseMin(corner(2)),
                                          corner(0).cwiseMax(corner(1)).cwiseMax(corner(2))};
  }
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  build(boxes, order, 0, count);
  size_ = (nodes_.front().box.high - nodes_.front().box.low).norm();
  set_normals(vertices, triangles, order);
  const Box& all = nodes_.front().box;
  is_room_ = thickness_ == 0 && nearest(all.high + (all.high - all.low)).distance < 0;
  sample_cells();
}

void RigidMesh::build(const std::vector<Box>& boxes, std::vector<int>& order, int first, int last) {
  const std::size_t at = nodes_.size();
  nodes_.emplace_back();
  const auto box_of = [&](int i) -> const Box& {
    return boxes[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])];
  };
  Box all = box_of(first), middles{all.low + all.high, all.low + all.high};
  for (int i = first + 1; i < last; ++i) {
    all.low = all.low.cwiseMin(box_of(i).low);
    all.high = all.high.cwiseMax(box_of(i).high);
    middles.low = middles.low.cwiseMin(box_of(i).low + box_of(i).high);
    middles.high = middles.high.cwiseMax(box_of(i).low + box_of(i).high);
  }
  nodes_[at].box = all;
  nodes_[at].first = first;
  nodes_[at].last = last;
  if (last - first <= kLeafFaces) return;
  Eigen::Index axis = 0;
  (middles.high - middles.low).maxCoeff(&axis);
  const int half = first + (last - first) / 2;
  // All in one order: what nth_element leaves of it is another with each standard library.
  std::sort(order.begin() + first, order.begin() + last, [&](int a, int b) {
    const Box &box_a = boxes[static_cast<std::size_t>(a)], &box_b = boxes[static_cast<std::size_t>(b)];
    const double at_a = box_a.low[axis] + box_a.high[axis], at_b = box_b.low[axis] + box_b.high[axis];
    return at_a != at_b ? at_a < at_b : a < b;
  });
  build(boxes, order, first, half);
  nodes_[at].right = static_cast<int>(nodes_.size());
  build(boxes, order, half, last);
}

void RigidMesh::set_normals(const VertexArray& vertices, const TriangleArray& triangles,
                            const std::vector<int>& order) {
  faces_.resize(order.size());
  std::vector<Eigen::Vector3d> sums(static_cast<std::size_t>(vertices.rows()), Eigen::Vector3d::Zero());
  std::map<std::pair<int, int>, Eigen::Vector3d> edges;
  const auto edge_of = [&](int t, int c) { return std::minmax({triangles(t, c), triangles(t, (c + 1) % 3)}); };
  for (std::size_t i = 0; i < order.size(); ++i) {
    const int t = order[i];
    Face& face = faces_[i];
    for (int c = 0; c < 3; ++c) face.corners[static_cast<std::size_t>(c)] = vertices.row(triangles(t, c));
    const auto& [a, b, c] = face.corners;
    face.normal = (b - a).cross(c - a);
    face.normal.stableNormalize();
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d next = face.corners[(k + 1) % 3] - face.corners[k];
      const Eigen::Vector3d past = face.corners[(k + 2) % 3] - face.corners[k];
      const double angle = std::atan2(next.cross(past).norm(), next.dot(past));
      sums[static_cast<std::size_t>(triangles(t, static_cast<int>(k)))] += angle * face.normal;
      edges.try_emplace(edge_of(t, static_cast<int>(k)), Eigen::Vector3d::Zero()).first->second += face.normal;
    }
  }
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const int corner = static_cast<int>(k);
      faces_[i].vertices[k] = sums[static_cast<std::size_t>(triangles(order[i], corner))];
      faces_[i].edges[k] = edges.at(edge_of(order[i], corner));
    }
}

/// A cell's distance bounds those of its points, since distances change by no more than the way between.
void RigidMesh::sample_cells() {
  const Box& all = nodes_.front().box;
  deepest_ = 0.5 * thickness_;
  cell_ = (all.high - all.low).maxCoeff() / kMostCells;
  if (!(cell_ > 0)) return;
  cells_low_ = all.low.array() - cell_;
  for (int axis = 0; axis < 3; ++axis)
    cell_counts_[axis] = 2 + static_cast<int>(std::ceil((all.high[axis] - all.low[axis]) / cell_ - kMeshRounded));
  cell_distances_.resize(static_cast<std::size_t>(cell_counts_.cast<std::int64_t>().prod()));
  std::vector<double> deepest(static_cast<std::size_t>(cell_counts_[2]), deepest_);
  by_threads(deepest.size(), processor_count(), 1, [&](std::size_t layer, std::size_t) {
    const int z = static_cast<int>(layer);
    for (int y = 0; y < cell_counts_[1]; ++y)
      for (int x = 0; x < cell_counts_[0]; ++x) {
        const Eigen::Vector3d middle = cells_low_ + cell_ * Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5);
        const double distance = nearest(middle).distance;
        deepest[layer] = std::max(deepest[layer], -distance);
        cell_distances_[static_cast<std::size_t>((z * cell_counts_[1] + y) * cell_counts_[0] + x)] =
            static_cast<float>(distance);
      }
  });
  deepest_ = std::ranges::max(deepest);
}

TrianglePoint RigidMesh::nearest_on(int face, const Eigen::Vector3d& point) const noexcept {
  const auto& corners = faces_[static_cast<std::size_t>(face)].corners;
  return nearest_on_triangle(point, corners[0], corners[1], corners[2]);
}

/// Searches within `reach`, nearer branches first.
template <RigidMesh::Search kSearch>
RigidMesh::Found RigidMesh::search(const Eigen::Vector3d& point, double reach) const noexcept {
  struct Waiting {
    int node;
    double bound;  // on the squared distance
  };
  Waiting waiting[64];  // halves of a tree of at most 2^32 leaves
  int count = 0;
  Found best;
  best.on.squared_distance = best.second = reach * reach;
  const double& limit = kSearch == Search::kTwoNearest ? best.second : best.on.squared_distance;
  const auto at = [&](int node) -> const Node& { return nodes_[static_cast<std::size_t>(node)]; };
  waiting[count++] = {0, at(0).box.squared_distance(point)};
  while (count > 0) {
    const auto [index, bound] = waiting[--count];
    if (bound > limit) continue;
    const Node& node = at(index);
    if (node.right > 0) {
      Waiting near{index + 1, at(index + 1).box.squared_distance(point)};
      Waiting far{node.right, at(node.right).box.squared_distance(point)};
      if (near.bound > far.bound) std::swap(near, far);
      if (far.bound <= limit) waiting[count++] = far;
      if (near.bound <= limit) waiting[count++] = near;
      continue;
    }
    for (int face = node.first; face < node.last; ++face) {
      const TrianglePoint here = nearest_on(face, point);
      const double square = here.squared_distance;
      const bool nearer = square < best.on.squared_distance ||
                          (square == best.on.squared_distance && (best.face < 0 || face < best.face));
      if (nearer) {
        if (best.face >= 0) best.second = best.on.squared_distance;
        best.face = face;
        best.on = here;
        if (kSearch == Search::kAny) return best;
      } else if (square < best.second) {
        best.second = square;
      }
    }
  }
  return best;
}

SurfacePoint RigidMesh::nearest(const Eigen::Vector3d& point) const noexcept {
  const Found best = search<Search::kNearest>(point, std::numeric_limits<double>::infinity());
  if (best.face < 0) return {best.second, Eigen::Vector3d::UnitZ(), point};  // not a number
  return surface_of(point, best);
}

SurfacePoint RigidMesh::nearest(const Eigen::Vector3d& point, NearestHint& hint) const noexcept {
  if (hint.triangle >= 0) {
    const Found same{hint.triangle, nearest_on(hint.triangle, point)};
    if (hint.holds(point, std::sqrt(same.on.squared_distance))) return surface_of(point, same);
  }
  const Found best = search<Search::kTwoNearest>(point, std::numeric_limits<double>::infinity());
  if (best.face < 0) return {best.second, Eigen::Vector3d::UnitZ(), point};  // not a number
  hint = {best.face, (1 - kMeshRounded) * std::sqrt(best.second), point};
  return surface_of(point, best);
}

SurfacePoint RigidMesh::surface_of(const Eigen::Vector3d& point, const Found& found) const noexcept {
  const Face& face = faces_[static_cast<std::size_t>(found.face)];
  const Eigen::Vector3d& weights = found.on.barycentric;
  const auto inner = (weights.array() > 0).count();
  const Eigen::Vector3d away = point - found.on.point;
  Eigen::Vector3d out = face.normal;
  if (inner == 1) out = face.vertices[static_cast<std::size_t>(corner_of(weights[0], weights[1]))];
  if (inner == 2) out = face.edges[weights[2] == 0 ? 0 : weights[0] == 0 ? 1 : 2];
  const double side = away.dot(out) >= 0 ? 1 : -1;
  const double distance = std::sqrt(found.on.squared_distance);
  SurfacePoint surface{side * distance, out, found.on.point};
  if (inner < 3 && distance > kNoMeshDistance * size_)
    surface.normal = side / distance * away;
  else if (out.squaredNorm() > 0)
    surface.normal = out.normalized();
  else
    surface.normal = distance > 0 ? Eigen::Vector3d(side / distance * away) : Eigen::Vector3d::UnitZ();
  if (thickness_ == 0) return surface;
  surface.normal *= side;
  surface.distance = distance - 0.5 * thickness_;
  surface.point += 0.5 * thickness_ * surface.normal;
  return surface;
}

bool RigidMesh::may_be_within(const Eigen::Vector3d& point, double radius) const noexcept {
  const double reach = radius + 0.5 * thickness_;
  if (!is_room_ && reach >= 0 && nodes_.front().box.squared_distance(point) > reach * reach) return false;
  if (!cell_distances_.empty()) {
    const Eigen::Vector3d cells = (point - cells_low_) / cell_;
    if ((cells.array() >= 0).all() && (cells.array() < cell_counts_.cast<double>().array()).all()) {
      const Eigen::Vector3i cell = cells.cast<int>();
      const auto index = static_cast<std::size_t>(cell[0]) +
                         static_cast<std::size_t>(cell_counts_[0]) *
                             (static_cast<std::size_t>(cell[1]) +
                              static_cast<std::size_t>(cell_counts_[1]) * static_cast<std::size_t>(cell[2]));
      const double middle = cell_distances_[index];
      const double way = cell_ * (cells - cell.cast<double>() - Eigen::Vector3d::Constant(0.5)).norm();
      const double rounding = kMeshRounded * (std::abs(middle) + cell_);
      if (middle - way - rounding > radius) return false;
      if (middle + way + rounding <= radius) return true;
    }
  }
  if (reach >= 0) {
    if (search<Search::kAny>(point, reach).face >= 0) return true;
    if (thickness_ > 0) return false;
  }
  return nearest(point).distance <= radius;
}

/// A shell is entered by its sides or by capsules about its edges.
std::optional<double> RigidMesh::entry_of(const Face& face, const Ray& ray) const noexcept {
  const auto& [a, b, c] = face.corners;
  const double facing = face.normal.dot(ray.direction), half = 0.5 * thickness_;
  std::optional<double> first;
  if (facing < 0 || (facing > 0 && half > 0)) {
    const Eigen::Vector3d shift = (facing < 0 ? half : -half) * face.normal;
    if (const auto hit = triangle_hit(ray, a + shift, b + shift, c + shift)) first = hit->distance;
  }
  if (half == 0) return first;
  for (std::size_t i = 0; i < 3; ++i)
    first = nearer(first, capsule_entry(ray, face.corners[i], face.corners[(i + 1) % 3], half));
  return first;
}

std::optional<double> RigidMesh::entry(const Ray& ray, double most) const noexcept {
  int waiting[64];  // halves of a tree of at most 2^32 leaves
  int count = 0;
  std::optional<double> first;
  waiting[count++] = 0;
  while (count > 0) {
    const int index = waiting[--count];
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    const auto bound =
        box_entry(ray, node.box.low.array() - 0.5 * thickness_, node.box.high.array() + 0.5 * thickness_);
    if (!bound || *bound > most) continue;
    if (node.right > 0) {
      waiting[count++] = node.right;
      waiting[count++] = index + 1;
      continue;
    }
    for (int face = node.first; face < node.last; ++face)
      if (const auto here = entry_of(faces_[static_cast<std::size_t>(face)], ray); here && *here <= most)
        first = most = *here;
  }
  return first;
}

}  // namespace exmat::runtime

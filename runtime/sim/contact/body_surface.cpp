#include "runtime/sim/contact/body_surface.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "common/mesh/geometry.h"
#include "runtime/kernels/kernels.h"
#include "runtime/sim/contact/first_meeting.h"
#include "runtime/sim/contact/nearest_on_triangle.h"

namespace exmat::runtime {
namespace {

constexpr double kNearlyApproached = (1 + 1e-5) * kApproached;  // but for the rounding of where the nearest point is
constexpr int kLeafTriangles = kLanes;
constexpr int kBlockTriangles = 64;  // whose vertices are moved together
constexpr int kManyLooks = 64;       // a search costs about half a microsecond, all boxes twenty
constexpr double kSameWay = 0.5;     // cosine
constexpr double kGrazing = 0.1;     // cosine
// (a + b)^2 <= (1 + kWayShare) a^2 + (1 + 1 / kWayShare) b^2, b the way that is left.
constexpr double kWayShare = 0.3;

/// Acceptance test of a search for branches and triangles that a bound on the squared distance does not exclude,
/// and how it bounds the triangles of a leaf.
template <class Accepts, class Excludes, class ExcludesTriangle, class BoundTriangles>
struct SearchFilter {
  bool operator()(int triangle, const TrianglePoint& here) const { return accepts(triangle, here); }
  Accepts accepts;
  Excludes excludes;
  ExcludesTriangle excludes_triangle;
  BoundTriangles bound_triangles;
};
template <class Accepts, class Excludes, class ExcludesTriangle, class BoundTriangles>
SearchFilter(Accepts, Excludes, ExcludesTriangle, BoundTriangles)
    -> SearchFilter<Accepts, Excludes, ExcludesTriangle, BoundTriangles>;

/// Corner of one of the triangles of a leaf.
Eigen::Vector3d corner_of(const double* corners, int triangle, int corner) {
  const double* x = corners + 3 * corner * kLanes + triangle;
  return {x[0], x[kLanes], x[2 * kLanes]};
}

/// Largest speed of the point against what moves with velocities of a box [m/s].
double fastest_against(const ClosingPoint& closing, const Eigen::AlignedBox3d& velocities) {
  return (velocities.max() - closing.velocity)
      .cwiseAbs()
      .cwiseMax((velocities.min() - closing.velocity).cwiseAbs())
      .norm();
}
bool is_far(const ClosingPoint& closing, double squared_distance, double speed) {
  const double reach = closing.near + closing.time * speed;
  return squared_distance > reach * reach;
}

/// Across the edge that begins at each corner; -1 where there is none or more than one.
TriangleArray neighbours_of(const TriangleArray& triangles) {
  std::map<std::pair<int, int>, int> edges;  // first triangle of each directed edge
  for (int t = 0; t < triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) edges.try_emplace({triangles(t, c), triangles(t, (c + 1) % 3)}, t);
  TriangleArray neighbours(triangles.rows(), 3);
  for (int t = 0; t < triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) {
      const auto across = edges.find({triangles(t, (c + 1) % 3), triangles(t, c)});
      neighbours(t, c) = across == edges.end() ? -1 : across->second;
    }
  return neighbours;
}

}  // namespace

BodySurface::BodySurface(const VertexArray& rest, const RowMatrix& basis, TriangleArray triangles,
                         const Eigen::Vector3d& origin)
    : rest_(rest.rowwise() - origin.transpose()),
      places_(rest_),
      rows_(basis, Eigen::VectorXi::LinSpaced(rest.rows(), 0, static_cast<int>(rest.rows()) - 1)),
      object_vertices_(static_cast<std::size_t>(rest.rows())),
      triangles_(std::move(triangles)),
      neighbours_(neighbours_of(triangles_)),
      fan_starts_(static_cast<std::size_t>(rest.rows()) + 1, 0),
      tree_(triangles_, rest_, basis, kLeafTriangles, /*full_leaves=*/true),
      leaves_(rest_, triangles_, tree_),
      reach_(rest.rows() > 0 ? rest_.rowwise().norm().maxCoeff() : 0) {
  for (const DeformationTree::Node& node : tree_.nodes()) rest_balls_.push_back({node.centre, node.radius});
  std::iota(object_vertices_.begin(), object_vertices_.end(), 0);
  for (const std::int32_t vertex : triangles_.reshaped<Eigen::RowMajor>())
    ++fan_starts_[static_cast<std::size_t>(vertex) + 1];
  for (std::size_t i = 1; i < fan_starts_.size(); ++i) fan_starts_[i] += fan_starts_[i - 1];
  fans_.resize(static_cast<std::size_t>(triangles_.size()));
  std::vector<int> next = fan_starts_;
  for (int t = 0; t < triangles_.rows(); ++t)
    for (int c = 0; c < 3; ++c) fans_[static_cast<std::size_t>(next[static_cast<std::size_t>(triangles_(t, c))]++)] = t;
}

BodySurface BodySurface::of_tets(const TetArray& tets, const VertexArray& rest, const RowMatrix& basis,
                                 const Eigen::Vector3d& origin) {
  TriangleArray triangles = surface_triangles(tets);
  std::vector<int> used(static_cast<std::size_t>(rest.rows()), -1), kept;
  for (std::int32_t& vertex : triangles.reshaped<Eigen::RowMajor>()) {
    int& number = used[static_cast<std::size_t>(vertex)];
    if (number < 0) {
      number = static_cast<int>(kept.size());
      kept.push_back(vertex);
    }
    vertex = number;
  }
  RowMatrix rows(3 * kept.size(), basis.cols());
  for (std::size_t i = 0; i < kept.size(); ++i)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = basis.middleRows<3>(3 * kept[i]);
  BodySurface surface(rest(kept, Eigen::all), rows, std::move(triangles), origin);
  surface.object_vertices_ = std::move(kept);
  return surface;
}

void BodySurface::move(const VertexArray& positions, const VertexArray& velocities) {
  places_ = positions;
  rows_.set_one_mode(velocities);
  if (places_.rows() == 0) return;
  reach_ = places_.rowwise().norm().maxCoeff();
  tree_.fit(velocities.rowwise().norm().maxCoeff(), [this](int item, Eigen::AlignedBox3d& box) {
    const int triangle = tree_.order()[static_cast<std::size_t>(item)];
    for (int c = 0; c < 3; ++c) box.extend(places_.row(triangles_(triangle, c)).transpose());
  });
}

SurfaceShape BodySurface::make_shape() const {
  SurfaceShape shape;
  shape.q.setZero(modes());
  shape.x = shape.v = AlignedArray(modes());
  shape.positions = places_;
  shape.position_of.assign(static_cast<std::size_t>(rest_.rows()), 0);
  shape.balls.resize(tree_.nodes().size());
  shape.boxes.resize(tree_.nodes().size());
  shape.ball_of.assign(tree_.nodes().size(), 0);
  shape.box_of.assign(tree_.nodes().size(), 0);
  shape.velocities = VertexArray::Zero(rest_.rows(), 3);
  shape.velocity_boxes.resize(tree_.nodes().size());
  shape.leaves = leaves_.make_placed();
  return shape;
}

void BodySurface::place(const Eigen::VectorXd& q, SurfaceShape& shape) const noexcept {
  shape.q = q;
  std::copy(q.begin(), q.end(), shape.x.data());
  shape.moves = false;
  shape.q_norm = q.norm();
  ++shape.placed;
  shape.looks = 0;
}

void BodySurface::place(const Eigen::VectorXd& q, const Eigen::VectorXd& v, SurfaceShape& shape) const noexcept {
  place(q, shape);
  std::copy(v.begin(), v.end(), shape.v.data());
  shape.moves = true;
}

const DeformationTree::Ball& BodySurface::ball(int node, SurfaceShape& shape) const noexcept {
  const auto index = static_cast<std::size_t>(node);
  if (shape.ball_of[index] != shape.placed) {
    shape.balls[index] = tree_.ball(node, shape.q, shape.q_norm);
    shape.ball_of[index] = shape.placed;
  }
  return shape.balls[index];
}

Eigen::Vector3d BodySurface::position(int vertex, SurfaceShape& shape) const noexcept {
  int& placed = shape.position_of[static_cast<std::size_t>(vertex)];
  if (placed != shape.placed) {
    Eigen::Vector3d moved;
    rows_.products(&vertex, 1, shape.x, moved.data());
    shape.positions.row(vertex) = places_.row(vertex) + moved.transpose();
    if (shape.moves) rows_.products(&vertex, 1, shape.v, shape.velocities.row(vertex).data());
    placed = shape.placed;
  }
  return shape.positions.row(vertex);
}

void BodySurface::place_all(SurfaceShape& shape) const noexcept {
  rows_.products_of_all(rest_.rows(), shape.x, shape.positions.data(), shape.moves ? &shape.v : nullptr,
                        shape.velocities.data());
  shape.positions += places_;
  std::ranges::fill(shape.position_of, shape.placed);
  leaves_.place_all(shape.positions, shape.moves ? &shape.velocities : nullptr, shape.leaves);
}

double BodySurface::fastest(const SurfaceShape& shape) const noexcept {
  return shape.velocities.rows() > 0 ? std::sqrt(shape.velocities.rowwise().squaredNorm().maxCoeff()) : 0;
}

std::ptrdiff_t BodySurface::near_leaves(const LeafQuery& query, const LeafPanel* panels, std::ptrdiff_t count,
                                        const SurfaceShape& shape, LeafPanel* kept) const noexcept {
  return leaves_.near(shape.leaves, shape.moves, query, panels, count, kept);
}

/// True if a branch is small enough for the boxes of its own triangles.
bool BodySurface::is_block(int node) const noexcept {
  const DeformationTree::Node& branch = tree_.node(node);
  return branch.last - branch.first <= kBlockTriangles;
}

/// The boxes of a branch and of those below it; after it come all of them.
void BodySurface::open_block(int node, SurfaceShape& shape) const noexcept {
  for (int below = tree_.node(node).next - 1; below >= node; --below) {
    const DeformationTree::Node& branch = tree_.node(below);
    Eigen::AlignedBox3d &box = shape.boxes[static_cast<std::size_t>(below)],
                        &velocities = shape.velocity_boxes[static_cast<std::size_t>(below)];
    shape.box_of[static_cast<std::size_t>(below)] = shape.placed;
    if (!branch.is_leaf) {
      const auto one = static_cast<std::size_t>(below) + 1;
      const auto other = static_cast<std::size_t>(tree_.node(below + 1).next);
      box = shape.boxes[one].merged(shape.boxes[other]);
      if (shape.moves) velocities = shape.velocity_boxes[one].merged(shape.velocity_boxes[other]);
      continue;
    }
    for (int i = branch.first; i < branch.last; ++i)
      for (int c = 0; c < 3; ++c) position(triangles_(tree_.order()[static_cast<std::size_t>(i)], c), shape);
    box = leaves_.place(branch.first, shape.positions, shape.leaves);
    if (shape.moves) velocities = leaves_.velocities(branch.first, shape.velocities, shape.leaves);
  }
}

/// Bounds that hold for any q are wide where the body is far from rest: from many looks on the boxes of all branches
/// cost less than the blocks that would be looked into for nothing. What is found is the same.
void BodySurface::count_look(SurfaceShape& shape) const noexcept {
  if (++shape.looks == kManyLooks && !tree_.empty() && shape.box_of[0] != shape.placed) open_block(0, shape);
}

/// A bound on the squared distance from a branch. A block that is not farther away than its ball is opened by
/// whoever looks into it.
double BodySurface::squared_bound(int node, const Eigen::Vector3d& point, SurfaceShape& shape) const noexcept {
  if (shape.box_of[static_cast<std::size_t>(node)] == shape.placed)
    return shape.boxes[static_cast<std::size_t>(node)].squaredExteriorDistance(point);
  const DeformationTree::Ball& around = ball(node, shape);
  const double bound = std::max(0.0, (point - around.centre).norm() - around.radius);
  return bound * bound;
}

bool BodySurface::may_be_within(const Eigen::Vector3d& point, double radius, SurfaceShape& shape) const noexcept {
  count_look(shape);
  const auto count = static_cast<int>(tree_.nodes().size());
  const double square = radius * radius;
  for (int node = 0; node < count;) {
    bool near = squared_bound(node, point, shape) <= square;
    if (near && is_block(node) && shape.box_of[static_cast<std::size_t>(node)] != shape.placed) {
      open_block(node, shape);
      near = squared_bound(node, point, shape) <= square;
    }
    if (near && tree_.node(node).is_leaf) return true;
    node = near ? node + 1 : tree_.node(node).next;
  }
  return false;
}

template <class Accept>
std::optional<SurfaceHit> BodySurface::search(const Eigen::Vector3d& point, double radius, SurfaceShape& shape,
                                              const Accept& accepts, Leaves leaves) const noexcept {
  TrianglePoint best;
  int found = -1;
  double nearest = radius * radius;
  const auto look_into = [&](int first, int last) {
    const double* const corners = SurfaceLeaves::corners(first, shape.leaves);
    std::array<double, kLeafTriangles> bounds;
    const double limit = kSurely * nearest;
    unsigned near = 0;
    if constexpr (requires { accepts.bound_triangles(first, limit, bounds.data()); })
      near = accepts.bound_triangles(first, limit, bounds.data());
    else
      near = kernels().triangle_distances(corners, point.data(), limit, bounds.data());
    for (near &= (1U << (last - first)) - 1U; near != 0; near &= near - 1) {
      const int own = std::countr_zero(near);
      const double away = bounds[static_cast<std::size_t>(own)];
      const int triangle = tree_.order()[static_cast<std::size_t>(first + own)];
      if constexpr (requires { accepts.excludes_triangle(triangle, away); })
        if (accepts.excludes_triangle(triangle, away)) continue;
      const TrianglePoint here = nearest_on_triangle(point, corner_of(corners, own, 0), corner_of(corners, own, 1),
                                                     corner_of(corners, own, 2));
      if (here.squared_distance > nearest) continue;
      if (here.squared_distance == nearest && found >= 0 && triangle > found) continue;
      if (!accepts(triangle, here)) continue;
      nearest = here.squared_distance;
      best = here;
      found = triangle;
    }
  };
  if (leaves) {
    for (const LeafPanel& panel : *leaves)
      for (unsigned lanes = panel.lanes; lanes != 0; lanes &= lanes - 1) {
        const int first = (panel.panel * static_cast<int>(kLanes) + std::countr_zero(lanes)) * kLeafTriangles;
        look_into(first, std::min(first + kLeafTriangles, static_cast<int>(triangles_.rows())));
      }
  } else {
    search_tree(point, nearest, shape, accepts, look_into);
  }
  if (found < 0) return std::nullopt;
  const Eigen::Vector3d out = outward(found, best.barycentric, shape);
  const Eigen::Vector3d away = point - best.point;
  const double distance = std::sqrt(nearest);
  const double side = away.dot(out) >= 0 ? 1 : -1;
  SurfaceHit hit{found, best.barycentric, side * distance, out};
  if (distance * distance > kOnTriangle * kOnTriangle * area_normal(found, shape).norm())
    hit.normal = side / distance * away;
  return hit;
}

template <class Accept, class Look>
void BodySurface::search_tree(const Eigen::Vector3d& point, const double& nearest, SurfaceShape& shape,
                              const Accept& accepts, const Look& look_into) const noexcept {
  struct Waiting {
    int node;
    double bound;  // on the squared distance
  };
  count_look(shape);
  const auto bound_of = [&](int node) { return Waiting{node, squared_bound(node, point, shape)}; };
  Waiting waiting[64];  // halves of a tree of at most 2^32 leaves
  int count = 0;
  if (!tree_.empty()) waiting[count++] = bound_of(0);
  while (count > 0) {
    const int node = waiting[--count].node;
    const double bound = waiting[count].bound;
    if (bound > nearest) continue;
    if constexpr (requires { accepts.excludes(node, bound); })
      if (accepts.excludes(node, bound)) continue;
    if (is_block(node) && shape.box_of[static_cast<std::size_t>(node)] != shape.placed) {
      open_block(node, shape);
      if (squared_bound(node, point, shape) > nearest) continue;
    }
    const DeformationTree::Node& branch = tree_.node(node);
    if (!branch.is_leaf) {
      Waiting near = bound_of(node + 1), far = bound_of(tree_.node(node + 1).next);
      if (near.bound > far.bound) std::swap(near, far);
      waiting[count++] = far;
      waiting[count++] = near;
      continue;
    }
    look_into(branch.first, branch.last);
  }
}

std::optional<SurfaceHit> BodySurface::nearest(const Eigen::Vector3d& point, double radius, SurfaceShape& shape,
                                               const Eigen::Vector3d* facing) const noexcept {
  if (facing == nullptr) return search(point, radius, shape, [](int, const TrianglePoint&) { return true; }, {});
  return search(point, radius, shape,
                [&](int triangle, const TrianglePoint&) { return !looks_along(triangle, *facing, shape); }, {});
}

std::optional<SurfaceHit> BodySurface::nearest_looking(const Eigen::Vector3d& point, double radius, SurfaceShape& shape,
                                                       const Eigen::Vector3d& way) const noexcept {
  return search(point, radius, shape,
                [&](int triangle, const TrianglePoint&) { return looks_along(triangle, way, shape); }, {});
}

std::optional<SurfaceHit> BodySurface::exit(const Eigen::Vector3d& point, const Eigen::Vector3d& way, double most,
                                            SurfaceShape& shape) const noexcept {
  const auto from_inside = [&](const Eigen::Vector3d& at, double left) {
    auto hit = nearest(at, left, shape);
    if (hit) *hit = {hit->triangle, hit->barycentric, std::max(0.0, -hit->distance), -hit->normal};
    return hit;
  };
  auto left = first_meeting(point, point + most * way, from_inside);
  if (!left) return left;
  const auto corner = [&](int c) { return position(triangles_(left->triangle, c), shape); };
  const Eigen::Vector3d a = corner(0), ab = corner(1) - a, ac = corner(2) - a, across = ab.cross(ac), from = point - a;
  const double approach = across.dot(way);
  if (!(approach > kGrazing * across.norm())) return std::nullopt;
  // The point of its plane on the ray, by which forces along `way` turn neither body.
  const double distance = -across.dot(from) / approach;
  const Eigen::Vector3d on = from + distance * way;
  const double square = across.squaredNorm();
  const double second = on.cross(ac).dot(across) / square, third = ab.cross(on).dot(across) / square;
  return SurfaceHit{left->triangle, {1 - second - third, second, third}, -std::max(0.0, distance), way};
}

/// A search for what is nearer than half of its distance at rest, or may be once it has moved by `way` [m].
template <class Accepts>
auto BodySurface::approach_filter(const Eigen::Vector3d& point, const Eigen::Vector3d& rest, const SurfaceHit& place,
                                  double way, const SurfaceShape& shape, const ClosingPoint* closing,
                                  const Accepts& accepts) const noexcept {
  const auto is_beyond = [way](double squared_distance, double at_rest) {
    const double near = kSurelyApproached * at_rest + way;
    return squared_distance >= near * near;
  };
  // No point of the branch is farther away at rest than the far side of its ball.
  const auto excludes = [=, &shape, this](int node, double bound) {
    const auto index = static_cast<std::size_t>(node);
    if (closing != nullptr && shape.box_of[index] == shape.placed &&
        is_far(*closing, bound, fastest_against(*closing, shape.velocity_boxes[index])))
      return true;
    const DeformationTree::Ball& at_rest = rest_balls_[index];
    return is_beyond(bound, (rest - at_rest.centre).norm() + at_rest.radius);
  };
  const int own = vertex_at(place);
  const auto excludes_triangle = [=, &shape, this](int triangle, double bound) {
    double farthest = 0, fastest = 0;
    for (int c = 0; c < 3; ++c) {
      const int vertex = triangles_(triangle, c);
      if (way > 0) farthest = std::max(farthest, (rest - rest_.row(vertex).transpose()).squaredNorm());
      if (closing != nullptr)
        fastest = std::max(fastest, (closing->velocity - shape.velocities.row(vertex).transpose()).squaredNorm());
    }
    if (closing != nullptr && is_far(*closing, bound, std::sqrt(fastest))) return true;
    return way > 0 && is_beyond(bound, std::sqrt(farthest));
  };
  const double share =
      way > 0 ? (1 + kWayShare) * kSurelyApproached * kSurelyApproached : kNearlyApproached * kNearlyApproached;
  const double beyond = (1 + 1 / kWayShare) * kSurely * way * way;
  // Most triangles that are near are the vertex's own neighbours, which a bound without divisions excludes.
  const auto bound_triangles = [&, own, way, share, beyond, this](int first, double limit, double* bounds) -> unsigned {
    const double* const corners = SurfaceLeaves::corners(first, shape.leaves);
    const double* const rest_corners = leaves_.rest_corners(first);
    unsigned near =
        kernels().approachable_triangles(corners, point.data(), rest_corners, rest.data(), share, beyond, limit);
    for (unsigned lanes = own >= 0 ? near : 0; lanes != 0; lanes &= lanes - 1) {
      // The last leaf has the last triangle again.
      const int index = std::min(first + std::countr_zero(lanes), static_cast<int>(triangles_.rows()) - 1);
      const auto corners_of = triangles_.row(tree_.order()[static_cast<std::size_t>(index)]);
      if ((corners_of.array() == own).any()) near &= ~(lanes & -lanes);
    }
    if (near == 0) return 0;
    if (way > 0) return near & kernels().triangle_distances(corners, point.data(), limit, bounds);
    return near &
           kernels().approached_triangles(corners, point.data(), rest_corners, rest.data(), share, limit, bounds);
  };
  return SearchFilter{accepts, excludes, excludes_triangle, bound_triangles};
}

std::optional<SurfaceHit> BodySurface::nearest_approached(const Eigen::Vector3d& point, const Eigen::Vector3d& rest,
                                                          const SurfaceHit& place, double radius, SurfaceShape& shape,
                                                          const ClosingPoint* closing, Leaves leaves) const noexcept {
  const double itself = kOnTriangle * kOnTriangle * reach_ * reach_;
  std::optional<Eigen::Vector3d> facing;  // few vertices have come near to anything
  const auto accepts = [&](int triangle, const TrianglePoint& here) {
    const double at_rest = (rest - point_of({triangle, here.barycentric}, rest_)).squaredNorm();
    if (!(here.squared_distance < kApproached * kApproached * at_rest) || at_rest <= itself) return false;
    if (!facing) facing = normal_of(place, shape);
    return !looks_along(triangle, *facing, shape);
  };
  return search(point, radius, shape, approach_filter(point, rest, place, 0, shape, closing, accepts), leaves);
}

double BodySurface::approach_distance(const Eigen::Vector3d& point, const Eigen::Vector3d& rest,
                                      const SurfaceHit& place, double radius, double way, SurfaceShape& shape,
                                      Leaves leaves) const noexcept {
  // Any point of the triangle may become the nearest: none is farther away at rest than the corners, by
  // excludes_triangle.
  const auto accepts = [](int, const TrianglePoint&) { return true; };
  const auto hit =
      search(point, radius, shape, approach_filter(point, rest, place, way, shape, nullptr, accepts), leaves);
  return hit ? std::abs(hit->distance) : std::numeric_limits<double>::infinity();
}

int BodySurface::vertex_at(const SurfaceHit& hit) const noexcept {
  Eigen::Index corner = 0;
  return hit.barycentric.maxCoeff(&corner) == 1 ? triangles_(hit.triangle, corner) : -1;
}

Eigen::Vector3d BodySurface::velocity_of(const SurfaceHit& hit, SurfaceShape& shape) const noexcept {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  for (int c = 0; c < 3; ++c) {
    const int vertex = triangles_(hit.triangle, c);
    position(vertex, shape);
    velocity += hit.barycentric[c] * shape.velocities.row(vertex).transpose();
  }
  return velocity;
}

Eigen::Vector3d BodySurface::normal_of(const SurfaceHit& hit, SurfaceShape& shape) const noexcept {
  return outward(hit.triangle, hit.barycentric, shape).normalized();
}

bool BodySurface::looks_along(int triangle, const Eigen::Vector3d& facing, SurfaceShape& shape) const noexcept {
  const Eigen::Vector3d normal = area_normal(triangle, shape);
  return normal.dot(facing) > kSameWay * normal.norm();
}

/// Its length is twice the area.
Eigen::Vector3d BodySurface::area_normal(int triangle, SurfaceShape& shape) const noexcept {
  const Eigen::Vector3d a = position(triangles_(triangle, 0), shape);
  return (position(triangles_(triangle, 1), shape) - a).cross(position(triangles_(triangle, 2), shape) - a);
}

Eigen::Vector3d BodySurface::vertex_normal(int vertex, SurfaceShape& shape) const noexcept {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const auto at = static_cast<std::size_t>(vertex);
  for (int i = fan_starts_[at]; i < fan_starts_[at + 1]; ++i) {
    const int triangle = fans_[static_cast<std::size_t>(i)];
    int corner = 0;
    while (triangles_(triangle, corner) != vertex) ++corner;
    const Eigen::Vector3d here = position(vertex, shape);
    const Eigen::Vector3d to_next = position(triangles_(triangle, (corner + 1) % 3), shape) - here;
    const Eigen::Vector3d to_last = position(triangles_(triangle, (corner + 2) % 3), shape) - here;
    const Eigen::Vector3d normal = to_next.cross(to_last);
    const double length = normal.norm();
    if (length > 0) sum += std::atan2(length, to_next.dot(to_last)) / length * normal;
  }
  return sum;
}

/// Unit normal of the face, edge or vertex that a point of a triangle is on.
Eigen::Vector3d BodySurface::outward(int triangle, const Eigen::Vector3d& barycentric,
                                     SurfaceShape& shape) const noexcept {
  int zeros = 0, corner = 0, missing = 0;
  for (int c = 0; c < 3; ++c) {
    if (barycentric[c] > 0) {
      corner = c;
    } else {
      missing = c;
      ++zeros;
    }
  }
  Eigen::Vector3d normal = area_normal(triangle, shape);
  if (zeros == 2) {
    normal = vertex_normal(triangles_(triangle, corner), shape);
  } else if (zeros == 1) {
    const int across = neighbours_(triangle, (missing + 1) % 3);
    if (across >= 0) normal = normal.stableNormalized() + area_normal(across, shape).stableNormalized();
  }
  const double length = normal.stableNorm();
  return length > 0 ? Eigen::Vector3d(normal / length) : Eigen::Vector3d::UnitZ();
}

Eigen::Vector3d BodySurface::point_of(const SurfaceHit& hit, const VertexArray& vertices) const noexcept {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int c = 0; c < 3; ++c) point += hit.barycentric[c] * vertices.row(triangles_(hit.triangle, c)).transpose();
  return point;
}

void BodySurface::basis_of(const SurfaceHit& hit, Eigen::Ref<RowMatrix> rows) const noexcept {
  rows.setZero();
  for (int c = 0; c < 3; ++c) rows += hit.barycentric[c] * rows_[triangles_(hit.triangle, c)];
}

RowMatrix BodySurface::approach_bounds(const VertexArray& rest, const RowMatrix& basis) const {
  RowMatrix bounds = RowMatrix::Zero(rest.rows(), modes());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    for (Eigen::Index t = 0; t < triangles_.rows(); ++t) {
      const auto corner = [&](int c) -> Eigen::Vector3d { return rest_.row(triangles_(t, c)); };
      const double distance =
          std::sqrt(nearest_on_triangle(rest.row(i), corner(0), corner(1), corner(2)).squared_distance);
      const Eigen::Vector3d first = corner(1) - corner(0), second = corner(2) - corner(0);
      const bool beside = distance * distance <= kOnTriangle * kOnTriangle * first.cross(second).norm();
      Eigen::Matrix<double, 3, 2> edges;
      edges << first, second;
      const Eigen::Matrix2d metric = (edges.transpose() * edges).inverse();
      for (Eigen::Index j = 0; j < modes(); ++j) {
        const auto moved = [&](int c) -> Eigen::Vector3d { return rows_[triangles_(t, c)].col(j); };
        double ratio = 0;
        if (beside) {  // the norm of the gradient in the triangle is above that of its singular values
          Eigen::Matrix<double, 3, 2> change;
          change << moved(1) - moved(0), moved(2) - moved(0);
          ratio = std::sqrt((change * metric * change.transpose()).trace());
        } else {
          const Eigen::Vector3d own = basis.block<3, 1>(3 * i, j);
          for (int c = 0; c < 3; ++c) ratio = std::max(ratio, (moved(c) - own).norm() / distance);
        }
        bounds(i, j) = std::max(bounds(i, j), ratio / (1 - kApproached));
      }
    }
  return bounds;
}

}  // namespace exmat::runtime

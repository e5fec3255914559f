#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/sim/contact/deformation_tree.h"
#include "runtime/sim/contact/surface_leaves.h"
#include "runtime/sim/contact/vertex_rows.h"

namespace exmat::runtime {

/// The point of a deformed surface nearest to a given one, frame of the body.
struct SurfaceHit {
  int triangle = 0;
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();  ///< place of the nearest point, >= 0, sum 1
  double distance = 0;                                    ///< negative inside [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();      ///< unit, outward: the gradient of the distance
};

/// Motion of a point that parts of the body's own surface may come near to, and its limit: far is what is farther
/// away than `near` and the way of the two against each other in `time`.
struct ClosingPoint {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< velocity of the point in the frame of the body [m/s]
  double near = 0;                                     ///< [m]
  double time = 0;                                     ///< [s]
};

/// Below this share of the size of a triangle normals of the surface say which way is out.
inline constexpr double kOnTriangle = 1e-9;
inline constexpr double kApproached = 0.5;   ///< share of the distance at rest: what is nearer has come near
inline constexpr double kSurely = 1 + 1e-9;  ///< times a bound: whatever rounding does
inline constexpr double kSurelyApproached = kSurely * kApproached;

/// A surface at some q: what was computed of it so far. Sized once by BodySurface::make_shape(); one thread at a time.
struct SurfaceShape {
  Eigen::VectorXd q;  ///< [r]
  AlignedArray x;     ///< the same, padded
  double q_norm = 0;
  int placed = 0;                            ///< times that it was placed
  int looks = 0;                             ///< searches since then
  VertexArray positions;                     ///< k x 3, where `position_of` is `placed` [m]
  std::vector<DeformationTree::Ball> balls;  ///< balls about branches, from their bounds
  std::vector<Eigen::AlignedBox3d> boxes;    ///< boxes about branches within a block, from the positions
  std::vector<int> position_of, ball_of, box_of;

  // Velocities beside positions and boxes, if it was placed with one.
  bool moves = false;
  AlignedArray v;          ///< padded(r)
  VertexArray velocities;  ///< [m/s]
  std::vector<Eigen::AlignedBox3d> velocity_boxes;

  PlacedLeaves leaves;  ///< those within a block; after place_all() all of them
};

/// The closed surface of a reduced body: signed distances to it as it deforms, in the frame of the body. Only what is
/// near is ever computed: branches of the tree of bounds, and of those near blocks of triangles, with boxes about them
/// as they are. Inside and outside are told apart by angle-weighted normals (Baerentzen and Aanaes 2005). r modes. No
/// call but the constructor and make_shape() allocates.
class BodySurface {
 public:
  /// Leaves to search, by near_leaves(); without them the tree is searched.
  using Leaves = std::optional<std::span<const LeafPanel>>;

  BodySurface() = default;
  /// Vertices at rest `rest` [k x 3, world, m], moved by `basis` [3k x r]; `triangles` [f x 3] of them look outward.
  /// `origin` [m], world: what rest positions are about, BodyFrame::origin().
  BodySurface(const VertexArray& rest, const RowMatrix& basis, TriangleArray triangles, const Eigen::Vector3d& origin);

  /// The boundary of tetrahedra [n_t x 4] of points at rest [n x 3], moved by a basis [3n x r].
  static BodySurface of_tets(const TetArray& tets, const VertexArray& rest, const RowMatrix& basis,
                             const Eigen::Vector3d& origin);

  /// The same of ContactSet::move().
  void move(const VertexArray& positions, const VertexArray& velocities);

  Eigen::Index vertices() const noexcept { return rest_.rows(); }
  /// Number of a vertex in the object.
  int object_vertex(int vertex) const noexcept { return object_vertices_[static_cast<std::size_t>(vertex)]; }
  int corner(int triangle, int c) const noexcept { return triangles_(triangle, c); }

  Eigen::Index modes() const noexcept { return rows_.modes(); }
  Eigen::Index triangles() const noexcept { return triangles_.rows(); }

  double reach() const noexcept { return reach_; }  ///< largest distance of a vertex at rest from the origin [m]
  const MovementBound& movement() const noexcept { return tree_.movement(); }  ///< bound for its vertices

  SurfaceShape make_shape() const;
  void place(const Eigen::VectorXd& q, SurfaceShape& shape) const noexcept;
  /// Moving with v [r], for ClosingPoint.
  void place(const Eigen::VectorXd& q, const Eigen::VectorXd& v, SurfaceShape& shape) const noexcept;
  /// After place(): the whole of it at once.
  void place_all(SurfaceShape& shape) const noexcept;
  /// Largest speed of a vertex of a moving shape in the frame of the body, after place_all() [m/s].
  double fastest(const SurfaceShape& shape) const noexcept;
  /// Those of some leaves, of all_leaves() at first, where parts of the surface may have come near to some points by
  /// nearest_approached() with a closing point, or approach_distance(), with kSurelyApproached as the share of the
  /// query. After place_all(). Returns how many panels of them are kept; `kept` has room for `count`.
  std::ptrdiff_t near_leaves(const LeafQuery& query, const LeafPanel* panels, std::ptrdiff_t count,
                             const SurfaceShape& shape, LeafPanel* kept) const noexcept;
  const std::vector<LeafPanel>& all_leaves() const noexcept { return leaves_.all(); }
  /// The vertex of the surface that a hit is at, -1 elsewhere.
  int vertex_at(const SurfaceHit& hit) const noexcept;
  /// At v in the frame of the body [m/s]; near a search that found something there.
  Eigen::Vector3d velocity_of(const SurfaceHit& hit, SurfaceShape& shape) const noexcept;

  /// A ball about all of it.
  DeformationTree::Ball bound(const Eigen::VectorXd& q) const noexcept { return tree_.ball(0, q, q.norm()); }

  /// False only where no point of the surface is within `radius` of `point`.
  bool may_be_within(const Eigen::Vector3d& point, double radius, SurfaceShape& shape) const noexcept;

  /// Nothing where the surface is farther away than `radius` [m]. With a unit vector `facing`, that of the surface that
  /// does not look the same way, within 60 degrees.
  std::optional<SurfaceHit> nearest(const Eigen::Vector3d& point, double radius, SurfaceShape& shape,
                                    const Eigen::Vector3d* facing = nullptr) const noexcept;

  /// nearest() on the part of the surface that looks the same way as a unit vector, within 60 degrees.
  std::optional<SurfaceHit> nearest_looking(const Eigen::Vector3d& point, double radius, SurfaceShape& shape,
                                            const Eigen::Vector3d& way) const noexcept;

  /// The point by which the ray from a point inside, along a unit vector `way`, leaves the surface first, at most
  /// `most` [m] away; its normal is `way`. Nothing where the ray grazes the surface.
  std::optional<SurfaceHit> exit(const Eigen::Vector3d& point, const Eigen::Vector3d& way, double most,
                                 SurfaceShape& shape) const noexcept;

  /// nearest() for a point of the body itself, at rest at `rest`: of the surface that has come nearer to it than half
  /// of how far away it is at rest, and does not look the same way as the surface at `place`, its own. No neighbour is,
  /// as long as nothing is compressed to half its length. With `closing`, of a shape that moves, what is not far by it.
  std::optional<SurfaceHit> nearest_approached(const Eigen::Vector3d& point, const Eigen::Vector3d& rest,
                                               const SurfaceHit& place, double radius, SurfaceShape& shape,
                                               const ClosingPoint* closing = nullptr,
                                               Leaves leaves = std::nullopt) const noexcept;

  /// Least distance of what nearest_approached() finds within `radius`, as long as the point and the surface
  /// move by no more than `way` together [m] beyond that; infinity where it finds nothing.
  double approach_distance(const Eigen::Vector3d& point, const Eigen::Vector3d& rest, const SurfaceHit& place,
                           double radius, double way, SurfaceShape& shape, Leaves leaves = std::nullopt) const noexcept;

  /// The unit normal at a point of the surface as it is deformed, outward.
  Eigen::Vector3d normal_of(const SurfaceHit& hit, SurfaceShape& shape) const noexcept;

  /// [k x r] c: while sum_j c_ij |q_j| < 1 no point of the surface has come nearer to point i of these of it, at rest
  /// at `rest` [k x 3] and moved by `basis` [3k x r], than half of how far away it is at rest (a certificate after
  /// Barbic and James 2010). Takes k f r products.
  RowMatrix approach_bounds(const VertexArray& rest, const RowMatrix& basis) const;

  /// The vertices at q = 0 [k x 3, m].
  const VertexArray& places() const noexcept { return places_; }

  /// Its material point of a hit: at q = 0 [m], and the rows of the basis [3 x r].
  Eigen::Vector3d place_of(const SurfaceHit& hit) const noexcept { return point_of(hit, places_); }
  void basis_of(const SurfaceHit& hit, Eigen::Ref<RowMatrix> rows) const noexcept;

 private:
  Eigen::Vector3d point_of(const SurfaceHit& hit, const VertexArray& vertices) const noexcept;
  bool is_block(int node) const noexcept;
  void count_look(SurfaceShape& shape) const noexcept;
  void open_block(int node, SurfaceShape& shape) const noexcept;
  double squared_bound(int node, const Eigen::Vector3d& point, SurfaceShape& shape) const noexcept;
  template <class Accepts>
  auto approach_filter(const Eigen::Vector3d& point, const Eigen::Vector3d& rest, const SurfaceHit& place, double way,
                       const SurfaceShape& shape, const ClosingPoint* closing, const Accepts& accepts) const noexcept;
  template <class Accept>
  std::optional<SurfaceHit> search(const Eigen::Vector3d& point, double radius, SurfaceShape& shape,
                                   const Accept& accepts, Leaves leaves) const noexcept;
  template <class Accept, class Look>
  void search_tree(const Eigen::Vector3d& point, const double& nearest, SurfaceShape& shape, const Accept& accepts,
                   const Look& look_into) const noexcept;
  const DeformationTree::Ball& ball(int node, SurfaceShape& shape) const noexcept;
  Eigen::Vector3d position(int vertex, SurfaceShape& shape) const noexcept;
  Eigen::Vector3d area_normal(int triangle, SurfaceShape& shape) const noexcept;
  bool looks_along(int triangle, const Eigen::Vector3d& facing, SurfaceShape& shape) const noexcept;
  Eigen::Vector3d outward(int triangle, const Eigen::Vector3d& barycentric, SurfaceShape& shape) const noexcept;
  Eigen::Vector3d vertex_normal(int vertex, SurfaceShape& shape) const noexcept;

  VertexArray rest_;    // k x 3, X
  VertexArray places_;  // k x 3, X unless moved
  VertexRows rows_;     // of the basis
  std::vector<int> object_vertices_;
  TriangleArray triangles_;
  TriangleArray neighbours_;                       // f x 3, across the edge that begins at each corner; -1: none
  std::vector<int> fan_starts_, fans_;             // triangles of each vertex
  DeformationTree tree_;                           // of the triangles
  std::vector<DeformationTree::Ball> rest_balls_;  // about its branches at rest
  SurfaceLeaves leaves_;
  double reach_ = 0;
};

}  // namespace exmat::runtime

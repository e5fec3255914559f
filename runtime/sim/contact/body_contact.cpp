#include "runtime/sim/contact/body_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/sim/contact/first_meeting.h"

namespace exmat::runtime {
namespace {

// A vertex that comes in is found within kEntrySteps of its way, or this share of the surface's radius. What is deeper
// and was not inside before has not come in: surfaces that fold, or cross themselves, do not tell inside from outside.
constexpr double kEntryShare = 0.01;

// Bodies begin deep in each other where they overlap by this share of a thickness, with so many of their vertices.
constexpr double kDeepStart = 0.25, kDeepShare = 0.1;
constexpr double kOnSurface = 1e-9;  // of a radius
constexpr double kMuchFarther = 2;   // a way out, than another one that takes its place

constexpr double kSearchedMargins = 1;   // beyond what a step needs: some steps of what it moves by,
constexpr double kSearchedShare = 2e-3;  // and of the surface's radius: many steps of bodies that hardly move
constexpr double kFastMargins = 10;      // of a way: below it what velocities exclude costs more than it saves
constexpr int kWorthwhile = 4;           // steps that a search has to serve: it costs about two without
constexpr int kWithout = 16;             // steps without, after one that did not

/// Three rows more, with room for as many again where there is none.
void append_rows(BodyCandidates& candidates, Eigen::Index modes) {
  const Eigen::Index needed = 3 * std::ssize(candidates.all);
  if (candidates.basis.cols() != modes) candidates.basis.resize(0, modes);
  if (candidates.basis.rows() < needed) candidates.basis.conservativeResize(2 * needed, modes);
}

/// The tangential spring of the last step: as long, and tangential to the surface as it is now.
void take_stretch(const HeldBodyContact& held, const Eigen::Matrix3d& rotation, BodyCandidate& candidate) {
  const Eigen::Vector3d stretch = rotation * held.stretch;
  const Eigen::Vector3d along = stretch - candidate.normal.dot(stretch) * candidate.normal;
  const double length = along.norm();
  if (length > 0) candidate.anchor -= held.stretch.norm() / length * along;
}

/// For a vertex that is inside, of which a part of the surface alone may tell that it is outside. On that part it is
/// neither: its normal is that of the surface.
void put_inside(double radius, SurfaceHit& hit) {
  if (hit.distance <= kOnSurface * radius) return;
  hit.distance = -hit.distance;
  hit.normal = -hit.normal;
}

/// The nearest point; of a vertex inside that looks the way `looks`, preferably of what does not look the same way and
/// is no deeper than `deepest` [m]: where edges lie on each other, the nearest may be that of a side.
std::optional<SurfaceHit> nearest_facing(const BodySurface& surface, const Eigen::Vector3d& point,
                                         const Eigen::Vector3d& looks, double radius, double deepest,
                                         SurfaceShape& shape) {
  auto hit = surface.nearest(point, radius, shape);
  if (!hit || hit->distance >= 0 || hit->normal.dot(looks) <= 0) return hit;
  auto facing = surface.nearest(point, radius, shape, &looks);
  if (!facing || std::abs(facing->distance) > deepest) return hit;
  put_inside(radius, *facing);
  return facing;
}

/// The same of a vertex that is to come out by the part of the surface that looks `out`.
std::optional<SurfaceHit> nearest_on_way_out(const BodySurface& surface, const Eigen::Vector3d& point,
                                             const Eigen::Vector3d& out, double radius, SurfaceShape& shape) {
  auto hit = surface.nearest(point, radius, shape);
  if (!hit || hit->distance > kOnSurface * radius) return hit;
  auto side = surface.nearest_looking(point, radius, shape, out);
  if (!side) return hit;
  put_inside(radius, *side);
  return side;
}

/// The same of a vertex that was inside, and came in by a side that looked the way `side`: where the nearest looks the
/// other way it has gone through, and what is nearest of the rest is how deep it is.
std::optional<SurfaceHit> nearest_by_side(const BodySurface& surface, const Eigen::Vector3d& point,
                                          const Eigen::Vector3d& looks, const Eigen::Vector3d& side, double radius,
                                          SurfaceShape& shape) {
  auto hit = nearest_facing(surface, point, looks, radius, radius, shape);
  if (!hit || hit->normal.dot(side) >= kOtherSide) return hit;
  const Eigen::Vector3d far_side = -side;
  auto entry = surface.nearest(point, radius, shape, &far_side);
  if (!entry) return hit;
  put_inside(radius, *entry);
  return entry->normal.dot(side) > 0 ? entry : hit;
}

/// The candidates of one body's vertices and the surface of another, or of its own, vertex by vertex in ascending
/// order.
struct Gathering {
  Gathering(const ContactLaw& its_law, const TouchingBody& its_a, const TouchingBody& its_b,
            const CandidateSearch& search, double its_margin, bool is_own, BodyCandidates& its_candidates)
      : law(its_law),
        a(its_a),
        b(its_b),
        time_step(search.time_step),
        margin(its_margin),
        pressed(law.most_pressed(std::min(a.set.load(), b.set.load()), search.gravity)),
        anew(search.anew && !is_own),
        own(is_own),
        held(search.held),
        shape(search.shape),
        candidates(its_candidates),
        last(held.begin()) {
    candidates.all.clear();
    surface_radius = b.touching.surface.bound(b.pose.q).radius;
    deepest = anew ? 2 * surface_radius : 0;
    overlaps = overlap(held);
    for (const HeldBodyContact& contact : held) deepest = std::max(deepest, -contact.gap);
  }

  /// A vertex, with its place from the other body's, world, and in the frame of that body [m].
  struct Placed {
    int vertex = 0;
    Eigen::Vector3d arm, offset, point;
  };
  Placed placed(int vertex) const {
    Placed own_place{vertex, a.set.world_arm(vertex, a.pose), {}, {}};
    own_place.offset = a.pose.position + own_place.arm - b.pose.position;
    own_place.point = b.pose.rotation.transpose() * own_place.offset;
    return own_place;
  }

  /// Share of the vertices of a that are inside or on the surface of b.
  double share_inside() const {
    int inside = 0;
    for (int vertex = 0; vertex < a.set.vertices(); ++vertex) {
      const auto hit = b.touching.surface.nearest(placed(vertex).point, 2 * surface_radius, shape);
      inside += hit && hit->distance <= kOnSurface * surface_radius ? 1 : 0;
    }
    return static_cast<double>(inside) / static_cast<double>(a.set.vertices());
  }

  /// Memory of the vertex, null where it was not inside.
  const HeldBodyContact* held_of(int vertex) {
    while (last != held.end() && last->vertex < vertex) ++last;
    return last != held.end() && last->vertex == vertex ? &*last : nullptr;
  }

  /// A vertex that leaves the other body by the way out of what overlaps.
  void leave(const Placed& at, const HeldBodyContact* before) {
    auto hit = b.touching.surface.nearest(at.point, 2 * surface_radius, shape);
    const bool is_inside = hit && hit->distance <= kOnSurface * surface_radius;
    if (is_inside) hit = b.touching.surface.exit(at.point, *way_out, 4 * surface_radius, shape);
    take(at, before, hit, is_inside);
  }

  void test_other(int vertex) {
    const HeldBodyContact* const before = held_of(vertex);
    const Placed at = placed(vertex);
    const double depth = anew ? deepest : before != nullptr ? -before->gap : 0;
    const BodySurface& surface = b.touching.surface;
    const Eigen::Vector3d looks =
        b.pose.rotation.transpose() * (a.pose.rotation * a.touching.normals.row(vertex).transpose());
    const bool overlapped = anew || (before != nullptr && before->overlap > 0);
    if (way_out && overlapped) return leave(at, before);
    if (overlapped && before != nullptr)
      return take(at, before, nearest_on_way_out(surface, at.point, before->normal, margin + depth, shape));
    if (way_out && before == nullptr) {
      // On its way out the back of a body goes through the other one.
      const auto back = surface.nearest(at.point, margin, shape);
      if (back && back->normal.dot(*way_out) < kOtherSide) {
        if (back->distance <= 0) leave(at, before);
        return;
      }
    }
    if (before != nullptr)
      return take(at, before, nearest_by_side(surface, at.point, looks, before->normal, margin + depth, shape));
    const Eigen::Vector3d apart = a.set.world_velocity(vertex, at.arm, a.pose, a.velocity) - b.velocity.at(at.offset);
    const double deepest_entry = anew ? margin + depth : deepest_that_comes_in(time_step * apart.norm());
    take(at, before, nearest_facing(surface, at.point, looks, margin + depth, deepest_entry, shape));
  }

  void test_own(const OwnSearch::Found& found) { test_own(found.vertex, found.point, found.velocity, found.leaves); }
  /// Tests a vertex at `point` in the frame of its body, which moves with `velocity` there; `leaves` as
  /// nearest_approached() has them.
  void test_own(int vertex, const Eigen::Vector3d& point, const Eigen::Vector3d& velocity, BodySurface::Leaves leaves) {
    const HeldBodyContact* const before = held_of(vertex);
    const double depth = before != nullptr ? -before->gap : 0;
    const ClosingPoint closing{velocity, near + depth, kContactMarginSteps * time_step};
    const auto hit = b.touching.surface.nearest_approached(point, a.set.rest(vertex),
                                                           b.touching.places[static_cast<std::size_t>(vertex)],
                                                           margin + depth, shape, is_fast ? &closing : nullptr, leaves);
    if (hit && (hit->distance >= 0 || before != nullptr)) take(placed(vertex), before, hit);
  }
  void test_own(int vertex) {
    if (!a.touching.may_meet_itself(vertex, a.set, a.pose.q)) return;
    test_own(vertex, a.set.place(vertex, shape.x), Eigen::Vector3d::Zero(), std::nullopt);
  }
  void test(int vertex) { own ? test_own(vertex) : test_other(vertex); }

  /// A candidate, where what was found of the surface is near enough. `leaves`: it is inside, on its way out.
  void take(const Placed& at, const HeldBodyContact* before, const std::optional<SurfaceHit>& hit,
            bool leaves = false) {
    if (!hit || hit->distance > margin) return;
    const int vertex = at.vertex;
    const bool was_inside = before != nullptr;
    BodyCandidate& candidate = candidates.all.emplace_back();
    candidate.vertex = vertex;
    const std::size_t index = candidates.all.size() - 1;
    append_rows(candidates, b.pose.q.size());
    const auto set_place = [&](const SurfaceHit& found) {
      candidate.rest = b.touching.surface.place_of(found);
      candidates.places.resize(std::max(candidates.places.size(), candidates.all.size()));
      candidates.places[index] = {found.triangle, found.barycentric};
      b.touching.surface.basis_of(found, candidates.rows(index));
      return candidates.surface_arm(index, b.pose);
    };
    Eigen::Vector3d arm_b = set_place(*hit);
    const Eigen::Vector3d own_b = b.pose.rotation * candidates.rows(index).lazyProduct(b.velocity.v).eval();
    const Eigen::Vector3d apart =
        a.set.world_velocity(vertex, at.arm, a.pose, a.velocity) - b.velocity.at(arm_b) - own_b;
    SurfacePoint surface{hit->distance, b.pose.rotation * hit->normal, Eigen::Vector3d::Zero()};
    const double way = time_step * apart.norm();
    if (!own && !anew && !was_inside && !leaves && -hit->distance > deepest_that_comes_in(way))
      return candidates.all.pop_back();
    if (!own && !was_inside && hit->distance > 0 && way > std::max(hit->distance, kFast * surface_radius)) {
      const Eigen::Vector3d heading = kContactMarginSteps * time_step * (b.pose.rotation.transpose() * apart);
      const auto met = first_meeting(at.point, at.point + heading, [&](const Eigen::Vector3d& from, double left) {
        return b.touching.surface.nearest(from, left, shape);
      });
      if (!met) return candidates.all.pop_back();
      arm_b = set_place(*met);
      surface.normal = b.pose.rotation * met->normal;
      surface.distance = surface.normal.dot(at.offset - arm_b);
    }
    const Eigen::Vector3d place = at.offset - arm_b;
    freeze_contact(law, surface, place, place + time_step * apart, a.set.area(vertex), time_step, candidate);
    const double depth = -surface.distance;
    const double inside = was_inside       ? kept_overlap(*before, depth)
                          : anew || leaves ? depth
                          : overlaps       ? std::max(0.0, depth - way)
                                           : 0;
    candidate.release_overlap(depth, inside, time_step * surface.normal.dot(apart), pressed, time_step * law.release);
    if (!was_inside) return;
    if (candidate.rubs()) candidate.friction_force = law.friction * before->normal_force;
    take_stretch(*before, b.pose.rotation, candidate);
  }

  /// Overlap of a vertex that now is `depth` inside [m]: no motion lies between, so that what is more than it was is
  /// that of another part of the surface.
  static double kept_overlap(const HeldBodyContact& before, double depth) {
    return before.overlap > 0 ? before.overlap + std::max(0.0, depth + before.gap) : 0;
  }

  /// By a way of so much in a step [m].
  double deepest_that_comes_in(double way) const { return std::max(kEntrySteps * way, kEntryShare * surface_radius); }

  const ContactLaw& law;
  const TouchingBody &a, &b;
  double time_step, margin;
  double pressed;  ///< depth by which springs may be pressed by what is released [m]
  bool anew, own;
  std::optional<Eigen::Vector3d> way_out;  ///< in the frame of b
  const std::vector<HeldBodyContact>& held;
  SurfaceShape& shape;
  BodyCandidates& candidates;
  std::vector<HeldBodyContact>::const_iterator last;
  bool overlaps = false;      ///< some vertices have not left what they overlapped at the start
  bool is_fast = false;       ///< true for a body with itself: looks at what is nearer than `near` and by ClosingPoint
  double near = 0;            ///< [m]
  double deepest = 0;         ///< that a vertex may be inside [m]
  double surface_radius = 0;  ///< radius of the ball about the surface of b [m]
};

/// Calls visit(vertex) for every vertex of a that the surface of b may be within `radius` of, in ascending order.
template <class Visit>
void for_near(const TouchingBody& a, const TouchingBody& b, double radius, SurfaceShape& shape, const Visit& visit) {
  const DeformationTree& tree = a.set.tree();
  const double q_norm = a.pose.q.norm();
  const auto count = static_cast<int>(tree.nodes().size());
  for (int node = 0; node < count;) {
    const DeformationTree::Ball ball = tree.ball(node, a.pose.q, q_norm);
    const Eigen::Vector3d offset = a.pose.position + a.pose.rotation * ball.centre - b.pose.position;
    const bool near =
        b.touching.surface.may_be_within(b.pose.rotation.transpose() * offset, ball.radius + radius, shape);
    if (near && tree.node(node).is_leaf)
      for (int vertex = tree.node(node).first; vertex < tree.node(node).last; ++vertex) visit(vertex);
    node = near ? node + 1 : tree.node(node).next;
  }
}

Placement a_in_b(const BodyPose& a, const BodyPose& b) {
  Placement relative;
  relative.position = b.rotation.transpose() * (a.position - b.position);
  relative.rotation = b.rotation.transpose() * a.rotation;
  return relative;
}

/// The most that a vertex has gone in the frame of its body since the search, which left its places in `then` where
/// ContactSet::move() had moved the body [m]. Infinite where the body was moved then and is not now, or the reverse.
double way_from(const VertexArray& then, const ContactSet& set, const VertexArray& places) {
  if (set.is_moved() != (then.rows() > 0)) return std::numeric_limits<double>::infinity();
  return set.is_moved() ? std::sqrt((places - then).rowwise().squaredNorm().maxCoeff()) : 0;
}

/// Bound on how far vertices of a and the surface of b have moved against each other since the search [m].
double way_between(const TouchingBody& a, const TouchingBody& b, const NearVertices& near) {
  if (near.radius < 0) return 0;
  const double own =
      way_from(near.places_a, a.set, a.set.places()) + way_from(near.places_b, b.set, b.touching.surface.places());
  if (std::isinf(own)) return own;
  const Placement relative = a_in_b(a.pose, b.pose);
  return own + way_bound(a.set.reach(), a.set.tree().movement(), BodyPose{relative, a.pose.q}, near.a_in_b, near.q_a) +
         b.touching.surface.movement().of(b.pose.q - near.q_b);
}

/// Tests the vertices that may be within reach, searching for them where what is known does not tell. test_all(radius)
/// tests without; find(radius, farther) tests, too, and adds to near.found what, until all have moved by near.farther,
/// stays nearer than `farther` to what it may touch.
template <class TestAll, class Find>
void gather_from(Gathering& gathering, NearVertices& near, const TestAll& test_all, const Find& find) {
  const TouchingBody &a = gathering.a, &b = gathering.b;
  const double radius = gathering.margin + gathering.deepest;
  const double way = way_between(a, b, near);
  // A search of whatever depth knows more than it should: on a long way all of that would come near.
  const bool is_known = way <= near.farther && radius + way <= near.radius;
  if (!is_known && near.radius >= 0 && near.served < kWorthwhile) near.without = kWithout;
  if (near.without > 0) {
    --near.without;
    near.radius = -1;
    return test_all(radius);
  }
  if (!is_known) {
    near.farther = kSearchedMargins * gathering.margin + kSearchedShare * gathering.surface_radius;
    near.radius = radius + near.farther;
    near.a_in_b = a_in_b(a.pose, b.pose);
    near.q_a = a.pose.q;
    near.q_b = b.pose.q;
    const auto keep = [](bool is_moved, const VertexArray& places, VertexArray& kept) {
      if (is_moved)
        kept = places;
      else
        kept.resize(0, 3);
    };
    keep(a.set.is_moved(), a.set.places(), near.places_a);
    keep(b.set.is_moved(), b.touching.surface.places(), near.places_b);
    near.found.clear();
    near.served = 1;
    return find(radius, near.radius);
  }
  ++near.served;
  for (const auto& [vertex, distance] : near.found)
    if (distance - way <= radius) gathering.test(vertex);
}

/// Place of the candidate's vertex in the last evaluation, from y [m].
Eigen::Vector3d place_of(const BodyPose& a, const BodyPose& b, const BodyCandidate& candidate) {
  return a.position + candidate.arm - b.position - candidate.surface_arm;
}

}  // namespace

bool overlap(const std::vector<HeldBodyContact>& held) noexcept {
  return std::ranges::any_of(held, [](const HeldBodyContact& contact) { return contact.overlap > 0; });
}

std::optional<Eigen::Vector3d> way_out_of(const TouchingBody& a, const TouchingBody& b,
                                          const std::optional<Eigen::Vector3d>& kept) {
  struct Extent {
    Eigen::Array4d least = Eigen::Array4d::Constant(std::numeric_limits<double>::infinity()), most = -least;
  };
  Eigen::Matrix<double, 4, 3> ways = Eigen::Matrix<double, 4, 3>::Zero();  // the axes of a, and the one that serves
  ways.topRows<3>() = a.pose.rotation.transpose();
  if (kept) ways.row(3) = kept->transpose();
  const auto extent_of = [&](const TouchingBody& body) {
    Extent extent;
    for (int vertex = 0; vertex < body.set.vertices(); ++vertex) {
      const Eigen::Vector3d place = body.pose.position + body.set.world_arm(vertex, body.pose) - a.pose.position;
      const Eigen::Array4d own = (ways * place).array();
      extent.least = extent.least.min(own);
      extent.most = extent.most.max(own);
    }
    return extent;
  };
  const Extent own = extent_of(a), other = extent_of(b);
  const Eigen::Array4d up = other.most - own.least, down = own.most - other.least;  // ways out
  Eigen::Index axis = 0;
  const double shortest = up.min(down).head<3>().minCoeff(&axis);
  if (kept && up[3] <= kMuchFarther * shortest) return kept;
  if (!kept && !(shortest > kDeepStart * (own.most - own.least).min(other.most - other.least)[axis]))
    return std::nullopt;
  return (up[axis] <= down[axis] ? 1 : -1) * a.pose.rotation.col(axis);
}

void BodyContact::gather(const TouchingBody& a, const TouchingBody& b, const CandidateSearch& search,
                         BodyCandidates& candidates) const {
  const double margin = search.margin;
  SurfaceShape& shape = search.shape;
  NearVertices& near = search.near;
  Gathering gathering{law_, a, b, search, margin, /*own=*/false, candidates};
  if (search.way_out && (!search.anew || gathering.share_inside() >= kDeepShare))
    gathering.way_out = b.pose.rotation.transpose() * *search.way_out;
  const auto test_all = [&](double radius) {
    for_near(a, b, radius, shape, [&](int vertex) { gathering.test_other(vertex); });
  };
  const auto find = [&](double radius, double farther) {
    for_near(a, b, farther, shape, [&](int vertex) {
      const Eigen::Vector3d point = near.a_in_b.position + a.set.world_arm(vertex, {near.a_in_b, a.pose.q});
      const auto hit = b.touching.surface.nearest(point, farther, shape);
      if (!hit) return;
      near.found.push_back({vertex, std::abs(hit->distance)});
      if (near.found.back().distance <= radius) gathering.test_other(vertex);
    });
  };
  gather_from(gathering, near, test_all, find);
}

void BodyContact::gather_own(const TouchingBody& body, const CandidateSearch& search,
                             BodyCandidates& candidates) const {
  const double time_step = search.time_step, margin = search.margin;
  SurfaceShape& shape = search.shape;
  NearVertices& near = search.near;
  const ContactSet& set = body.set;
  const TouchingSurface& touching = body.touching;
  const BodySurface& surface = touching.surface;
  double way = time_step * set.tree().movement().of(body.velocity.v);
  const bool is_fast = 2 * kContactMarginSteps * way > kFastMargins * margin;
  const auto place_all = [&] { near.own.place(set, surface, touching.places, shape); };
  if (is_fast) {
    surface.place(body.pose.q, body.velocity.v, shape);
    place_all();
    way = time_step * surface.fastest(shape);
  }
  const double farthest = margin + 2 * kContactMarginSteps * way;
  Gathering gathering{law_, body, body, search, farthest, /*own=*/true, candidates};
  gathering.is_fast = is_fast;
  gathering.near = margin + way;
  const auto test_placed = [&](double radius) {
    const LeafQuery reach{.radius = radius,
                          .near = gathering.near + gathering.deepest,
                          .time = kContactMarginSteps * time_step,
                          .share = kSurelyApproached};
    near.own.search(
        set, surface, shape, reach, [&](int vertex) { return touching.may_meet_itself(vertex, set, body.pose.q); },
        [&](const OwnSearch::Found& found) { gathering.test_own(found); });
  };
  const auto find = [&](double radius, double farther) {
    // Until the next search either moves by half of that at most.
    const double half = 0.5 * near.farther;
    const auto wanted = [&](int vertex) { return touching.may_meet_itself(vertex, set, body.pose.q, half); };
    place_all();
    const auto look = [&](const OwnSearch::Found& found) {
      const SurfaceHit& place = touching.places[static_cast<std::size_t>(found.vertex)];
      const double distance = surface.approach_distance(found.point, set.rest(found.vertex), place, farther,
                                                        near.farther, shape, found.leaves);
      if (distance > farther) return;
      near.found.push_back({found.vertex, distance});
      if (distance <= radius) gathering.test_own(found);
    };
    const LeafQuery reach{.radius = farther,
                          .near = std::numeric_limits<double>::infinity(),
                          .share = kSurelyApproached,
                          .beyond = near.farther};
    near.own.search(set, surface, shape, reach, wanted, look);
  };
  if (is_fast) {  // what may have come near until the next search would be far more than what closes in
    near.radius = -1;
    return test_placed(farthest + gathering.deepest);
  }
  const auto test_all = [&](double radius) {
    place_all();
    test_placed(radius);
  };
  gather_from(gathering, near, test_all, find);
}

void BodyContact::set_clearances(const BodyPose& a, const BodyPose& b, BodyCandidates& candidates) const noexcept {
  for (BodyCandidate& candidate : candidates.all)
    candidate.clearance = clearance_of(candidate, place_of(a, b, candidate));
}

void BodyContact::refresh_friction(BodyCandidates& candidates, FrictionChange& change) const noexcept {
  for (BodyCandidate& candidate : candidates.all) change.refresh(law_.friction, candidate);
}

void BodyContact::commit(const BodyPose& a, const BodyPose& b, const BodyCandidates& candidates,
                         std::vector<HeldBodyContact>& held) const {
  held.clear();
  for (const BodyCandidate& candidate : candidates.all) {
    if (!(candidate.gap < 0) && !(candidate.normal_force > 0)) continue;
    HeldBodyContact& contact = held.emplace_back();
    contact.vertex = candidate.vertex;
    contact.gap = std::min(0.0, candidate.gap);
    contact.normal_force = candidate.normal_force;
    contact.normal = b.rotation.transpose() * candidate.normal;
    contact.overlap = std::clamp(-candidate.gap, 0.0, candidate.overlap);
    const Eigen::Vector3d place = place_of(a, b, candidate);
    if (candidate.normal_force > 0)
      contact.stretch = b.rotation.transpose() * held_stretch(law_.friction, place, candidate);
    if (!contact.stretch.allFinite()) contact.stretch.setZero();
  }
}

}  // namespace exmat::runtime

#include "runtime/sim/contact/body_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/sim/contact/first_meeting.h"

namespace exmat::runtime {
namespace {

// A vertex that comes in is found within some steps of its way, or this share of the surface's radius. What is deeper
// and was not inside before has not come in: surfaces that fold, or cross themselves, do not tell inside from outside.
constexpr double kEntrySteps = 2, kEntryShare = 0.01;

constexpr double kSearchedMargins = 1;   // beyond what a step needs: some steps of what it moves by,
constexpr double kSearchedShare = 2e-3;  // and of the surface's radius: many steps of bodies that hardly move
constexpr double kFastMargins = 10;      // of a way: below it what velocities exclude costs more than it saves
constexpr int kWorthwhile = 4;           // steps that a search has to serve: it costs about two without
constexpr int kWithout = 16;             // steps without, after one that did not

auto rows_of(const BodyCandidates& candidates, std::size_t index) {
  return candidates.basis.middleRows<3>(3 * static_cast<Eigen::Index>(index));
}
auto rows_of(BodyCandidates& candidates, std::size_t index) {
  return candidates.basis.middleRows<3>(3 * static_cast<Eigen::Index>(index));
}

/// Of the last evaluation, the vertex from y [m].
Eigen::Vector3d place_of(const BodyPose& a, const BodyPose& b, const BodyCandidate& candidate) {
  return a.position + candidate.arm - b.position - candidate.surface_arm;
}

/// y - position, world.
Eigen::Vector3d surface_arm(const BodyCandidates& candidates, std::size_t index, const BodyPose& pose) {
  const Eigen::Vector3d moved = candidates.all[index].rest + rows_of(candidates, index).lazyProduct(pose.q);
  return pose.rotation * moved;
}

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

/// The nearest point; of a vertex inside that looks the way `looks`, preferably of what does not look the same way and
/// is no deeper than `deepest` [m]: where edges lie on each other, the nearest may be that of a side.
std::optional<SurfaceHit> nearest_facing(const BodySurface& surface, const Eigen::Vector3d& point,
                                         const Eigen::Vector3d& looks, double radius, double deepest,
                                         SurfaceShape& shape) {
  auto hit = surface.nearest(point, radius, shape);
  if (!hit || hit->distance >= 0 || hit->normal.dot(looks) <= 0) return hit;
  auto facing = surface.nearest(point, radius, shape, &looks);
  if (!facing || std::abs(facing->distance) > deepest) return hit;
  if (facing->distance > 0) {  // told by a part of the surface alone; it is inside
    facing->distance = -facing->distance;
    facing->normal = -facing->normal;
  }
  return facing;
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
  if (entry->distance > 0) {  // told by a part of the surface alone, as above
    entry->distance = -entry->distance;
    entry->normal = -entry->normal;
  }
  return entry->normal.dot(side) > 0 ? entry : hit;
}

/// The candidates of one body's vertices and the surface of another, or of its own, vertex by vertex in ascending
/// order.
struct Gathering {
  Gathering(const ContactLaw& its_law, const TouchingBody& its_a, const TouchingBody& its_b, double its_time_step,
            double its_margin, bool is_anew, bool is_own, const std::vector<HeldBodyContact>& its_held,
            SurfaceShape& its_shape, BodyCandidates& its_candidates)
      : law(its_law),
        a(its_a),
        b(its_b),
        time_step(its_time_step),
        margin(its_margin),
        anew(is_anew),
        own(is_own),
        held(its_held),
        shape(its_shape),
        candidates(its_candidates),
        last(held.begin()) {
    candidates.all.clear();
    surface_radius = b.touching.surface.bound(b.pose.q).radius;
    deepest = anew ? 2 * surface_radius : 0;
    for (const HeldBodyContact& contact : held) deepest = std::max(deepest, -contact.gap);
  }

  void test(int vertex) {
    if (own && a.touching.vertex_bounds.row(vertex).dot(a.pose.q.cwiseAbs()) < 1) return;
    while (last != held.end() && last->vertex < vertex) ++last;
    const bool was_inside = last != held.end() && last->vertex == vertex;
    const Eigen::Vector3d arm = a.set.world_arm(vertex, a.pose);
    const Eigen::Vector3d offset = a.pose.position + arm - b.pose.position;
    const double depth = anew ? deepest : was_inside ? -last->gap : 0;
    const Eigen::Vector3d point = b.pose.rotation.transpose() * offset;
    const auto to_others = [&] {
      const Eigen::Vector3d looks =
          b.pose.rotation.transpose() * (a.pose.rotation * a.touching.normals.row(vertex).transpose());
      if (was_inside) return nearest_by_side(b.touching.surface, point, looks, last->normal, margin + depth, shape);
      const Eigen::Vector3d apart = a.set.world_velocity(vertex, arm, a.pose, a.velocity) - b.velocity.at(offset);
      const double deepest_entry = anew ? margin + depth : deepest_that_comes_in(time_step * apart.norm());
      return nearest_facing(b.touching.surface, point, looks, margin + depth, deepest_entry, shape);
    };
    const auto to_own = [&] {
      const SurfaceHit& place = b.touching.places[static_cast<std::size_t>(vertex)];
      ClosingPoint closing{Eigen::Vector3d::Zero(), near + depth, kContactMarginSteps * time_step};
      if (is_fast) closing.velocity = b.touching.surface.velocity_of(place, shape);
      return b.touching.surface.nearest_approached(point, a.set.rest(vertex), place, margin + depth, shape,
                                                   is_fast ? &closing : nullptr);
    };
    const auto hit = own ? to_own() : to_others();
    if (own && hit && hit->distance < 0 && !was_inside) return;
    if (!hit || hit->distance > margin) return;
    BodyCandidate& candidate = candidates.all.emplace_back();
    candidate.vertex = vertex;
    const std::size_t index = candidates.all.size() - 1;
    append_rows(candidates, b.pose.q.size());
    const auto set_place = [&](const SurfaceHit& found) {
      candidate.rest = b.touching.surface.rest_of(found);
      b.touching.surface.basis_of(found, rows_of(candidates, index));
      return surface_arm(candidates, index, b.pose);
    };
    Eigen::Vector3d arm_b = set_place(*hit);
    const Eigen::Vector3d own_b = b.pose.rotation * rows_of(candidates, index).lazyProduct(b.velocity.v).eval();
    const Eigen::Vector3d apart = a.set.world_velocity(vertex, arm, a.pose, a.velocity) - b.velocity.at(arm_b) - own_b;
    SurfacePoint surface{hit->distance, b.pose.rotation * hit->normal, Eigen::Vector3d::Zero()};
    const double way = time_step * apart.norm();
    if (!own && !anew && !was_inside && -hit->distance > deepest_that_comes_in(way)) return candidates.all.pop_back();
    if (!own && !was_inside && hit->distance > 0 && way > std::max(hit->distance, kFast * surface_radius)) {
      const Eigen::Vector3d heading = kContactMarginSteps * time_step * (b.pose.rotation.transpose() * apart);
      const auto met = first_meeting(point, point + heading, [&](const Eigen::Vector3d& at, double left) {
        return b.touching.surface.nearest(at, left, shape);
      });
      if (!met) return candidates.all.pop_back();
      arm_b = set_place(*met);
      surface.normal = b.pose.rotation * met->normal;
      surface.distance = surface.normal.dot(offset - arm_b);
    }
    const Eigen::Vector3d place = offset - arm_b;
    freeze_contact(law, surface, place, place + time_step * apart, a.set.area(vertex), time_step, candidate);
    if (!was_inside) return;
    candidate.friction_force = law.friction * last->normal_force;
    take_stretch(*last, b.pose.rotation, candidate);
  }

  /// By a way of so much in a step [m].
  double deepest_that_comes_in(double way) const { return std::max(kEntrySteps * way, kEntryShare * surface_radius); }

  const ContactLaw& law;
  const TouchingBody &a, &b;
  double time_step, margin;
  bool anew, own;
  const std::vector<HeldBodyContact>& held;
  SurfaceShape& shape;
  BodyCandidates& candidates;
  std::vector<HeldBodyContact>::const_iterator last;
  bool is_fast = false;       ///< of a body with itself: what is nearer than `near` and by ClosingPoint is looked at
  double near = 0;            ///< [m]
  double deepest = 0;         ///< that a vertex may be inside [m]
  double surface_radius = 0;  ///< of the ball about the surface of b [m]
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

/// Bound on how far vertices of a and the surface of b have moved against each other since the search [m].
double way_between(const TouchingBody& a, const TouchingBody& b, const NearVertices& near) {
  if (near.radius < 0) return 0;
  const Placement relative = a_in_b(a.pose, b.pose);
  return way_bound(a.set.reach(), a.set.tree().movement(), BodyPose{relative, a.pose.q}, near.a_in_b, near.q_a) +
         b.touching.surface.movement().of(b.pose.q - near.q_b);
}

/// What vertices of a are near the surface of b, by `distance_of`(vertex, point in the frame of b, radius), infinity
/// where there is nothing.
template <class Distance>
void search_near(const TouchingBody& a, const TouchingBody& b, double radius, SurfaceShape& shape, NearVertices& near,
                 const Distance& distance_of) {
  near.radius = radius;
  near.a_in_b = a_in_b(a.pose, b.pose);
  near.q_a = a.pose.q;
  near.q_b = b.pose.q;
  near.found.clear();
  for_near(a, b, radius, shape, [&](int vertex) {
    const Eigen::Vector3d point = near.a_in_b.position + a.set.world_arm(vertex, {near.a_in_b, a.pose.q});
    const double distance = distance_of(vertex, point, radius);
    if (distance <= radius) near.found.push_back({vertex, distance});
  });
}

/// Tests the vertices that may be within reach, searching for them where what is known does not tell: `distance_of` as
/// above with how far everything may move from now on until the next search [m].
template <class Distance>
void gather_from(Gathering& gathering, NearVertices& near, const Distance& distance_of) {
  const TouchingBody &a = gathering.a, &b = gathering.b;
  const double radius = gathering.margin + gathering.deepest;
  const double way = way_between(a, b, near);
  // A search of whatever depth knows more than it should: on a long way all of that would come near.
  const bool is_known = way <= near.farther && radius + way <= near.radius;
  if (!is_known && near.radius >= 0 && near.served < kWorthwhile) near.without = kWithout;
  if (near.without > 0) {
    --near.without;
    near.radius = -1;
    return for_near(a, b, radius, gathering.shape, [&](int vertex) { gathering.test(vertex); });
  }
  if (!is_known) {
    near.farther = kSearchedMargins * gathering.margin + kSearchedShare * gathering.surface_radius;
    near.served = 0;
    search_near(a, b, radius + near.farther, gathering.shape, near, distance_of);
  }
  ++near.served;
  for (const auto& [vertex, distance] : near.found)
    if (distance - (is_known ? way : 0) <= radius) gathering.test(vertex);
}

}  // namespace

TouchingSurface::TouchingSurface(const ContactSet& set, BodySurface of, bool meets_itself)
    : surface(std::move(of)), normals(set.vertices(), 3) {
  SurfaceShape shape = surface.make_shape();
  surface.place(Eigen::VectorXd::Zero(surface.modes()), shape);
  for (int i = 0; i < normals.rows(); ++i) {
    const auto hit = surface.nearest(set.rest(i), std::numeric_limits<double>::infinity(), shape);
    normals.row(i) = hit ? hit->normal : Eigen::Vector3d::Zero();
    if (meets_itself) places.push_back(hit.value_or(SurfaceHit()));
  }
  if (!meets_itself) return;
  VertexArray rest(set.vertices(), 3);
  RowMatrix basis(3 * set.vertices(), set.modes());
  for (int i = 0; i < rest.rows(); ++i) {
    rest.row(i) = set.rest(i);
    basis.middleRows<3>(3 * i) = set.basis_rows(i);
  }
  vertex_bounds = surface.approach_bounds(rest, basis);
  approach_bounds = vertex_bounds.colwise().maxCoeff();
}

bool TouchingSurface::may_meet_itself(const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                                      double time_step) const noexcept {
  if (approach_bounds.size() == 0) return false;
  return approach_bounds.dot(q.cwiseAbs() + kContactMarginSteps * time_step * v.cwiseAbs()) >= 1;
}

void BodyContact::gather(const TouchingBody& a, const TouchingBody& b, double time_step, double margin, bool anew,
                         const std::vector<HeldBodyContact>& held, SurfaceShape& shape, NearVertices& near,
                         BodyCandidates& candidates) const {
  Gathering gathering{law_, a, b, time_step, margin, anew, /*own=*/false, held, shape, candidates};
  gather_from(gathering, near, [&](int, const Eigen::Vector3d& point, double radius) {
    const auto hit = b.touching.surface.nearest(point, radius, shape);
    return hit ? std::abs(hit->distance) : std::numeric_limits<double>::infinity();
  });
}

void BodyContact::gather_own(const TouchingBody& body, double time_step, double margin,
                             const std::vector<HeldBodyContact>& held, SurfaceShape& shape, NearVertices& near,
                             BodyCandidates& candidates) const {
  const TouchingSurface& touching = body.touching;
  double way = time_step * body.set.tree().movement().of(body.velocity.v);
  const bool is_fast = 2 * kContactMarginSteps * way > kFastMargins * margin;
  if (is_fast) {
    if (near.scratch.size() == 0) near.scratch = AlignedArray(body.set.modes());
    way = time_step * body.set.fastest(body.velocity.v, near.scratch);
    touching.surface.place(body.pose.q, body.velocity.v, shape);
  }
  const double farthest = margin + 2 * kContactMarginSteps * way;
  Gathering gathering{law_, body, body, time_step, farthest, /*anew=*/false, /*own=*/true, held, shape, candidates};
  gathering.is_fast = is_fast;
  gathering.near = margin + way;
  gather_from(gathering, near, [&](int vertex, const Eigen::Vector3d& point, double radius) {
    // Until the next search either moves by half of that at most.
    const double half = 0.5 * near.farther;
    const auto bounds = touching.vertex_bounds.row(vertex);
    const double more =
        std::max(body.set.tree().movement().most(bounds, half), touching.surface.movement().most(bounds, half));
    if (bounds.dot(body.pose.q.cwiseAbs()) + more < 1) return std::numeric_limits<double>::infinity();
    return touching.surface.approach_distance(
        point, body.set.rest(vertex), touching.places[static_cast<std::size_t>(vertex)], radius, near.farther, shape);
  });
}

void BodyContact::evaluate(const ContactSet& set, const BodyPose& a, const BodyPose& b, double way,
                           BodyCandidates& candidates, ContactSums& sums_a, ContactSums& sums_b) const noexcept {
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    BodyCandidate& candidate = candidates.all[i];
    if (candidate.clearance > way) {
      leave_untouched(candidate);
      continue;
    }
    candidate.arm = set.world_arm(candidate.vertex, a);
    candidate.surface_arm = surface_arm(candidates, i, b);
    const Eigen::Vector3d place = place_of(a, b, candidate);
    const double gap = candidate.normal.dot(place);
    const double potential = evaluate_contact(gap, candidate.normal, place, candidate);
    if (!candidate.is_loaded()) continue;
    if (candidate.normal_force > 0) {
      ++sums_a.touching;
      ++sums_b.touching;
      sums_a.stiffness += candidate.normal_stiffness();
      sums_b.stiffness += candidate.normal_stiffness();
    }
    sums_a.force += candidate.force;
    sums_a.torque += candidate.arm.cross(candidate.force);
    const Eigen::Vector3d force_a = a.rotation.transpose() * candidate.force;
    sums_a.generalised += set.basis_rows(candidate.vertex).transpose().lazyProduct(force_a);
    sums_a.potential += potential;
    sums_b.force -= candidate.force;
    sums_b.torque -= candidate.surface_arm.cross(candidate.force);
    const Eigen::Vector3d force_b = b.rotation.transpose() * candidate.force;
    sums_b.generalised -= rows_of(candidates, i).transpose().lazyProduct(force_b);
  }
}

void BodyContact::set_clearances(const BodyPose& a, const BodyPose& b, BodyCandidates& candidates) const noexcept {
  for (BodyCandidate& candidate : candidates.all)
    candidate.clearance = clearance_of(candidate, place_of(a, b, candidate));
}

double BodyContact::potential(const ContactSet& set, const BodyPose& a, const BodyPose& b, double way,
                              const BodyCandidates& candidates) const noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    const BodyCandidate& candidate = candidates.all[i];
    if (candidate.clearance > way) continue;
    const Eigen::Vector3d place =
        a.position + set.world_arm(candidate.vertex, a) - b.position - surface_arm(candidates, i, b);
    sum += contact_potential(candidate, candidate.normal.dot(place), place);
  }
  return sum;
}

void BodyContact::refresh_friction(BodyCandidates& candidates, FrictionChange& change) const noexcept {
  for (BodyCandidate& candidate : candidates.all) change.refresh(law_.friction, candidate);
}

Eigen::Index BodyContact::stiffness_columns(const ContactSet& set, int rigid_a, int rigid_b, const BodyPose& a,
                                            const BodyPose& b, const BodyCandidates& candidates,
                                            Eigen::MatrixXd& columns_a, Eigen::MatrixXd& columns_b) {
  Eigen::Index needed = 0;  // most candidates touch nothing
  for (const BodyCandidate& candidate : candidates.all) needed += candidate.is_loaded() ? 3 : 0;
  const auto make_room = [needed](Eigen::Index rows, Eigen::MatrixXd& columns) {
    if (columns.rows() != rows || columns.cols() < needed) columns.resize(rows, 2 * needed);
  };
  make_room(rigid_a + a.q.size(), columns_a);
  make_room(rigid_b + b.q.size(), columns_b);
  Eigen::Index used = 0;
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    const BodyCandidate& candidate = candidates.all[i];
    if (!candidate.is_loaded()) continue;
    const StiffnessFactors factors(candidate);
    for (int k = 0; k < factors.count; ++k) {
      const Eigen::Vector3d direction = factors.columns.col(k);
      auto column_a = columns_a.col(used);
      auto column_b = columns_b.col(used);
      ++used;
      if (rigid_a > 0) column_a.head<6>() << direction, candidate.arm.cross(direction);
      if (rigid_b > 0) column_b.head<6>() << direction, candidate.surface_arm.cross(direction);
      const Eigen::Vector3d in_a = a.rotation.transpose() * direction, in_b = b.rotation.transpose() * direction;
      column_a.tail(a.q.size()) = set.basis_rows(candidate.vertex).transpose().lazyProduct(in_a);
      column_b.tail(b.q.size()) = rows_of(candidates, i).transpose().lazyProduct(in_b);
    }
  }
  return used;
}

void BodyContact::commit(const BodyPose& a, const BodyPose& b, const BodyCandidates& candidates,
                         std::vector<HeldBodyContact>& held) const {
  held.clear();
  for (const BodyCandidate& candidate : candidates.all) {
    if (candidate.gap >= 0 && candidate.normal_force <= 0) continue;
    HeldBodyContact& contact = held.emplace_back();
    contact.vertex = candidate.vertex;
    contact.gap = std::min(0.0, candidate.gap);
    contact.normal_force = candidate.normal_force;
    contact.normal = b.rotation.transpose() * candidate.normal;
    const Eigen::Vector3d place = place_of(a, b, candidate);
    if (candidate.normal_force > 0)
      contact.stretch = b.rotation.transpose() * held_stretch(law_.friction, place, candidate);
  }
}

}  // namespace exmat::runtime

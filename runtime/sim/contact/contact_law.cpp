#include "runtime/sim/contact/contact_law.h"

#include <algorithm>
#include <cmath>

namespace exmat::runtime {
namespace {

/// True if nobody has seen a vertex so deep come in, whose velocity takes it so far in a step.
bool was_put(double depth, double gone) { return depth > kEntrySteps * gone; }

// Divisions and roots take most of the time of a vertex: each is done once.

/// Friction of size `limit` as a function of the slip l: f1(l) / l, its derivative f1' and its integral f0, all times
/// the limit.
struct SlipLaw {
  double secant = 0, tangent = 0, energy = 0;

  SlipLaw(double limit, double stiffness, double slip) {
    const double share = slip * (0.5 * stiffness / limit);  // of the slip where the force reaches its limit
    if (share < 1) {
      secant = stiffness * (1 - 0.5 * share);
      tangent = stiffness * (1 - share);
      energy = stiffness * slip * slip * (0.5 - share * (1.0 / 6));
    } else {
      secant = limit / slip;
      energy = limit * (slip - limit / stiffness * (2.0 / 3));
    }
  }
};

Eigen::Vector3d tangential(const Eigen::Vector3d& vector, const Eigen::Vector3d& normal) {
  return vector - normal.dot(vector) * normal;
}

/// y, see contact_law.h.
Eigen::Vector3d slip_of(const ContactCandidate& candidate, const Eigen::Vector3d& point) {
  return tangential(point - candidate.anchor + candidate.damping * (point - candidate.carried), candidate.normal);
}

/// d - tau v_n.
double damped_depth(const ContactCandidate& candidate, double gap, const Eigen::Vector3d& point) {
  return -gap - candidate.overlap - candidate.damping * candidate.normal.dot(point - candidate.carried);
}

/// Returns what it adds to (1 + tau) W, as evaluate_friction().
double evaluate_normal(ContactCandidate& candidate, double gap, const Eigen::Vector3d& normal,
                       const Eigen::Vector3d& point) {
  candidate.gap = gap;
  const double depth = damped_depth(candidate, gap, point);
  if (depth <= 0) return 0;
  const bool is_unturned = normal == candidate.normal;
  candidate.direction = normal;
  if (!is_unturned) candidate.direction = candidate.spring_share * (normal + candidate.damping * candidate.normal);
  candidate.force = candidate.stiffness * depth * candidate.direction;
  candidate.normal_force = is_unturned ? candidate.stiffness * depth : candidate.force.norm();
  return 0.5 * candidate.stiffness * depth * depth;
}

double evaluate_friction(ContactCandidate& candidate, const Eigen::Vector3d& point) {
  candidate.slip = slip_of(candidate, point);
  if (candidate.friction_force <= 0) return 0;
  const SlipLaw law(candidate.friction_force, candidate.stiffness, candidate.slip.norm());
  candidate.force -= law.secant * candidate.slip;
  return law.energy;
}

double gap_at(const PlacedObstacle& placed, const ContactCandidate& candidate, const Eigen::Vector3d& point) {
  NearestHint hint = candidate.hint;
  bool by_plane = false;
  return felt_surface(placed, candidate.passage, point, hint, by_plane).distance;
}

bool precedes(const HeldContact& held, const ContactCandidate& candidate) {
  return held.vertex != candidate.vertex ? held.vertex < candidate.vertex : held.obstacle < candidate.obstacle;
}

}  // namespace

void freeze_contact(const ContactLaw& law, const SurfacePoint& surface, const Eigen::Vector3d& carried,
                    const Eigen::Vector3d& predicted, double area, double time_step,
                    ContactCandidate& candidate) noexcept {
  candidate.carried = candidate.anchor = carried;
  const double predicted_gap = surface.distance + surface.normal.dot(predicted - carried);
  const bool touches = std::min(surface.distance, predicted_gap) < 0;
  candidate.normal = surface.normal;
  candidate.start_gap = surface.distance;
  candidate.clearance = -1;
  candidate.stiffness = law.stiffness * area;
  candidate.damping = touches ? law.damping / (law.stiffness * time_step) : 0;
  candidate.spring_share = 1 / (1 + candidate.damping);
  candidate.friction_force = 0;
  candidate.overlap = candidate.released = 0;
}

double ContactLaw::most_pressed(double load, double acceleration) const noexcept {
  if (!std::isfinite(load)) return load;
  return 0.5 * release * std::sqrt(load / stiffness) + 4 * load * acceleration / stiffness;
}

double ContactState::longest_way_out() const noexcept {
  double longest = 0;
  for (std::size_t i = 0; i < count; ++i) longest = std::max(longest, held[i].way_out.squaredNorm());
  return std::sqrt(longest);
}

const HeldContact* find_held(const ContactState& state, std::size_t& next, const ContactCandidate& candidate) noexcept {
  while (next < state.count && precedes(state.held[next], candidate)) ++next;
  if (next == state.count) return nullptr;
  const HeldContact& held = state.held[next];
  return held.vertex == candidate.vertex && held.obstacle == candidate.obstacle ? &held : nullptr;
}

void freeze_contact(const PlacedObstacle& placed, const HeldContact* held, const VertexMotion& motion, double area,
                    double time_step, ContactCandidate& candidate) noexcept {
  const Obstacle& obstacle = *placed.obstacle;
  const VertexWay way{placed.carried(motion.point), motion.predicted, motion.heading};
  candidate.hint = NearestHint();
  SurfacePoint surface = placed.nearest_surface_point(way.carried, candidate.hint);
  const double gone = motion.first_step ? 0 : (motion.predicted - way.carried).norm();
  Eigen::Vector3d way_out = Eigen::Vector3d::Zero();
  if (held != nullptr)
    way_out = placed.pose.rotation * held->way_out;
  else if (was_put(-surface.distance, gone))
    way_out = way_out_with(placed.carried(motion.centre), placed, way.carried, surface);
  candidate.passage = find_passage(placed, way, surface, way_out);
  if (candidate.passage.kind == Passage::Kind::kThrough) {
    const bool is_let_out = !way_out.isZero(0) && (held == nullptr || held->overlap > 0);
    if (is_let_out) candidate.passage.side.normal = way_out.normalized();  // that of all its body
    surface = candidate.passage.side.nearest(way.carried);
  }
  const ContactLaw law{obstacle.stiffness, obstacle.damping, obstacle.friction, obstacle.release};
  freeze_contact(law, surface, way.carried, motion.predicted, area, time_step, candidate);
  if (candidate.passage.kind == Passage::Kind::kWatched) candidate.start_gap = gap_at(placed, candidate, way.carried);
  const double depth = -surface.distance;
  const double before = held != nullptr ? held->overlap : was_put(depth, gone) ? depth : 0;
  if (before > 0) {
    const double acceleration = (motion.heading - 2 * motion.predicted + motion.point).norm() / (time_step * time_step);
    candidate.release_overlap(depth, before, surface.normal.dot(motion.predicted - way.carried),
                              law.most_pressed(motion.load, acceleration), time_step * law.release);
  }
  if (held == nullptr) return;
  candidate.anchor = placed.pose.to_world(held->anchor);
  if (candidate.rubs()) candidate.friction_force = obstacle.friction * held->normal_force;
}

double evaluate_contact(double gap, const Eigen::Vector3d& normal, const Eigen::Vector3d& point,
                        ContactCandidate& candidate) noexcept {
  candidate.force.setZero();
  candidate.normal_force = 0;
  const double energy = evaluate_normal(candidate, gap, normal, point);
  return candidate.spring_share * (energy + evaluate_friction(candidate, point));
}

StiffnessFactors::StiffnessFactors(const ContactCandidate& candidate) noexcept {
  const auto add = [this](double weight, const Eigen::Vector3d& direction) {
    if (weight > 0) columns.col(count++) = std::sqrt(weight) * direction;
  };
  add(candidate.normal_stiffness(), candidate.direction);
  if (candidate.friction_force <= 0) return;
  const double length = candidate.slip.norm();
  const SlipLaw law(candidate.friction_force, candidate.stiffness, length);
  const Eigen::Vector3d along =
      length > 0 ? Eigen::Vector3d(1 / length * candidate.slip) : candidate.normal.unitOrthogonal();
  add((1 + candidate.damping) * law.tangent, along);
  add((1 + candidate.damping) * law.secant, candidate.normal.cross(along));
}

double clearance_of(const ContactCandidate& candidate, const Eigen::Vector3d& point) noexcept {
  if (candidate.normal_force > 0 || candidate.friction_force > 0) return -1;
  // Distances change by no more than the way, and what damping adds to the depth by no more than its share of it.
  return std::min(candidate.gap, -candidate.spring_share * damped_depth(candidate, candidate.gap, point));
}

void leave_untouched(ContactCandidate& candidate) noexcept {
  candidate.force.setZero();
  candidate.normal_force = 0;
  candidate.gap = 0;
}

double evaluate_contact(const PlacedObstacle& placed, const Eigen::Vector3d& point,
                        ContactCandidate& candidate) noexcept {
  if (placed.plane != nullptr) {
    candidate.by_plane = false;
    return evaluate_contact(placed.plane->distance(point), placed.plane->normal, point, candidate);
  }
  const SurfacePoint surface = felt_surface(placed, candidate.passage, point, candidate.hint, candidate.by_plane);
  return evaluate_contact(surface.distance, surface.normal, point, candidate);
}

double contact_potential(const PlacedObstacle& placed, const ContactCandidate& candidate,
                         const Eigen::Vector3d& point) noexcept {
  return contact_potential(candidate, gap_at(placed, candidate, point), point);
}

double stored_energy(const ContactCandidate& candidate, double gap, const Eigen::Vector3d& point) noexcept {
  const double normal = candidate.spring_energy(-gap - candidate.overlap);
  if (candidate.friction_force <= 0) return normal;
  const double longest = 2 * candidate.friction_force / candidate.stiffness;  // beyond it slides
  const double stretch = tangential(point - candidate.anchor, candidate.normal).norm();
  return normal + SlipLaw(candidate.friction_force, candidate.stiffness, std::min(stretch, longest)).energy;
}

double contact_potential(const ContactCandidate& candidate, double gap, const Eigen::Vector3d& point) noexcept {
  const double depth = std::max(0.0, damped_depth(candidate, gap, point));
  double energy = 0.5 * candidate.stiffness * depth * depth;
  if (candidate.friction_force > 0)
    energy += SlipLaw(candidate.friction_force, candidate.stiffness, slip_of(candidate, point).norm()).energy;
  return candidate.spring_share * energy;
}

void FrictionChange::refresh(double friction, ContactCandidate& candidate) noexcept {
  const double force = candidate.rubs() ? friction * candidate.normal_force : 0;
  add(candidate.friction_force, force);
  candidate.friction_force = force;
}

double refresh_friction(const std::vector<PlacedObstacle>& obstacles,
                        std::vector<ContactCandidate>& candidates) noexcept {
  FrictionChange total;
  for (ContactCandidate& candidate : candidates)
    total.refresh(obstacles[static_cast<std::size_t>(candidate.obstacle)].obstacle->friction, candidate);
  return total.relative();
}

Eigen::Vector3d held_stretch(double friction, const Eigen::Vector3d& point,
                             const ContactCandidate& candidate) noexcept {
  const double full = candidate.rubs() ? 2 * friction * candidate.normal_force / candidate.stiffness : 0;
  const double length = candidate.slip.norm();
  return length > full ? Eigen::Vector3d(candidate.slip * (full / length))
                       : tangential(point - candidate.anchor, candidate.normal);
}

void hold_contact(const PlacedObstacle& placed, const Eigen::Vector3d& point, const ContactCandidate& candidate,
                  ContactState& state) noexcept {
  const bool is_beyond = candidate.by_plane && candidate.gap < 0;
  const double overlap = std::clamp(-candidate.gap, 0.0, candidate.overlap);
  if (candidate.normal_force <= 0 && !is_beyond && overlap <= 0) return;
  HeldContact& held = state.held[state.count++];
  held.vertex = candidate.vertex;
  held.obstacle = candidate.obstacle;
  held.normal_force = candidate.normal_force;
  held.overlap = overlap;
  held.anchor = placed.pose.to_frame(point - held_stretch(placed.obstacle->friction, point, candidate));
  held.way_out.setZero();
  if (is_beyond) held.way_out = placed.pose.rotation.transpose() * (-candidate.gap * candidate.passage.side.normal);
}

}  // namespace exmat::runtime

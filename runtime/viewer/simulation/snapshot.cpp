#include "runtime/viewer/simulation/snapshot.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "runtime/viewer/simulation/simulation.h"

namespace exmat::viewer {
namespace {

/// [k] the force on the vertex that each point is, or stands nearest to [N].
std::vector<float> contact_field(const BodyShape& shape, const std::vector<exmat_contact>& contacts) {
  std::vector<float> field(shape.vertices.size(), 0);
  if (contacts.empty()) return field;
  std::unordered_map<std::int64_t, float> forces;
  for (const exmat_contact& contact : contacts)
    forces[contact.vertex] += static_cast<float>(std::hypot(contact.force[0], contact.force[1], contact.force[2]));
  for (std::size_t i = 0; i < field.size(); ++i)
    if (const auto found = forces.find(shape.vertices[i]); found != forces.end()) field[i] = found->second;
  return field;
}

std::vector<float> floats(const std::vector<double>& numbers) { return {numbers.begin(), numbers.end()}; }

}  // namespace

StepTimes& StepTimes::operator+=(const StepTimes& more) {
  steps += more.steps;
  seconds += more.seconds;
  newton_iterations += more.newton_iterations;
  status |= more.status;
  stages.weights += more.stages.weights;
  stages.target += more.stages.target;
  stages.internal_force += more.stages.internal_force;
  stages.solve += more.stages.solve;
  stages.contact += more.stages.contact;
  return *this;
}

std::vector<float> Simulation::positions(std::size_t body) {
  Surface& surface = *kinds_[slots_[body].kind].surface;
  std::vector<float> xyz(3 * surface.points());
  bodies_[body].read_positions(surface, xyz);
  return xyz;
}

BodySnapshot Simulation::body_snapshot(std::size_t index, const SnapshotRequest& request) {
  Kind& kind = kinds_[slots_[index].kind];
  BodyRef& body = bodies_[index];
  const std::size_t modes = kind.shape->modes;
  BodySnapshot snapshot;
  std::vector<double> q(modes);
  body.read_displacement(q);
  snapshot.q = floats(q);
  std::array<double, 12> placement{};
  body.read_placement(placement);
  std::ranges::transform(placement, snapshot.placement.begin(),
                         [](double number) { return static_cast<float>(number); });
  if (body.space() == EXMAT_SPACE_FULL) snapshot.positions = positions(index);
  if (kind.shape->on_bones()) snapshot.bones = body.bones(kind.shape->bones.size());
  snapshot.energies = body.energies();
  snapshot.motion = body.motion();
  if (request.colouring == Colouring::kStrainEnergy) {
    snapshot.field.resize(kind.shape->vertices.size());
    body.read_energy_density(*kind.surface, snapshot.field);
  }
  if (request.elements) {
    if (!kind.elements) kind.elements = Points::elements(kind.model);
    snapshot.elements.resize(3 * kind.elements->size());
    body.read_positions(*kind.elements, snapshot.elements);
  }
  std::int64_t region = -1;
  for (const ForceSettings& force : kind.settings.forces) {
    const std::int64_t of = force.region.empty() ? -1 : ++region;
    std::vector<double>& weights = snapshot.weights.emplace_back(force.weights.size());
    if (of < 0)
      body.read_weights(weights);
    else
      body.read_region_weights(static_cast<std::size_t>(of), weights);
    if (!request.targets) continue;
    body.read_target(q, of);
    snapshot.targets.push_back(floats(q));
  }
  return snapshot;
}

Snapshot Simulation::snapshot(const SnapshotRequest& request) {
  Snapshot snapshot;
  snapshot.steps = steps_;
  snapshot.time = time();
  snapshot.time_step = time_step();
  std::vector<std::vector<exmat_contact>> contacts = bodies_.contacts();
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    BodySnapshot& body = snapshot.bodies.emplace_back(body_snapshot(i, request));
    body.contacts = std::move(contacts[i]);
    if (request.colouring == Colouring::kContactForce)
      body.field = contact_field(*kinds_[slots_[i].kind].shape, body.contacts);
  }
  for (const Grip& grip : grips_) {
    const Eigen::Vector3d& offset = slots_[grip.body()].offset;
    snapshot.grips.push_back({grip.id(), grip.body(), grip.point() + offset, grip.target() + offset, grip.force()});
  }
  for (const JointHand& hand : joint_hands_) {
    const Eigen::Vector3d& offset = slots_[hand.body].offset;
    snapshot.grips.push_back({hand.id, hand.body, snapshot.bodies[hand.body].joint(hand.joint) + offset,
                              hand.target + offset, Eigen::Vector3d::Zero()});
  }
  for (const Pin& pin : pins_) snapshot.pins.push_back(pin.point + slots_[pin.body].offset);
  for (const MovedObstacle& moved : obstacles_)
    snapshot.obstacles.push_back(
        {moved.id, bodies_.world().obstacle(moved.id), bodies_.world().obstacle_motion(moved.id), moved.corners});
  snapshot.times = times_;
  times_ = {};
  snapshot.failure = failure_;
  return snapshot;
}

}  // namespace exmat::viewer

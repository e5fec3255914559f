#include "runtime/viewer/simulation/simulation.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <span>

namespace exmat::viewer {
namespace {

constexpr double kDelay = 0.06;    // [s] of an obstacle or a joint that is moved by hand
constexpr double kArrived = 1e-9;  // of the distance that it has to go [m]

constexpr std::size_t kMostMeasured = 6000;  // vertices of a body whose load capacity is found while it moves
constexpr std::size_t kMostTouched = 4;      // bodies whose contacts are

std::int32_t integrator_of(const std::string& name) {
  return name == "newmark" ? EXMAT_NEWMARK : name == "backward_euler" ? EXMAT_BACKWARD_EULER : EXMAT_BDF2;
}

std::int32_t space_of(const std::string& name) {
  return name == "full" ? EXMAT_SPACE_FULL : name == "auto" ? EXMAT_SPACE_AUTO : EXMAT_SPACE_REDUCED;
}

exmat_motion motion_at(const Eigen::Vector3d& position, const exmat_motion& turned, const Eigen::Vector3d& velocity) {
  exmat_motion motion = turned;
  motion.size = sizeof motion;
  for (int i = 0; i < 3; ++i) {
    motion.position[i] = position[i];
    motion.linear_velocity[i] = velocity[i];
    motion.angular_velocity[i] = 0;
  }
  return motion;
}

Settings with_shared(Settings own, const Settings& shared) {
  own.time_step = shared.time_step;
  if (!own.own_gravity && !shared.own_gravity) own.gravity = shared.gravity;
  own.mass_damping = shared.mass_damping;
  own.stiffness_damping = shared.stiffness_damping;
  own.integrator = shared.integrator;
  return own;
}

/// Sliders begin with weights for all examples, the rest pose alone.
void fill_weights(const Model& model, Settings& settings) {
  std::int64_t region = -1;
  for (ForceSettings& force : settings.forces) {
    if (!force.region.empty()) ++region;
    const std::size_t count =
        force.region.empty() ? model.examples() : model.region_examples(static_cast<std::size_t>(region));
    if (force.weights.size() == count) continue;
    force.weights.assign(count, 0);
    if (count > 0) force.weights.front() = 1;
  }
}

}  // namespace

Simulation::Simulation(std::vector<SceneDocument> documents, int surface_kind)
    : surface_kind_(surface_kind), documents_(std::move(documents)) {
  has_contact_ = std::ranges::all_of(documents_, [](const SceneDocument& document) {
    return document.is_world() || bundle_info(document.bundle().string()).contact == 1;
  });
  take(make_touchable());
}

/// Bodies of which the scenes do not say in which space they step do so in all vertices while a hand holds them, if
/// they can.
Simulation::Made Simulation::make_touchable() {
  std::vector<SceneDocument> touchable = documents_;
  for (SceneDocument& document : touchable) document.prefer_space("auto");
  try {
    Made made = make(touchable);
    documents_ = std::move(touchable);
    return made;
  } catch (const Error&) {
    return make(documents_);
  }
}

/// The bodies of the first document, and one of each other one.
Simulation::Made Simulation::make(const std::vector<SceneDocument>& documents) const {
  const SceneDocument& first = documents.front();
  World world = World::from_text(first.text(), first.path().string(), has_contact_);
  Made made;
  for (const std::int64_t id : world.ids()) {
    const auto kind = static_cast<std::size_t>(world.kind(id));
    if (kind == made.kinds.size()) made.kinds.push_back(make_kind(first, kind, kind, world.body(id).model()));
    made.slots.push_back({kind, Eigen::Vector3d::Zero()});
  }
  for (std::size_t i = 1; i < documents.size(); ++i) {
    const std::size_t kind = made.kinds.size();
    made.kinds.push_back(make_kind(documents[i], 0, kind,
                                   Model::from_text(documents[i].text(), documents[i].path().string(), has_contact_)));
    made.kinds.back().document = i;
    made.slots.push_back({kind, Eigen::Vector3d::Zero()});
    world.add(Body(made.kinds.back().model));
  }
  made.bodies = SteppedBodies(std::move(world));
  return made;
}

/// Its shape is that of the kind of this number before, where there was one: bundles stay.
Simulation::Kind Simulation::make_kind(const SceneDocument& document, std::size_t of_document, std::size_t number,
                                       Model model) const {
  auto surface = std::make_unique<Surface>(model, surface_kind_);
  auto shape =
      number < kinds_.size() ? kinds_[number].shape : std::make_shared<const BodyShape>(make_shape(model, *surface));
  Settings settings = document.settings(of_document);
  fill_weights(model, settings);
  return {0,
          of_document,
          document.kind_name(of_document),
          std::move(settings),
          std::move(model),
          std::move(surface),
          std::nullopt,
          std::move(shape),
          nullptr};
}

void Simulation::take(Made made) {
  kinds_ = std::move(made.kinds);
  slots_ = std::move(made.slots);
  bodies_ = std::move(made.bodies);
  moved_bones_ = false;
  if (!is_world()) place_side_by_side();
  World& world = bodies_.world();
  world.set_profiled(true);
  obstacles_.clear();
  std::int64_t number = 0;
  for (const std::int64_t id : world.obstacle_ids())
    obstacles_.push_back(
        {id, number++, false, std::nullopt, std::make_shared<const std::vector<double>>(world.obstacle_triangles(id))});
}

void Simulation::place_side_by_side() {
  const Eigen::Vector3d gravity(kinds_.front().settings.gravity.data());
  Eigen::Index up = 2;
  if (!gravity.isZero(0)) gravity.cwiseAbs().maxCoeff(&up);
  const Eigen::Index first = up == 0 ? 1 : 0, second = up == 2 ? 1 : 2;
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();
  for (const Kind& kind : kinds_) extent = extent.cwiseMax(kind.shape->bounds.most - kind.shape->bounds.least);
  const auto columns = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(slots_.size()))));
  const double step = std::max(extent[first], 0.4 * extent.maxCoeff());
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    slots_[i].offset[first] = 1.25 * step * static_cast<double>(i % columns);
    slots_[i].offset[second] = 1.25 * extent[second] * static_cast<double>(i / columns);
  }
}

// ---- settings -------------------------------------------------------------------------------------------------------

void Simulation::apply(std::size_t kind, const Settings& settings) {
  if (settings == kinds_[kind].settings) return;
  if (!same_model(settings, kinds_[kind].settings)) return rebuild(kind, settings);
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    apply_live(i, i == kind ? settings : with_shared(kinds_[i].settings, settings));
}

void Simulation::apply_live(std::size_t kind, const Settings& settings) {
  const Settings& before = kinds_[kind].settings;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (slots_[i].kind != kind) continue;
    BodyRef& body = bodies_[i];
    body.set_gravity(settings.gravity);
    body.set_damping(settings.mass_damping, settings.stiffness_damping);
    if (settings.space != before.space) {
      remove_pins();
      body.set_space(space_of(settings.space));
    }
    if (settings.integrator != before.integrator) body.set_integrator(integrator_of(settings.integrator));
    std::int64_t region = -1;
    for (const ForceSettings& force : settings.forces) {
      const std::int64_t of = force.region.empty() ? -1 : ++region;
      body.set_example_stiffness(force.on ? force.stiffness : 0, of);
      if (force.law != "elastic" || force.damping > 0) body.set_example_damping(force.on ? force.damping : 0, of);
      body.set_example_bias(force.bias, of);
      body.set_example_weights(force.given ? force.weights : std::vector<double>(), of);
    }
  }
  kinds_[kind].settings = settings;
  put(settings, kinds_[kind], documents_);
}

void Simulation::put(const Settings& settings, const Kind& kind, std::vector<SceneDocument>& documents) const {
  documents[kind.document].set(settings, kind.of_document);
}

void Simulation::rebuild(std::size_t kind, const Settings& settings) {
  std::vector<SceneDocument> documents = documents_;
  std::vector<Settings> all;
  for (std::size_t i = 0; i < kinds_.size(); ++i) {
    all.push_back(i == kind ? settings : with_shared(kinds_[i].settings, settings));
    put(all.back(), kinds_[i], documents);
  }
  Made made = make(documents);
  struct Motion {
    std::vector<double> q, v;
    exmat_motion motion;
  };
  std::vector<Motion> motions;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const std::size_t modes = kinds_[slots_[i].kind].shape->modes;
    Motion& motion =
        motions.emplace_back(Motion{std::vector<double>(modes), std::vector<double>(modes), bodies_[i].motion()});
    bodies_[i].read_displacement(motion.q);
    bodies_[i].read_velocity(motion.v);
  }
  const std::vector<MovedObstacle> obstacles = obstacles_;
  std::vector<std::pair<exmat_obstacle, exmat_motion>> stood;
  for (const MovedObstacle& obstacle : obstacles)
    stood.emplace_back(bodies_.world().obstacle(obstacle.id), bodies_.world().obstacle_motion(obstacle.id));
  const bool goes_on = std::ranges::none_of(documents, &SceneDocument::has_scripted_motion);
  grips_.clear();
  joint_hands_.clear();
  pins_.clear();
  documents_ = std::move(documents);
  take(std::move(made));
  steps_ = 0;
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    if (obstacles[i].of_scene < 0) add_obstacle(stood[i].first);
    if (!obstacles[i].moved) continue;
    bodies_.world().move_obstacle(obstacles_[i].id, stood[i].second);
    obstacles_[i].moved = true;
  }
  for (std::size_t i = 0; goes_on && i < bodies_.size(); ++i) {
    if (kinds_[slots_[i].kind].shape->on_bones()) continue;
    bodies_[i].set_reduced(motions[i].q, motions[i].v);
    if (kinds_[slots_[i].kind].shape->mass > 0) bodies_[i].set_motion(motions[i].motion);
  }
  for (std::size_t i = 0; i < kinds_.size(); ++i) apply_live(i, all[i]);
}

void Simulation::reset() {
  if (moved_bones_) rebuild(0, Settings(kinds_.front().settings));  // bones that a host gives end an animation
  remove_pins();
  bodies_.world().reset();
  grips_.clear();
  joint_hands_.clear();
  steps_ = 0;
  failure_.clear();
}

// ---- steps ----------------------------------------------------------------------------------------------------------

bool Simulation::is_held() const {
  return !grips_.empty() || !joint_hands_.empty() ||
         std::ranges::any_of(obstacles_, [](const MovedObstacle& moved) { return moved.target.has_value(); });
}

void Simulation::prepare_step() {
  move_obstacles();
  move_bones();
  for (const Grip& grip : grips_) bodies_[grip.body()].clear_forces();
  for (Grip& grip : grips_) grip.pull(time_step(), strength_, bodies_[grip.body()]);
}

void Simulation::move_obstacles() {
  for (MovedObstacle& moved : obstacles_) {
    if (!moved.target) continue;
    const exmat_motion now = bodies_.world().obstacle_motion(moved.id);
    const Eigen::Vector3d from(now.position);
    const Eigen::Vector3d way = (1 - std::exp(-time_step() / kDelay)) * (*moved.target - from);
    const bool arrived = way.norm() < kArrived;
    bodies_.world().move_obstacle(
        moved.id, motion_at(from, now, arrived ? Eigen::Vector3d::Zero() : Eigen::Vector3d(way / time_step())));
    if (arrived) moved.target.reset();
  }
}

void Simulation::move_bones() {
  std::map<std::size_t, std::vector<double>> moved;  // transforms of the bones of a body
  for (const JointHand& hand : joint_hands_) {
    const std::vector<std::int64_t>& parents = kinds_[slots_[hand.body].kind].shape->bone_parents;
    auto& transforms = moved.try_emplace(hand.body, bodies_[hand.body].bones(parents.size())).first->second;
    turn_toward(hand.joint, hand.target, 1 - std::exp(-time_step() / kDelay), parents, transforms);
  }
  for (const auto& [body, transforms] : moved) bodies_[body].set_bones(transforms);
}

bool Simulation::step(std::int64_t steps) {
  const auto begin = std::chrono::steady_clock::now();
  try {
    bodies_.step(steps);
  } catch (const Error& error) {
    failure_ = error.what();
  }
  add_times(steps, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  if (!failure_.empty()) return false;
  steps_ += steps;
  return true;
}

void Simulation::add_times(std::int64_t steps, double seconds) {
  times_.steps += steps * static_cast<std::int64_t>(bodies_.size());
  times_.seconds += seconds;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const exmat_report report = bodies_[i].report();
    times_.newton_iterations += report.newton_iterations;
    times_.status |= report.status;
  }
  const exmat_profile profile = bodies_.world().profile();
  times_.stages.weights += profile.weights;
  times_.stages.target += profile.target;
  times_.stages.internal_force += profile.internal_force;
  times_.stages.solve += profile.solve;
  times_.stages.contact += profile.contact;
}

void Simulation::advance(std::int64_t steps) {
  if (!failure_.empty()) return;
  for (; steps > 0 && is_held(); --steps) {
    prepare_step();
    if (!step(1)) return;
  }
  if (steps > 0) step(steps);
}

// ---- hands and obstacles --------------------------------------------------------------------------------------------

int Simulation::grab(std::size_t body, const SurfaceHit& place) {
  const Kind& kind = kinds_[slots_[body].kind];
  grips_.emplace_back(next_grip_, body, *kind.shape, *kind.surface, place, bodies_[body]);
  return next_grip_++;
}

int Simulation::grab_joint(std::size_t body, std::size_t joint) {
  const std::vector<double> transforms = bodies_[body].bones(kinds_[slots_[body].kind].shape->bones.size());
  bodies_[body].set_bones(transforms);  // the first bones that a host gives put the body there
  moved_bones_ = true;
  const double* const place = transforms.data() + 12 * joint;
  joint_hands_.push_back({next_grip_, body, joint, {place[3], place[7], place[11]}});
  return next_grip_++;
}

void Simulation::move_grip(int id, const Eigen::Vector3d& target) {
  for (Grip& grip : grips_)
    if (grip.id() == id) grip.set_target(target);
  for (JointHand& hand : joint_hands_)
    if (hand.id == id) hand.target = target;
}

void Simulation::release(int id) {
  std::erase_if(joint_hands_, [&](const JointHand& hand) { return hand.id == id; });
  const auto grip = std::ranges::find(grips_, id, &Grip::id);
  if (grip == grips_.end()) return;
  const std::size_t body = grip->body();
  grips_.erase(grip);
  bodies_[body].clear_forces();
  bodies_[body].restart_integrator();
}

void Simulation::toggle_pin(std::size_t body, const SurfaceHit& place) {
  const BodyShape& shape = *kinds_[slots_[body].kind].shape;
  const Eigen::Vector3d rest = shape.rest_place(place);
  const auto held = std::ranges::find_if(pins_, [&](const Pin& pin) {
    return pin.body == body && (pin.rest - rest).norm() <= kHandSize * shape.bounds.diagonal();
  });
  if (held != pins_.end()) {
    bodies_[body].detach(held->attachment);
    pins_.erase(held);
    return;
  }
  std::vector<std::int64_t> vertices;
  const auto take = [&](std::int64_t triangle, int corner) {
    const std::int64_t vertex = shape.vertices[static_cast<std::size_t>(shape.point(triangle, corner))];
    if (std::ranges::count(vertices, vertex) == 0) vertices.push_back(vertex);
  };
  for (const Corner& covered : covered_points(shape, place)) take(covered.triangle, covered.corner);
  for (int c = 0; vertices.empty() && c < 3; ++c) take(place.triangle, c);

  const std::vector<float> now = positions(body);
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int c = 0; c < 3; ++c)
    point += place.shares[c] * Eigen::Map<const Eigen::Vector3f>(
                                   now.data() + 3 * static_cast<std::ptrdiff_t>(shape.point(place.triangle, c)))
                                   .cast<double>();
  // A body in its modes may be too stiff for the first, and one that may touch others takes the last alone.
  exmat_attachment kind = default_attachment();
  const double mass = effective_mass(patch_of(*kinds_[slots_[body].kind].surface, shape, place), shape);
  const double per_mass = std::min(1e5, 1 / (time_step() * time_step()));
  kind.stiffness = per_mass * mass;
  kind.damping = 2 * std::sqrt(per_mass) * mass;
  constexpr std::array<double, 12> kWorld{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  std::optional<std::int64_t> id;
  for (const std::int32_t each : {EXMAT_ATTACHMENT_FIXED, EXMAT_ATTACHMENT_BALL, EXMAT_ATTACHMENT_SPRING}) {
    kind.kind = each;
    try {
      id = bodies_[body].attach(vertices, kWorld, kind);
      break;
    } catch (const Error&) {
      if (each == EXMAT_ATTACHMENT_SPRING) throw;
    }
  }
  pins_.push_back({body, *id, rest, point});
}

void Simulation::remove_pins() {
  for (const Pin& pin : pins_) bodies_[pin.body].detach(pin.attachment);
  pins_.clear();
}

bool Simulation::throw_body(std::size_t body, const Eigen::Vector3d& velocity, const Eigen::Vector3d& spin) {
  if (kinds_[slots_[body].kind].shape->mass == 0) return false;
  exmat_motion motion = bodies_[body].motion();
  for (int i = 0; i < 3; ++i) {
    motion.linear_velocity[i] = velocity[i];
    motion.angular_velocity[i] = spin[i];
  }
  bodies_[body].set_motion(motion);
  return true;
}

std::optional<SurfaceHit> Simulation::cast(std::size_t body, const Ray& ray, double most) const {
  const auto hit =
      bodies_[body].cast_ray(*kinds_[slots_[body].kind].surface, std::span<const double, 3>(ray.origin.data(), 3),
                             std::span<const double, 3>(ray.direction.data(), 3), most);
  if (!hit) return std::nullopt;
  return SurfaceHit{hit->triangle, Eigen::Vector3d(hit->shares.data()), hit->distance};
}

std::optional<Simulation::ObstacleHit> Simulation::cast(Ray ray) const {
  constexpr double kBeyond = 1e-9;  // of the way to a plane, which does not hide what is behind it
  double way = 0;
  while (const auto hit = bodies_.world().cast_ray({}, std::span<const double, 3>(ray.origin.data(), 3),
                                                   std::span<const double, 3>(ray.direction.data(), 3))) {
    const auto found = std::ranges::find(obstacles_, hit->obstacle, &MovedObstacle::id);
    if (bodies_.world().obstacle(hit->obstacle).shape != EXMAT_PLANE)
      return ObstacleHit{static_cast<std::size_t>(found - obstacles_.begin()), way + hit->distance};
    const double on = hit->distance + kBeyond * (1 + way + hit->distance);
    way += on;
    ray.origin += on * ray.direction;
  }
  return std::nullopt;
}

void Simulation::add_obstacle(const exmat_obstacle& obstacle) {
  const std::int64_t id = bodies_.world().add_obstacle(obstacle);
  obstacles_.push_back({id, -1, false, std::nullopt, std::make_shared<const std::vector<double>>()});
}

void Simulation::remove_obstacle(std::size_t obstacle) {
  bodies_.world().remove_obstacle(obstacles_[obstacle].id);
  obstacles_.erase(obstacles_.begin() + static_cast<std::ptrdiff_t>(obstacle));
}

void Simulation::move_obstacle(std::size_t obstacle, const Eigen::Vector3d& position) {
  obstacles_[obstacle].target = position;
  obstacles_[obstacle].moved = true;
}

void Simulation::set_obstacle_law(std::size_t obstacle, double stiffness, double damping, double friction) {
  bodies_.world().set_obstacle_law(obstacles_[obstacle].id, stiffness, damping, friction);
}

/// Bodies that something touches, those with the largest forces first, no more than are measured.
std::vector<std::size_t> Simulation::most_touched() const {
  const std::vector<std::vector<exmat_contact>> contacts = bodies_.contacts();
  std::vector<std::pair<double, std::size_t>> touched;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    double force = 0;
    for (const exmat_contact& contact : contacts[i])
      force += std::hypot(contact.force[0], contact.force[1], contact.force[2]);
    if (force > 0) touched.emplace_back(-force, i);
  }
  std::ranges::sort(touched);
  touched.resize(std::min(touched.size(), kMostTouched));
  std::vector<std::size_t> bodies;
  for (const auto& entry : touched) bodies.push_back(entry.second);
  return bodies;
}

LostWork Simulation::lost_work() {
  LostWork lost;
  const auto capacity_of = [&](std::size_t body) -> const Capacity* {
    Kind& kind = kinds_[slots_[body].kind];
    if (kind.model.vertices() > kMostMeasured) {
      lost.measured = false;
      return nullptr;
    }
    if (!kind.capacity)
      kind.capacity = std::make_unique<Capacity>(kind.model, kHandSize * kind.shape->bounds.diagonal());
    return kind.capacity.get();
  };
  for (const Grip& grip : grips_)
    if (const Capacity* const capacity = capacity_of(grip.body()))
      lost.hand = std::max(lost.hand.value_or(0), grip.lost(*capacity, bodies_[grip.body()]));
  for (const std::size_t body : most_touched())
    if (const Capacity* const capacity = capacity_of(body))
      lost.contact = std::max(lost.contact.value_or(0), capacity->contact_lost(bodies_[body]));
  return lost;
}

void Simulation::save_scene(const std::filesystem::path& file) const {
  std::vector<PlacedObstacle> placed;
  for (const MovedObstacle& moved : obstacles_)
    placed.push_back(
        {moved.of_scene, moved.moved, bodies_.world().obstacle(moved.id), bodies_.world().obstacle_motion(moved.id)});
  const SceneDocument& document = documents_.front();
  document.save(file, steps_ > 0 ? steps_ : document.steps(), placed);
}

}  // namespace exmat::viewer

#include "runtime/viewer/simulation/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace exmat::viewer {
namespace {

constexpr double kObstacleDelay = 0.06;  // [s] of an obstacle that is moved by hand
constexpr double kArrived = 1e-9;        // of the distance that it has to go [m]

constexpr std::size_t kMostMeasured = 6000;  // vertices of a body whose load capacity is found while it moves
constexpr double kHandSize = 0.06;           // radius over the body's size

std::int32_t integrator_of(const std::string& name) {
  return name == "newmark" ? EXMAT_NEWMARK : name == "backward_euler" ? EXMAT_BACKWARD_EULER : EXMAT_BDF2;
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
  own.gravity = shared.gravity;
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

Simulation::Simulation(std::vector<SceneDocument> documents, int surface_kind) : surface_kind_(surface_kind) {
  has_contact_ = std::ranges::all_of(
      documents, [](const SceneDocument& document) { return bundle_info(document.bundle().string()).contact == 1; });
  const int instances = documents.front().instances();
  for (SceneDocument& document : documents) kinds_.push_back(make_kind(std::move(document), surface_kind));
  for (std::size_t kind = 0; kind < kinds_.size(); ++kind)
    slots_.resize(slots_.size() + static_cast<std::size_t>(kind == 0 ? instances : 1),
                  Slot{kind, Eigen::Vector3d::Zero()});
  place_side_by_side();
  make_bodies();
}

Simulation::Kind Simulation::make_kind(SceneDocument document, int surface_kind) const {
  Model model = Model::from_text(document.text(), document.path().string(), has_contact_);
  auto surface = std::make_unique<Surface>(model, surface_kind);
  auto shape = std::make_shared<const BodyShape>(make_shape(model, *surface));
  Settings settings = document.settings();
  fill_weights(model, settings);
  return {std::move(document),     std::move(settings), std::move(model), std::move(surface),
          std::optional<Points>(), std::move(shape),    nullptr};
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

void Simulation::make_bodies() {
  Bodies bodies;
  for (const Slot& slot : slots_) {
    Body body(kinds_[slot.kind].model);
    body.set_profiled(true);
    bodies.add(std::move(body));
  }
  bodies_ = std::move(bodies);
  obstacles_.clear();
  std::int64_t number = 0;
  for (const std::int64_t id : bodies_[0].obstacle_ids()) obstacles_.push_back({id, number++, false, std::nullopt});
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
    Body& body = bodies_[i];
    body.set_gravity(settings.gravity);
    body.set_damping(settings.mass_damping, settings.stiffness_damping);
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
  kinds_[kind].document.set(settings);
}

void Simulation::rebuild(std::size_t kind, const Settings& settings) {
  std::vector<Kind> kinds;
  for (std::size_t i = 0; i < kinds_.size(); ++i) {
    SceneDocument document = kinds_[i].document;
    const Settings own = i == kind ? settings : with_shared(kinds_[i].settings, settings);
    document.set(own);
    Model model = Model::from_text(document.text(), document.path().string(), has_contact_);
    auto surface = std::make_unique<Surface>(model, surface_kind_);
    kinds.push_back(
        {std::move(document), own, std::move(model), std::move(surface), std::nullopt, kinds_[i].shape, nullptr});
  }
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
    stood.emplace_back(bodies_[0].obstacle(obstacle.id), bodies_[0].obstacle_motion(obstacle.id));
  const bool goes_on = !kinds.front().document.has_scripted_motion();
  kinds_ = std::move(kinds);
  grips_.clear();
  make_bodies();
  steps_ = 0;
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    if (obstacles[i].of_scene < 0) add_obstacle(stood[i].first);
    if (!obstacles[i].moved) continue;
    for (std::size_t body = 0; body < bodies_.size(); ++body)
      bodies_[body].move_obstacle(obstacles_[i].id, stood[i].second);
    obstacles_[i].moved = true;
  }
  for (std::size_t i = 0; goes_on && i < bodies_.size(); ++i) {
    bodies_[i].set_reduced(motions[i].q, motions[i].v);
    if (kinds_[slots_[i].kind].shape->mass > 0) bodies_[i].set_motion(motions[i].motion);
  }
  for (std::size_t i = 0; i < kinds_.size(); ++i) apply_live(i, kinds_[i].settings);
}

void Simulation::reset() {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].reset();
  grips_.clear();
  steps_ = 0;
  failure_.clear();
}

// ---- steps ----------------------------------------------------------------------------------------------------------

bool Simulation::is_held() const {
  return !grips_.empty() ||
         std::ranges::any_of(obstacles_, [](const MovedObstacle& moved) { return moved.target.has_value(); });
}

void Simulation::prepare_step() {
  move_obstacles();
  for (const Grip& grip : grips_) bodies_[grip.body()].clear_forces();
  for (Grip& grip : grips_) grip.pull(time_step(), strength_, bodies_[grip.body()]);
}

void Simulation::move_obstacles() {
  for (MovedObstacle& moved : obstacles_) {
    if (!moved.target) continue;
    const exmat_motion now = bodies_[0].obstacle_motion(moved.id);
    const Eigen::Vector3d from(now.position);
    const Eigen::Vector3d way = (1 - std::exp(-time_step() / kObstacleDelay)) * (*moved.target - from);
    const bool arrived = way.norm() < kArrived;
    for (std::size_t i = 0; i < bodies_.size(); ++i)
      bodies_[i].move_obstacle(
          moved.id, motion_at(from, now, arrived ? Eigen::Vector3d::Zero() : Eigen::Vector3d(way / time_step())));
    if (arrived) moved.target.reset();
  }
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
    const exmat_profile profile = bodies_[i].profile();
    times_.newton_iterations += report.newton_iterations;
    times_.status |= report.status;
    times_.stages.weights += profile.weights;
    times_.stages.target += profile.target;
    times_.stages.internal_force += profile.internal_force;
    times_.stages.solve += profile.solve;
    times_.stages.contact += profile.contact;
  }
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

void Simulation::move_grip(int id, const Eigen::Vector3d& target) {
  for (Grip& grip : grips_)
    if (grip.id() == id) grip.set_target(target);
}

void Simulation::release(int id) {
  const auto grip = std::ranges::find(grips_, id, &Grip::id);
  if (grip == grips_.end()) return;
  const std::size_t body = grip->body();
  grips_.erase(grip);
  bodies_[body].clear_forces();
  bodies_[body].restart_integrator();
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

void Simulation::add_obstacle(const exmat_obstacle& obstacle) {
  std::int64_t id = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i) id = bodies_[i].add_obstacle(obstacle);
  obstacles_.push_back({id, -1, false, std::nullopt});
}

void Simulation::remove_obstacle(std::size_t obstacle) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].remove_obstacle(obstacles_[obstacle].id);
  obstacles_.erase(obstacles_.begin() + static_cast<std::ptrdiff_t>(obstacle));
}

void Simulation::move_obstacle(std::size_t obstacle, const Eigen::Vector3d& position) {
  obstacles_[obstacle].target = position;
  obstacles_[obstacle].moved = true;
}

void Simulation::set_obstacle_law(std::size_t obstacle, double stiffness, double damping, double friction) {
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    bodies_[i].set_obstacle_law(obstacles_[obstacle].id, stiffness, damping, friction);
}

LostWork Simulation::lost_work() {
  LostWork lost;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const bool held = std::ranges::any_of(grips_, [&](const Grip& grip) { return grip.body() == i; });
    const bool touched = exmat_body_contacts(bodies_[i].get()) > 0;
    if (!held && !touched) continue;
    Kind& kind = kinds_[slots_[i].kind];
    if (kind.model.vertices() > kMostMeasured) {
      lost.measured = false;
      continue;
    }
    if (!kind.capacity)
      kind.capacity = std::make_unique<Capacity>(kind.model, kHandSize * kind.shape->bounds.diagonal());
    for (const Grip& grip : grips_)
      if (grip.body() == i) lost.hand = std::max(lost.hand.value_or(0), grip.lost(*kind.capacity, bodies_[i]));
    if (touched) lost.contact = std::max(lost.contact.value_or(0), kind.capacity->contact_lost(bodies_[i]));
  }
  return lost;
}

void Simulation::save_scene(const std::filesystem::path& file) const {
  std::vector<PlacedObstacle> placed;
  for (const MovedObstacle& moved : obstacles_)
    placed.push_back(
        {moved.of_scene, moved.moved, bodies_[0].obstacle(moved.id), bodies_[0].obstacle_motion(moved.id)});
  kinds_.front().document.save(file, steps_ > 0 ? steps_ : kinds_.front().document.steps(), placed);
}

}  // namespace exmat::viewer

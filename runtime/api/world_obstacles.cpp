#include <Eigen/Geometry>
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <fmt/format.h>
#include <span>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/world_handle.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/sleep.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

exmat_obstacle default_obstacle() noexcept {
  exmat_obstacle obstacle{};
  obstacle.size = sizeof obstacle;
  obstacle.direction[2] = 1;
  std::ranges::fill(obstacle.half_extents, 1);
  obstacle.orientation[0] = 1;
  obstacle.radius = 1;
  obstacle.stiffness = 1e6;
  obstacle.group = MeetingGroup().group;
  obstacle.mask = MeetingGroup().mask;
  return obstacle;
}

Eigen::Vector3d vector_of(const double (&numbers)[3], const char* name) {
  if (const double* const far = find_far(numbers, 3))
    throw InvalidArgument(fmt::format("{} = {:g}: expected finite numbers of at most {:g}", name, *far, kFarthest));
  return Eigen::Vector3d(numbers);
}

double length_of(double number, const char* name) {
  if (!(number > 0 && number <= kFarthest))
    throw InvalidArgument(
        fmt::format("obstacle.{} = {:g}: expected a number above 0, of at most {:g}", name, number, kFarthest));
  return number;
}

double not_negative(double number, const char* name) {
  if (!(number >= 0 && std::isfinite(number)))
    throw InvalidArgument(fmt::format("obstacle.{} = {:g}: expected a finite number >= 0", name, number));
  return number;
}

Eigen::Quaterniond rotation_of_numbers(const double (&numbers)[4], const char* name) {
  const Eigen::Quaterniond rotation(numbers[0], numbers[1], numbers[2], numbers[3]);
  if (!(rotation.norm() > 0 && std::isfinite(rotation.norm())))
    throw InvalidArgument(fmt::format("{}: expected a quaternion of finite numbers that is not 0", name));
  return rotation.normalized();
}

Shape shape_of(const exmat_obstacle& obstacle) {
  const Eigen::Vector3d point = vector_of(obstacle.point, "obstacle.point");
  switch (obstacle.shape) {
    case EXMAT_PLANE: {
      const Eigen::Vector3d direction = vector_of(obstacle.direction, "obstacle.direction");
      if (direction.isZero(0)) throw InvalidArgument("obstacle.direction: expected a normal that is not 0");
      return Plane{point, direction.normalized()};
    }
    case EXMAT_SPHERE:
      return Sphere{point, length_of(obstacle.radius, "radius")};
    case EXMAT_BOX: {
      Eigen::Vector3d half;
      for (int i = 0; i < 3; ++i) half[i] = length_of(obstacle.half_extents[i], "half_extents");
      return Box{point, half, rotation_of_numbers(obstacle.orientation, "obstacle.orientation").toRotationMatrix()};
    }
    case EXMAT_CAPSULE:
      return Capsule{point, point + vector_of(obstacle.direction, "obstacle.direction"),
                     length_of(obstacle.radius, "radius")};
    case EXMAT_MESH:
    case EXMAT_HEIGHT_FIELD:
      throw InvalidArgument(fmt::format(
          "obstacle.shape = {}: it is made of arrays: expected the shape that was made of them", obstacle.shape));
    default:
      throw InvalidArgument(fmt::format("obstacle.shape = {}: expected {} to {}", obstacle.shape,
                                        static_cast<int>(EXMAT_PLANE), static_cast<int>(EXMAT_CAPSULE)));
  }
}

MeetingGroup meeting_of(const exmat_obstacle& given) {
  if (given.group == 0) throw InvalidArgument("obstacle.group = 0: expected at least one bit");
  return {given.group, given.mask};
}

void set_law(double stiffness, double damping, double friction, Obstacle& obstacle) {
  obstacle.stiffness = contact_stiffness(stiffness, "obstacle.stiffness");
  obstacle.damping = not_negative(damping, "damping");
  obstacle.friction = not_negative(friction, "friction");
}

Obstacle obstacle_of(const exmat_obstacle& given) {
  Obstacle obstacle{shape_of(given), {}, 0, 0, 0, meeting_of(given)};
  set_law(given.stiffness, given.damping, given.friction, obstacle);
  return obstacle;
}

void copy(const Eigen::Vector3d& from, double (&to)[3]) { std::copy_n(from.data(), 3, to); }
void copy(const Eigen::Matrix3d& from, double (&to)[4]) {
  const Eigen::Quaterniond rotation(from);
  to[0] = rotation.w();
  std::copy_n(rotation.vec().data(), 3, to + 1);
}

void describe(const Plane& plane, exmat_obstacle& description) {
  description.shape = EXMAT_PLANE;
  copy(plane.point, description.point);
  copy(plane.normal, description.direction);
}
void describe(const Sphere& sphere, exmat_obstacle& description) {
  description.shape = EXMAT_SPHERE;
  copy(sphere.centre, description.point);
  description.radius = sphere.radius;
}
void describe(const Box& box, exmat_obstacle& description) {
  description.shape = EXMAT_BOX;
  copy(box.centre, description.point);
  copy(box.half_extents, description.half_extents);
  copy(box.rotation, description.orientation);
}
void describe(const Capsule& capsule, exmat_obstacle& description) {
  description.shape = EXMAT_CAPSULE;
  copy(capsule.start, description.point);
  copy(Eigen::Vector3d(capsule.end - capsule.start), description.direction);
  description.radius = capsule.radius;
}

void describe(const MeshShape& mesh, exmat_obstacle& description) {
  description.shape = EXMAT_MESH;
  copy(mesh.position, description.point);
  copy(mesh.rotation, description.orientation);
}
void describe(const HeightFieldShape& field, exmat_obstacle& description) {
  description.shape = EXMAT_HEIGHT_FIELD;
  copy(field.position, description.point);
  copy(field.rotation, description.orientation);
}

exmat_obstacle description_of(const Obstacle& obstacle) {
  exmat_obstacle description = default_obstacle();
  std::visit([&](const auto& shape) { describe(shape, description); }, obstacle.shape);
  description.stiffness = obstacle.stiffness;
  description.damping = obstacle.damping;
  description.friction = obstacle.friction;
  description.group = obstacle.meeting.group;
  description.mask = obstacle.meeting.mask;
  return description;
}

exmat_motion motion_of(const MotionSample& sample) {
  exmat_motion motion{};
  copy(sample.position, motion.position);
  copy(sample.rotation, motion.orientation);
  copy(sample.linear_velocity, motion.linear_velocity);
  copy(sample.angular_velocity, motion.angular_velocity);
  return motion;
}

MotionSample sample_of(const exmat_motion& motion) {
  MotionSample sample;
  sample.position = vector_of(motion.position, "motion.position");
  sample.rotation = rotation_of_numbers(motion.orientation, "motion.orientation").toRotationMatrix();
  sample.linear_velocity = vector_of(motion.linear_velocity, "motion.linear_velocity");
  sample.angular_velocity = vector_of(motion.angular_velocity, "motion.angular_velocity");
  return sample;
}

/// The world may be const.
auto& hosted_of(auto& world, std::int64_t id) {
  const std::ptrdiff_t place = place_of_obstacle(world, id);
  if (place < 0) throw InvalidArgument(fmt::format("id = {}: the world has no such obstacle", id));
  return world.obstacles[static_cast<std::size_t>(place)];
}

/// Wakes the bodies that the obstacle may touch where it is now. None of them has paid for what its springs hold.
void wake_near(exmat_world& world, const Obstacle& obstacle) noexcept {
  const double now = time_of(world);
  for (const exmat_world::Member& member : world.members) {
    exmat_body& body = *member.body;
    body.state.contacts.account = ContactState::kUnbounded;
    if (!body.state.sleep.asleep || !body.model().contact || !obstacle.meeting.meets(body.scene.meeting)) continue;
    const PlacedObstacle placed(obstacle, now, body.scene.time_step);
    if (body.model().contact->may_meet(placed, pose_of(body.model(), body.state))) wake(body.state);
  }
}

/// Contacts with the obstacle at `place` are forgotten, and those with later ones follow them down.
void forget(std::size_t place, ContactState& contacts) {
  const int gone = static_cast<int>(place);
  const auto held = std::span(contacts.held).first(contacts.count);
  const auto end =
      std::remove_if(held.begin(), held.end(), [=](const HeldContact& contact) { return contact.obstacle == gone; });
  contacts.count = static_cast<std::size_t>(end - held.begin());
  for (HeldContact& contact : std::span(contacts.held).first(contacts.count))
    if (contact.obstacle > gone) --contact.obstacle;
}

/// After the list of its obstacles has changed: what is sized by their number follows.
void fit(exmat_body& body) {
  const std::size_t count = body.scene.obstacles.size();
  constexpr std::size_t kTouchesOfABody = 4;
  body.world->touches.reserve(kTouchesOfABody * body.world->members.size());
  body.contacts.prepare(body.model(), count);
  prepare_contacts(body.model(), count, body.start);
  body.world->world.fit(place_of(body));
}

void meet(exmat_body& body, const exmat_world::HostedObstacle& hosted) {
  body.obstacle_ids.reserve(body.obstacle_ids.size() + 1);
  body.scene.obstacles.emplace_back(hosted.obstacle);
  body.obstacle_ids.push_back(hosted.id);
  fit(body);
}

void part(exmat_body& body, std::int64_t id) {
  const auto found = std::ranges::find(body.obstacle_ids, id);
  if (found == body.obstacle_ids.end()) return;
  const auto place = found - body.obstacle_ids.begin();
  body.obstacle_ids.erase(found);
  body.scene.obstacles.erase(body.scene.obstacles.begin() + place);
  forget(static_cast<std::size_t>(place), body.state.contacts);
  fit(body);
}

/// Takes an obstacle out of the world.
void remove(exmat_world& world, std::int64_t id) {
  for (const exmat_world::Member& member : world.members) part(*member.body, id);
  std::erase_if(world.obstacles, [=](const exmat_world::HostedObstacle& hosted) { return hosted.id == id; });
}

/// Its id.
std::int64_t add_obstacle(const Obstacle& made, exmat_world& world) {
  const bool touch =
      std::ranges::any_of(world.members, [](const auto& member) { return member.body->model().contact.has_value(); });
  if (!world.members.empty() && !touch)
    throw InvalidArgument("the model knows no contact: expected settings with use_contact, or a scene with obstacles");
  world.obstacles.push_back({world.next_obstacle, std::make_shared<Obstacle>(made), true});
  world.obstacles.back().obstacle->release = world.law.release;
  const exmat_world::HostedObstacle hosted = world.obstacles.back();
  try {
    for (const exmat_world::Member& member : world.members)
      if (made.meeting.meets(member.body->scene.meeting)) meet(*member.body, hosted);
  } catch (...) {
    remove(world, hosted.id);
    throw;
  }
  wake_near(world, made);
  return world.next_obstacle++;
}

/// The load that a body's contacts put on an obstacle of its world; 0 if it does not meet it.
ContactLoad load_on(const exmat_body& body, std::int64_t id) noexcept {
  const auto found = std::ranges::find(body.obstacle_ids, id);
  if (found == body.obstacle_ids.end()) return {};
  return body.contacts.on_obstacle(static_cast<std::size_t>(found - body.obstacle_ids.begin()));
}

Shape placed_shape(const exmat_shape& shape, const exmat_obstacle& obstacle) {
  const Eigen::Vector3d position = vector_of(obstacle.point, "obstacle.point");
  const Eigen::Matrix3d rotation = rotation_of_numbers(obstacle.orientation, "obstacle.orientation").toRotationMatrix();
  if (shape.mesh) return MeshShape{shape.mesh, position, rotation};
  return HeightFieldShape{shape.field, position, rotation};
}

}  // namespace

namespace exmat::runtime {

std::ptrdiff_t place_of_obstacle(const exmat_world& world, std::int64_t id) noexcept {
  const auto found = std::ranges::lower_bound(world.obstacles, id, {}, &exmat_world::HostedObstacle::id);
  return found != world.obstacles.end() && found->id == id ? found - world.obstacles.begin() : -1;
}

void meet_obstacles(exmat_body& body) {
  Obstacles obstacles;
  std::vector<std::int64_t> ids;
  for (const exmat_world::HostedObstacle& hosted : body.world->obstacles) {
    if (!hosted.obstacle->meeting.meets(body.scene.meeting)) continue;
    obstacles.emplace_back(hosted.obstacle);
    ids.push_back(hosted.id);
  }
  body.scene.obstacles.swap(obstacles);
  body.obstacle_ids.swap(ids);
  if (body.obstacle_ids != ids) body.state.contacts.count = 0;
  body.state.contacts.account = ContactState::kUnbounded;
  fit(body);
  wake(body.state);
}

void take_obstacles(const Obstacles& obstacles, exmat_world& world) {
  for (const SharedObstacle& obstacle : obstacles)
    world.obstacles.push_back({world.next_obstacle++, std::make_shared<Obstacle>(*obstacle), false, obstacle->motion});
}

void hold_by_copies(const Obstacles& obstacles, exmat_body& body) {
  for (State* const state : {&body.start, &body.state})
    for (Attachment& attachment : state->attachments)
      for (std::size_t i = 0; i < obstacles.size(); ++i)
        if (attachment.motion == obstacles[i].motion())
          attachment.motion = SharedObstacle(body.world->obstacles[i].obstacle).motion();
}

}  // namespace exmat::runtime

exmat_status exmat_obstacle_default(exmat_obstacle* obstacle, std::size_t size) noexcept {
  EXMAT_REQUIRE(obstacle);
  if (const exmat_status status = check_size(__func__, size, kObstacleSizes)) return status;
  give(default_obstacle(), size, obstacle);
  return EXMAT_OK;
}

exmat_status exmat_world_add_obstacle(exmat_world* world, const exmat_obstacle* obstacle, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(id);
  *id = -1;
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(obstacle);
  if (const exmat_status status = check_size(__func__, obstacle->size, kObstacleSizes)) return status;
  return guarded(__func__, [&] { *id = add_obstacle(obstacle_of(*obstacle), *world); });
}

exmat_status exmat_world_add_shape(exmat_world* world, const exmat_shape* shape, const exmat_obstacle* obstacle,
                                   std::int64_t* id) noexcept {
  EXMAT_REQUIRE(id);
  *id = -1;
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(shape);
  EXMAT_REQUIRE(obstacle);
  if (const exmat_status status = check_size(__func__, obstacle->size, kObstacleSizes)) return status;
  return guarded(__func__, [&] {
    Obstacle made{placed_shape(*shape, *obstacle), {}, 0, 0, 0, meeting_of(*obstacle)};
    set_law(obstacle->stiffness, obstacle->damping, obstacle->friction, made);
    *id = add_obstacle(made, *world);
  });
}

exmat_status exmat_world_remove_obstacle(exmat_world* world, std::int64_t id) noexcept {
  EXMAT_REQUIRE(world);
  return guarded(__func__, [&] {
    wake_near(*world, *hosted_of(*world, id).obstacle);
    remove(*world, id);
  });
}

std::int64_t exmat_world_obstacles(const exmat_world* world) noexcept {
  return world != nullptr ? std::ssize(world->obstacles) : -1;
}

exmat_status exmat_world_read_obstacle_ids(const exmat_world* world, std::int64_t* ids, std::int64_t count) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE_LENGTH(count, world->obstacles.size());
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(ids);
  std::ranges::transform(world->obstacles, ids, &exmat_world::HostedObstacle::id);
  return EXMAT_OK;
}

exmat_status exmat_world_move_obstacle(exmat_world* world, std::int64_t id, const exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(motion);
  if (const exmat_status status = check_size(__func__, motion->size, kMotionSizes)) return status;
  return guarded(__func__, [&] {
    exmat_world::HostedObstacle& hosted = hosted_of(*world, id);
    const RigidMotion moved = RigidMotion::going_on(time_of(*world), sample_of(*motion));
    wake_near(*world, *hosted.obstacle);
    hosted.obstacle->motion = moved;
    hosted.hosted = true;
    wake_near(*world, *hosted.obstacle);
  });
}

exmat_status exmat_world_read_obstacle(const exmat_world* world, std::int64_t id, exmat_obstacle* obstacle,
                                       exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(world);
  if (obstacle != nullptr)
    if (const exmat_status status = check_size(__func__, obstacle->size, kObstacleSizes)) return status;
  if (motion != nullptr)
    if (const exmat_status status = check_size(__func__, motion->size, kMotionSizes)) return status;
  return guarded(__func__, [&] {
    const Obstacle& found = *hosted_of(*world, id).obstacle;
    if (obstacle != nullptr) give(description_of(found), obstacle->size, obstacle);
    if (motion != nullptr) give(motion_of(found.motion.sample(time_of(*world))), motion->size, motion);
  });
}

exmat_status exmat_world_set_obstacle_law(exmat_world* world, std::int64_t id, double stiffness, double damping,
                                          double friction) noexcept {
  EXMAT_REQUIRE(world);
  return guarded(__func__, [&] {
    Obstacle& obstacle = *hosted_of(*world, id).obstacle;
    Obstacle changed{Plane{}, {}, 0, 0, 0};
    set_law(stiffness, damping, friction, changed);
    obstacle.stiffness = stiffness;
    obstacle.damping = damping;
    obstacle.friction = friction;
    wake_near(*world, obstacle);
  });
}

exmat_status exmat_world_read_obstacle_load(const exmat_world* world, std::int64_t id, double* force,
                                            double* torque) noexcept {
  EXMAT_REQUIRE(world);
  return guarded(__func__, [&] {
    hosted_of(*world, id);
    ContactLoad sum;
    for (const exmat_world::Member& member : world->members) {
      const ContactLoad load = load_on(*member.body, id);
      sum.force += load.force;
      sum.torque += load.torque;
    }
    if (force != nullptr) std::copy_n(sum.force.data(), 3, force);
    if (torque != nullptr) std::copy_n(sum.torque.data(), 3, torque);
  });
}

std::int64_t exmat_body_contacts(const exmat_body* body) noexcept {
  return body != nullptr ? static_cast<std::int64_t>(body->contacts.touches().size()) : -1;
}

exmat_status exmat_body_read_contacts(const exmat_body* body, exmat_contact* contacts, std::int64_t count,
                                      std::size_t size) noexcept {
  EXMAT_REQUIRE(body);
  if (const exmat_status status = check_size(__func__, size, kContactSizes)) return status;
  const auto touches = body->contacts.touches();
  EXMAT_REQUIRE_LENGTH(count, touches.size());
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(contacts);
  auto* to = reinterpret_cast<unsigned char*>(contacts);
  for (const ContactRecord::Touch& touch : touches) {
    exmat_contact contact{};
    contact.vertex = touch.vertex;
    contact.obstacle = body->obstacle_ids[static_cast<std::size_t>(touch.obstacle)];
    copy(touch.position, contact.position);
    copy(touch.normal, contact.normal);
    copy(touch.force, contact.force);
    contact.depth = touch.depth;
    give_entry(contact, size, to);
    to += size;
  }
  return EXMAT_OK;
}

exmat_status exmat_body_read_contact_load(const exmat_body* body, std::int64_t id, double* force,
                                          double* torque) noexcept {
  EXMAT_REQUIRE(body);
  return guarded(__func__, [&] {
    if (id != -1) hosted_of(*body->world, id);
    const ContactLoad load = id == -1 ? body->contacts.on_body() : load_on(*body, id);
    if (force != nullptr) std::copy_n(load.force.data(), 3, force);
    if (torque != nullptr) std::copy_n(load.torque.data(), 3, torque);
  });
}

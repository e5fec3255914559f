#include "runtime/api/body_obstacles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <fmt/format.h>
#include <span>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/sim/step/sleep.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace exmat::runtime {

void keep_host_obstacles(double time_before, exmat_body& body) noexcept {
  for (std::size_t i = 0; i < body.obstacles.size(); ++i) {
    RigidMotion& motion = body.scene.obstacles[i].motion;
    if (body.obstacles[i].hosted) motion = RigidMotion::going_on(body.state.time, motion.sample(time_before));
  }
}

void size_for_contact(exmat_body& body) {
  const std::size_t count = body.scene.obstacles.size();
  prepare_contacts(body.model(), count, body.state);
  prepare_contacts(body.model(), count, body.start);
  body.workspace.near.reset();
  if (may_touch(body.model(), body.scene)) body.workspace.near.emplace(body.model(), body.scene);
  body.contacts.prepare(body.model(), count);
  wake(body.state);
}

}  // namespace exmat::runtime

namespace {

exmat_obstacle default_obstacle() noexcept {
  exmat_obstacle obstacle{};
  obstacle.size = sizeof obstacle;
  obstacle.direction[2] = 1;
  std::ranges::fill(obstacle.half_extents, 1);
  obstacle.orientation[0] = 1;
  obstacle.radius = 1;
  obstacle.stiffness = 1e6;
  return obstacle;
}

Eigen::Vector3d vector_of(const double (&numbers)[3], const char* name) {
  if (!all_finite(numbers, 3)) throw InvalidArgument(fmt::format("obstacle.{}: expected finite numbers", name));
  return Eigen::Vector3d(numbers);
}

double positive(double number, const char* name) {
  if (!(number > 0 && std::isfinite(number)))
    throw InvalidArgument(fmt::format("obstacle.{} = {:g}: expected a finite number above 0", name, number));
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
  const Eigen::Vector3d point = vector_of(obstacle.point, "point");
  switch (obstacle.shape) {
    case EXMAT_PLANE: {
      const Eigen::Vector3d direction = vector_of(obstacle.direction, "direction");
      if (direction.isZero(0)) throw InvalidArgument("obstacle.direction: expected a normal that is not 0");
      return Plane{point, direction.normalized()};
    }
    case EXMAT_SPHERE:
      return Sphere{point, positive(obstacle.radius, "radius")};
    case EXMAT_BOX: {
      Eigen::Vector3d half;
      for (int i = 0; i < 3; ++i) half[i] = positive(obstacle.half_extents[i], "half_extents");
      return Box{point, half, rotation_of_numbers(obstacle.orientation, "obstacle.orientation").toRotationMatrix()};
    }
    case EXMAT_CAPSULE:
      return Capsule{point, point + vector_of(obstacle.direction, "direction"), positive(obstacle.radius, "radius")};
    case EXMAT_MESH:
    case EXMAT_HEIGHT_FIELD:
      throw InvalidArgument(
          fmt::format("obstacle.shape = {}: it is made of arrays: expected exmat_body_add_shape()", obstacle.shape));
    default:
      throw InvalidArgument(fmt::format("obstacle.shape = {}: expected {} to {}", obstacle.shape,
                                        static_cast<int>(EXMAT_PLANE), static_cast<int>(EXMAT_CAPSULE)));
  }
}

void set_law(double stiffness, double damping, double friction, Obstacle& obstacle) {
  obstacle.stiffness = positive(stiffness, "stiffness");
  obstacle.damping = not_negative(damping, "damping");
  obstacle.friction = not_negative(friction, "friction");
}

Obstacle obstacle_of(const exmat_obstacle& given) {
  Obstacle obstacle{shape_of(given), {}, 0, 0, 0};
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
  sample.position = Eigen::Vector3d(motion.position);
  sample.rotation = rotation_of_numbers(motion.orientation, "motion.orientation").toRotationMatrix();
  sample.linear_velocity = Eigen::Vector3d(motion.linear_velocity);
  sample.angular_velocity = Eigen::Vector3d(motion.angular_velocity);
  if (!sample.position.allFinite() || !sample.linear_velocity.allFinite() || !sample.angular_velocity.allFinite())
    throw InvalidArgument("motion: expected finite numbers");
  return sample;
}

/// Its place among the body's.
std::size_t place_of(const exmat_body& body, std::int64_t id) {
  const auto found = std::ranges::find(body.obstacles, id, &HostedObstacle::id);
  if (found == body.obstacles.end()) throw InvalidArgument(fmt::format("id = {}: the body has no such obstacle", id));
  return static_cast<std::size_t>(found - body.obstacles.begin());
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

/// Its id.
std::int64_t add_obstacle(const Obstacle& made, exmat_body& body) {
  if (!body.model().contact)
    throw InvalidArgument("the model knows no contact: expected settings with use_contact, or a scene with obstacles");
  body.obstacles.reserve(body.obstacles.size() + 1);
  body.scene.obstacles.push_back(made);
  try {
    size_for_contact(body);
  } catch (...) {
    body.scene.obstacles.pop_back();
    throw;
  }
  const std::int64_t id = body.next_obstacle++;
  body.obstacles.push_back({id, true});
  return id;
}

Shape placed_shape(const exmat_shape& shape, const exmat_obstacle& obstacle) {
  const Eigen::Vector3d position = vector_of(obstacle.point, "point");
  const Eigen::Matrix3d rotation = rotation_of_numbers(obstacle.orientation, "obstacle.orientation").toRotationMatrix();
  if (shape.mesh) return MeshShape{shape.mesh, position, rotation};
  return HeightFieldShape{shape.field, position, rotation};
}

}  // namespace

exmat_status exmat_obstacle_default(exmat_obstacle* obstacle, std::size_t size) noexcept {
  EXMAT_REQUIRE(obstacle);
  if (const exmat_status status = check_size(__func__, size, kObstacleSizes)) return status;
  give(default_obstacle(), size, obstacle);
  return EXMAT_OK;
}

exmat_status exmat_body_add_obstacle(exmat_body* body, const exmat_obstacle* obstacle, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(id);
  *id = -1;
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(obstacle);
  if (const exmat_status status = check_size(__func__, obstacle->size, kObstacleSizes)) return status;
  return guarded(__func__, [&] { *id = add_obstacle(obstacle_of(*obstacle), *body); });
}

exmat_status exmat_body_add_shape(exmat_body* body, const exmat_shape* shape, const exmat_obstacle* obstacle,
                                  std::int64_t* id) noexcept {
  EXMAT_REQUIRE(id);
  *id = -1;
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(shape);
  EXMAT_REQUIRE(obstacle);
  if (const exmat_status status = check_size(__func__, obstacle->size, kObstacleSizes)) return status;
  return guarded(__func__, [&] {
    Obstacle made{placed_shape(*shape, *obstacle), {}, 0, 0, 0};
    set_law(obstacle->stiffness, obstacle->damping, obstacle->friction, made);
    *id = add_obstacle(made, *body);
  });
}

exmat_status exmat_body_remove_obstacle(exmat_body* body, std::int64_t id) noexcept {
  EXMAT_REQUIRE(body);
  return guarded(__func__, [&] {
    const std::size_t place = place_of(*body, id);
    const auto offset = static_cast<std::ptrdiff_t>(place);
    body->obstacles.erase(body->obstacles.begin() + offset);
    body->scene.obstacles.erase(body->scene.obstacles.begin() + offset);
    forget(place, body->state.contacts);
    size_for_contact(*body);
  });
}

std::int64_t exmat_body_obstacles(const exmat_body* body) noexcept {
  return body != nullptr ? static_cast<std::int64_t>(body->obstacles.size()) : -1;
}

exmat_status exmat_body_read_obstacle_ids(const exmat_body* body, std::int64_t* ids, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE_LENGTH(count, body->obstacles.size());
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(ids);
  std::ranges::transform(body->obstacles, ids, &HostedObstacle::id);
  return EXMAT_OK;
}

exmat_status exmat_body_move_obstacle(exmat_body* body, std::int64_t id, const exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(motion);
  if (const exmat_status status = check_size(__func__, motion->size, kMotionSizes)) return status;
  return guarded(__func__, [&] {
    const std::size_t place = place_of(*body, id);
    body->scene.obstacles[place].motion = RigidMotion::going_on(body->state.time, sample_of(*motion));
    body->obstacles[place].hosted = true;
    wake(body->state);
  });
}

exmat_status exmat_body_read_obstacle(const exmat_body* body, std::int64_t id, exmat_obstacle* obstacle,
                                      exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(body);
  if (obstacle != nullptr)
    if (const exmat_status status = check_size(__func__, obstacle->size, kObstacleSizes)) return status;
  if (motion != nullptr)
    if (const exmat_status status = check_size(__func__, motion->size, kMotionSizes)) return status;
  return guarded(__func__, [&] {
    const Obstacle& found = body->scene.obstacles[place_of(*body, id)];
    if (obstacle != nullptr) give(description_of(found), obstacle->size, obstacle);
    if (motion != nullptr) give(motion_of(found.motion.sample(body->state.time)), motion->size, motion);
  });
}

exmat_status exmat_body_set_obstacle_law(exmat_body* body, std::int64_t id, double stiffness, double damping,
                                         double friction) noexcept {
  EXMAT_REQUIRE(body);
  return guarded(__func__, [&] {
    Obstacle changed{Plane{}, {}, 0, 0, 0};
    set_law(stiffness, damping, friction, changed);
    Obstacle& obstacle = body->scene.obstacles[place_of(*body, id)];
    obstacle.stiffness = stiffness;
    obstacle.damping = damping;
    obstacle.friction = friction;
    wake(body->state);
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
    contact.obstacle = body->obstacles[static_cast<std::size_t>(touch.obstacle)].id;
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
    const ContactLoad load = id == -1 ? body->contacts.on_body() : body->contacts.on_obstacle(place_of(*body, id));
    if (force != nullptr) std::copy_n(load.force.data(), 3, force);
    if (torque != nullptr) std::copy_n(load.torque.data(), 3, torque);
  });
}

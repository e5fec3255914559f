#include <algorithm>
#include <array>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

// Obstacles of one body: their shapes, where they are, and what touches them.

namespace exmat::python {
namespace {

using Vector3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>;
using SharedShape = std::shared_ptr<ShapeObject>;

const std::array<const char*, 6> kShapes{"plane", "sphere", "box", "capsule", "mesh", "height_field"};

// ---- shapes

SharedShape made_of(std::int32_t kind, py::tuple arguments) {
  exmat_obstacle description = default_obstacle();
  description.shape = kind;
  return std::make_shared<ShapeObject>(ShapeObject{description, std::nullopt, std::move(arguments)});
}

SharedShape plane(const Vector3& normal, const Vector3& point) {
  SharedShape shape = made_of(EXMAT_PLANE, py::make_tuple(normal, point));
  std::ranges::copy(normal, shape->description.direction);
  std::ranges::copy(point, shape->description.point);
  return shape;
}

SharedShape sphere(double radius, const Vector3& center) {
  SharedShape shape = made_of(EXMAT_SPHERE, py::make_tuple(radius, center));
  shape->description.radius = radius;
  std::ranges::copy(center, shape->description.point);
  return shape;
}

SharedShape box(const Vector3& half_extents, const Vector3& center, const Quaternion& orientation) {
  SharedShape shape = made_of(EXMAT_BOX, py::make_tuple(half_extents, center, orientation));
  std::ranges::copy(half_extents, shape->description.half_extents);
  std::ranges::copy(center, shape->description.point);
  std::ranges::copy(orientation, shape->description.orientation);
  return shape;
}

SharedShape capsule(const Vector3& start, const Vector3& end, double radius) {
  SharedShape shape = made_of(EXMAT_CAPSULE, py::make_tuple(start, end, radius));
  std::ranges::copy(start, shape->description.point);
  std::ranges::transform(end, start, shape->description.direction, std::minus());
  shape->description.radius = radius;
  return shape;
}

/// Rows of three vertices of so many.
std::vector<std::int32_t> corners_of(const py::array& triangles, std::int64_t vertices) {
  const Ids numbers = whole_numbers(triangles, "triangles");
  if (triangles.ndim() != 2) throw Error(EXMAT_INVALID_ARGUMENT, "triangles: expected an array of shape (f, 3)");
  require_shape(triangles, "triangles", {triangles.shape(0), 3});
  std::vector<std::int32_t> corners;
  for (const std::int64_t corner : read_span(numbers)) {
    if (corner < 0 || corner >= vertices)
      throw Error(EXMAT_INVALID_ARGUMENT,
                  ("triangles[" + std::to_string(corners.size()) + "] = " + std::to_string(corner) +
                   ": expected a vertex, 0 to " + std::to_string(vertices - 1))
                      .c_str());
    corners.push_back(static_cast<std::int32_t>(corner));
  }
  return corners;
}

SharedShape mesh(const Numbers& vertices, const py::array& triangles, double thickness) {
  if (vertices.ndim() != 2) throw Error(EXMAT_INVALID_ARGUMENT, "vertices: expected an array of shape (v, 3)");
  require_shape(vertices, "vertices", {vertices.shape(0), 3});
  const std::vector<std::int32_t> corners = corners_of(triangles, vertices.shape(0));
  SharedShape shape = made_of(EXMAT_MESH, py::make_tuple(vertices.attr("copy")(), triangles.attr("copy")(), thickness));
  shape->arrays = Shape::mesh(read_span(vertices), corners, thickness);
  return shape;
}

SharedShape height_field(const Numbers& heights, const std::array<double, 2>& spacing) {
  if (heights.ndim() != 2) throw Error(EXMAT_INVALID_ARGUMENT, "heights: expected an array of shape (rows, columns)");
  SharedShape shape = made_of(EXMAT_HEIGHT_FIELD, py::make_tuple(heights.attr("copy")(), spacing));
  shape->arrays = Shape::height_field(read_span(heights), heights.shape(1), spacing);
  return shape;
}

SharedShape restored(const py::tuple& kept) {
  const auto name = kept[0].cast<std::string>();
  return py::type::of<ShapeObject>().attr(name.c_str())(*kept[1]).cast<SharedShape>();
}

void bind_shape(py::module_& module) {
  const Quaternion upright{1, 0, 0, 0};
  py::class_<ShapeObject, SharedShape>(
      module, "Shape",
      "What obstacles are made of, in a frame of their own; it never changes, and any number of obstacles share it.")
      .def_static("plane", &plane, py::arg("normal"), py::arg("point") = Vector3{},
                  "Half space below a plane with this normal, of any length but 0, through a point [m].")
      .def_static("sphere", &sphere, py::arg("radius"), py::arg("center") = Vector3{}, "Ball [m].")
      .def_static("box", &box, py::arg("half_extents"), py::arg("center") = Vector3{}, py::arg("orientation") = upright,
                  "Cuboid of half the lengths of its edges [m], turned by a quaternion, w first.")
      .def_static("capsule", &capsule, py::arg("start"), py::arg("end"), py::arg("radius"),
                  "All points within a radius of a segment [m].")
      .def_static("mesh", &mesh, py::arg("vertices"), py::arg("triangles"), py::arg("thickness") = 0.0,
                  "Solid that triangles (f, 3) of vertices (v, 3) [m] enclose and look away from; with a thickness > 0 "
                  "[m] a shell about them, which may be open.")
      .def_static("height_field", &height_field, py::arg("heights"), py::arg("spacing"),
                  "Ground of heights along z, shape (rows, columns) [m]; `spacing`: of columns along x and of rows "
                  "along y [m]. Solid below, nothing beyond the border.")
      .def_property_readonly(
          "kind", [](const ShapeObject& shape) { return kShapes[static_cast<std::size_t>(shape.description.shape)]; },
          "\"plane\", \"sphere\", \"box\", \"capsule\", \"mesh\" or \"height_field\".")
      .def("__repr__",
           [](const ShapeObject& shape) {
             return std::string("<exmat.Shape ") + kShapes[static_cast<std::size_t>(shape.description.shape)] + ">";
           })
      .def(py::pickle(
          [](const ShapeObject& shape) {
            return py::make_tuple(kShapes[static_cast<std::size_t>(shape.description.shape)], shape.arguments);
          },
          &restored));
}

// ---- obstacles

void bind_obstacle(py::module_& module) {
  py::class_<ObstacleObject>(module, "Obstacle", "An obstacle of a body as it was when it was read. Arrays are copies.")
      .def_property_readonly(
          "kind", [](const ObstacleObject& read) { return kShapes[static_cast<std::size_t>(read.description.shape)]; },
          "\"plane\", \"sphere\", \"box\", \"capsule\", \"mesh\" or \"height_field\".")
      .def_property_readonly(
          "point", [](const ObstacleObject& read) { return array_of(read.description.point, 3); },
          "In its frame: of the plane, centre of sphere and box, start of the capsule, origin of a shape of arrays; "
          "shape (3,) [m].")
      .def_property_readonly(
          "direction", [](const ObstacleObject& read) { return array_of(read.description.direction, 3); },
          "Of a plane its unit normal, of a capsule the way from start to end [m]; shape (3,).")
      .def_property_readonly(
          "half_extents", [](const ObstacleObject& read) { return array_of(read.description.half_extents, 3); },
          "Of a box, shape (3,) [m].")
      .def_property_readonly(
          "orientation", [](const ObstacleObject& read) { return array_of(read.description.orientation, 4); },
          "Of a box or of a shape of arrays, quaternion, w first, shape (4,).")
      .def_property_readonly(
          "radius", [](const ObstacleObject& read) { return read.description.radius; }, "Of a sphere or a capsule [m].")
      .def_property_readonly(
          "stiffness", [](const ObstacleObject& read) { return read.description.stiffness; },
          "Pressure per depth [N/m^3].")
      .def_property_readonly(
          "damping", [](const ObstacleObject& read) { return read.description.damping; },
          "Pressure per approach velocity [N s/m^3].")
      .def_property_readonly(
          "friction", [](const ObstacleObject& read) { return read.description.friction; }, "Coulomb's coefficient.")
      .def_property_readonly(
          "motion", [](const ObstacleObject& read) { return read.motion; }, "Of its frame, at the body's time.");
}

ObstacleObject read_obstacle(const ObstacleAccess& of, std::int64_t id) {
  return {of.world.obstacle(id), of.world.obstacle_motion(id)};
}

struct Law {
  double stiffness = 0, damping = 0, friction = 0;
  std::uint32_t group = 1, mask = ~0U;
};

std::int64_t add_obstacle(ObstacleAccess to, const SharedShape& shape, const Law& law,
                          const std::optional<exmat_motion>& motion) {
  exmat_obstacle obstacle = shape->description;
  obstacle.stiffness = law.stiffness;
  obstacle.damping = law.damping;
  obstacle.friction = law.friction;
  obstacle.group = law.group;
  obstacle.mask = law.mask;
  const std::int64_t id =
      shape->arrays ? to.world.add_shape(*shape->arrays, obstacle) : to.world.add_obstacle(obstacle);
  to.record.next = id + 1;
  try {
    if (motion) to.world.move_obstacle(id, *motion);
  } catch (...) {
    to.world.remove_obstacle(id);
    throw;
  }
  to.record.hosted[id] = {shape, motion};
  return id;
}

void remove_obstacle(ObstacleAccess from, std::int64_t id) {
  from.world.remove_obstacle(id);
  from.record.hosted.erase(id);
}

void move_obstacle(ObstacleAccess of, std::int64_t id, const exmat_motion& motion) {
  of.world.move_obstacle(id, motion);
  of.record.hosted[id].moved = motion;
}

void set_obstacle_law(ObstacleAccess of, std::int64_t id, std::optional<double> stiffness,
                      std::optional<double> damping, std::optional<double> friction) {
  const exmat_obstacle now = of.world.obstacle(id);
  of.world.set_obstacle_law(id, stiffness.value_or(now.stiffness), damping.value_or(now.damping),
                            friction.value_or(now.friction));
}

py::array_t<std::int64_t> obstacle_ids(const ObstacleAccess& of) {
  const std::vector<std::int64_t> ids = of.world.obstacle_ids();
  return py::array_t<std::int64_t>(static_cast<py::ssize_t>(ids.size()), ids.data());
}

py::array_t<double> obstacle_triangles(const ObstacleAccess& of, std::int64_t id) {
  const std::vector<double> corners = of.world.obstacle_triangles(id);
  return py::array_t<double>({static_cast<py::ssize_t>(corners.size() / 9), py::ssize_t{3}, py::ssize_t{3}},
                             corners.data());
}

py::array_t<exmat_contact> contacts(BodyObject& body) {
  const std::vector<exmat_contact> contacts = body.get().contacts();
  return py::array_t<exmat_contact>(static_cast<py::ssize_t>(contacts.size()), contacts.data());
}

py::tuple contact_load(BodyObject& body, std::optional<std::int64_t> obstacle) {
  Vector3 force, torque;
  body.get().read_contact_load(obstacle.value_or(-1), force.data(), torque.data());
  return py::make_tuple(array_of(force.data(), 3), array_of(torque.data(), 3));
}

// ---- copies

bool is_still(const exmat_motion& motion) {
  const auto is_zero = [](double number) { return number == 0; };
  return std::ranges::all_of(motion.linear_velocity, is_zero) && std::ranges::all_of(motion.angular_velocity, is_zero);
}

/// The numbers that it was given by where it stands still, so that their bits stay; else where it has come to.
py::object kept_motion(const HostedObstacle& hosted, const ObstacleObject& now) {
  if (!hosted.moved) return py::none();
  return motion_tuple(is_still(*hosted.moved) ? *hosted.moved : now.motion);
}

/// Ids up to `id` are given to nobody else.
void skip_obstacles(ObstacleAccess of, std::int64_t id) {
  while (of.record.next < id) {
    const std::int64_t skipped = of.world.add_obstacle(default_obstacle());
    of.world.remove_obstacle(skipped);
    of.record.next = skipped + 1;
  }
}

}  // namespace

py::tuple motion_tuple(const exmat_motion& motion) {
  const auto tuple = [](const auto& numbers) { return py::tuple(py::cast(std::to_array(numbers))); };
  return py::make_tuple(tuple(motion.position), tuple(motion.orientation), tuple(motion.linear_velocity),
                        tuple(motion.angular_velocity));
}

exmat_motion read_motion_tuple(const py::tuple& kept) {
  exmat_motion motion{};
  std::ranges::copy(kept[0].cast<Vector3>(), motion.position);
  std::ranges::copy(kept[1].cast<Quaternion>(), motion.orientation);
  std::ranges::copy(kept[2].cast<Vector3>(), motion.linear_velocity);
  std::ranges::copy(kept[3].cast<Vector3>(), motion.angular_velocity);
  return motion;
}

ObstacleAccess obstacles_of(BodyObject& body) {
  body.get();
  if (body.world) return {body.world->get(), body.world->obstacles};
  return {body.body.world(), body.obstacles};
}

ObstacleAccess own_obstacles_of(BodyObject& body) {
  if (body.world)
    throw Error(EXMAT_INVALID_ARGUMENT, "the body is in a world: its obstacles are added, moved and removed there");
  return obstacles_of(body);
}

py::dict kept_obstacles(const ObstacleAccess& from) {
  py::list kept;
  for (const std::int64_t id : from.world.obstacle_ids()) {
    const ObstacleObject now = read_obstacle(from, id);
    const auto hosted = from.record.hosted.find(id);
    const HostedObstacle known = hosted != from.record.hosted.end() ? hosted->second : HostedObstacle{};
    kept.append(py::make_tuple(id, known.shape, now.description.stiffness, now.description.damping,
                               now.description.friction, now.description.group, now.description.mask,
                               kept_motion(known, now)));
  }
  py::dict result;
  result["obstacles"] = kept;
  result["next"] = from.record.next;
  return result;
}

void set_obstacles(const ObstacleAccess& to, const py::dict& kept) {
  WorldRef world = to.world;
  std::vector<std::int64_t> of_scene = world.obstacle_ids();
  for (const py::handle entry : kept["obstacles"].cast<py::list>()) {
    const auto obstacle = entry.cast<py::tuple>();
    const auto id = obstacle[0].cast<std::int64_t>();
    const auto shape = obstacle[1].cast<SharedShape>();
    const Law law{obstacle[2].cast<double>(), obstacle[3].cast<double>(), obstacle[4].cast<double>(),
                  obstacle[5].cast<std::uint32_t>(), obstacle[6].cast<std::uint32_t>()};
    std::erase(of_scene, id);
    if (shape == nullptr) {
      world.set_obstacle_law(id, law.stiffness, law.damping, law.friction);
      continue;
    }
    skip_obstacles(to, id);
    add_obstacle(to, shape, law, std::nullopt);
  }
  for (const std::int64_t id : of_scene) world.remove_obstacle(id);
  skip_obstacles(to, kept["next"].cast<std::int64_t>());
}

void set_obstacle_motions(const ObstacleAccess& to, const py::dict& kept) {
  for (const py::handle entry : kept["obstacles"].cast<py::list>()) {
    const auto obstacle = entry.cast<py::tuple>();
    if (!obstacle[7].is_none())
      move_obstacle(to, obstacle[0].cast<std::int64_t>(), read_motion_tuple(obstacle[7].cast<py::tuple>()));
  }
}

namespace {

/// Functions of a body alone, of a world and of a batch.
template <typename Class>
void bind_obstacle_functions(Class& type, const char* whose) {
  using Owner = typename Class::type;
  type.def(
          "add_obstacle",
          [](Owner& owner, const SharedShape& shape, double stiffness, double damping, double friction,
             const std::optional<exmat_motion>& motion, std::uint32_t group, std::uint32_t mask) {
            return add_obstacle(own_obstacles_of(owner), shape, {stiffness, damping, friction, group, mask}, motion);
          },
          py::arg("shape").none(false), py::kw_only(), py::arg("stiffness") = 1e6, py::arg("damping") = 0.0,
          py::arg("friction") = 0.0, py::arg("motion") = py::none(), py::arg("group") = 1U, py::arg("mask") = ~0U,
          whose)
      .def(
          "remove_obstacle", [](Owner& owner, std::int64_t id) { remove_obstacle(own_obstacles_of(owner), id); },
          py::arg("id"), "Lets go of what it held by friction.")
      .def(
          "move_obstacle",
          [](Owner& owner, std::int64_t id, const exmat_motion& motion) {
            move_obstacle(own_obstacles_of(owner), id, motion);
          },
          py::arg("id"), py::arg("motion"),
          "Says where its frame is now, and how it moves on from here until it is moved again. What touches is carried "
          "along by the velocities and not by a jump of the pose.")
      .def(
          "set_obstacle_law",
          [](Owner& owner, std::int64_t id, std::optional<double> stiffness, std::optional<double> damping,
             std::optional<double> friction) {
            set_obstacle_law(own_obstacles_of(owner), id, stiffness, damping, friction);
          },
          py::arg("id"), py::kw_only(), py::arg("stiffness") = py::none(), py::arg("damping") = py::none(),
          py::arg("friction") = py::none(), "None leaves a number as it is.")
      .def_property_readonly(
          "obstacles", [](Owner& owner) { return obstacle_ids(obstacles_of(owner)); },
          "Numbers of all obstacles, the scene's and those added, shape (count,), ascending. A copy.")
      .def(
          "obstacle", [](Owner& owner, std::int64_t id) { return read_obstacle(obstacles_of(owner), id); },
          py::arg("id"), "An Obstacle: what it is, its law and where it is now.")
      .def(
          "obstacle_triangles",
          [](Owner& owner, std::int64_t id) { return obstacle_triangles(obstacles_of(owner), id); }, py::arg("id"),
          "Corners of the triangles of a mesh or height field in the obstacle's frame, shape (f, 3, 3) [m]; (0, 3, 3) "
          "of other shapes. A copy.");
}

template <typename Owner>
py::tuple obstacle_load(Owner& owner, std::int64_t id) {
  Vector3 force, torque;
  owner.get().read_obstacle_load(id, force.data(), torque.data());
  return py::make_tuple(array_of(force.data(), 3), array_of(torque.data(), 3));
}

constexpr const char* kAddObstacle =
    "An obstacle that its frame's `motion` places; its number, which no later one gets. Pressure per depth [N/m^3], "
    "pressure per approach velocity [N s/m^3], Coulomb's coefficient; `group` and `mask` as Body.set_group(). The "
    "model has to know of contact: use_contact, or a scene with obstacles.";
constexpr const char* kObstacleLoad =
    "Contacts of all bodies with an obstacle in the last call that stepped, as a constant force and torque on it, "
    "about its frame's origin, shapes (3,) [N] and (3,) [N m].";

}  // namespace

void bind_obstacles(py::module_& module, BodyClass& body, WorldClass& world, BatchClass& batch) {
  PYBIND11_NUMPY_DTYPE(exmat_contact, vertex, obstacle, position, normal, force, depth);
  bind_shape(module);
  bind_obstacle(module);
  bind_obstacle_functions(body, kAddObstacle);
  bind_obstacle_functions(world, kAddObstacle);
  bind_obstacle_functions(batch, kAddObstacle);
  world.def("obstacle_load", &obstacle_load<WorldObject>, py::arg("id"), kObstacleLoad);
  batch.def("obstacle_load", &obstacle_load<BatchObject>, py::arg("id"), kObstacleLoad);
  body.def_property_readonly(
          "contacts", &contacts,
          "Vertices that touched obstacles at the end of the last step, a structured array of shape (count,): vertex, "
          "obstacle, position [m], normal (away from the obstacle), force on the body [N] and depth [m]. A copy.")
      .def("contact_load", &contact_load, py::arg("obstacle") = py::none(),
           "What contacts did in the last call that stepped the body, as a constant force and torque over its steps, "
           "shapes (3,) [N] and (3,) [N m]: on an obstacle, about its frame's origin; None: on the body, of obstacles "
           "and other bodies together, about its centre of mass where it is free.");
}

}  // namespace exmat::python

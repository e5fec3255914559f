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

/// Rows of three, whole numbers that fit.
std::vector<std::int32_t> corners_of(const py::array& triangles) {
  if (triangles.dtype().kind() != 'i' && triangles.dtype().kind() != 'u')
    throw Error(EXMAT_INVALID_ARGUMENT, "triangles: expected whole numbers");
  if (triangles.ndim() != 2) throw Error(EXMAT_INVALID_ARGUMENT, "triangles: expected an array of shape (f, 3)");
  require_shape(triangles, "triangles", {triangles.shape(0), 3});
  const auto numbers = triangles.cast<Ids>();
  std::vector<std::int32_t> corners;
  for (const std::int64_t corner : std::span(numbers.data(), static_cast<std::size_t>(numbers.size())))
    corners.push_back(static_cast<std::int32_t>(std::clamp<std::int64_t>(corner, -1, 2147483647)));
  return corners;
}

SharedShape mesh(const Numbers& vertices, const py::array& triangles, double thickness) {
  if (vertices.ndim() != 2) throw Error(EXMAT_INVALID_ARGUMENT, "vertices: expected an array of shape (v, 3)");
  require_shape(vertices, "vertices", {vertices.shape(0), 3});
  const std::vector<std::int32_t> corners = corners_of(triangles);
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

/// One as it was when it was read.
struct ObstacleObject {
  exmat_obstacle description;
  exmat_motion motion;
};

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

ObstacleObject read_obstacle(BodyObject& body, std::int64_t id) {
  return {body.get().obstacle(id), body.body.obstacle_motion(id)};
}

std::int64_t add_obstacle(BodyObject& body, const SharedShape& shape, double stiffness, double damping, double friction,
                          const std::optional<exmat_motion>& motion) {
  exmat_obstacle obstacle = shape->description;
  obstacle.stiffness = stiffness;
  obstacle.damping = damping;
  obstacle.friction = friction;
  BodyRef& to = body.get();
  const std::int64_t id = shape->arrays ? to.add_shape(*shape->arrays, obstacle) : to.add_obstacle(obstacle);
  body.next_obstacle = id + 1;
  try {
    if (motion) to.move_obstacle(id, *motion);
  } catch (...) {
    to.remove_obstacle(id);
    throw;
  }
  body.obstacles[id] = {shape, motion};
  return id;
}

void remove_obstacle(BodyObject& body, std::int64_t id) {
  body.get().remove_obstacle(id);
  body.obstacles.erase(id);
}

void move_obstacle(BodyObject& body, std::int64_t id, const exmat_motion& motion) {
  body.get().move_obstacle(id, motion);
  body.obstacles[id].moved = motion;
}

void set_obstacle_law(BodyObject& body, std::int64_t id, std::optional<double> stiffness, std::optional<double> damping,
                      std::optional<double> friction) {
  const exmat_obstacle now = body.get().obstacle(id);
  body.body.set_obstacle_law(id, stiffness.value_or(now.stiffness), damping.value_or(now.damping),
                             friction.value_or(now.friction));
}

py::array_t<std::int64_t> obstacle_ids(BodyObject& body) {
  const std::vector<std::int64_t> ids = body.get().obstacle_ids();
  return py::array_t<std::int64_t>(static_cast<py::ssize_t>(ids.size()), ids.data());
}

py::array_t<double> obstacle_triangles(BodyObject& body, std::int64_t id) {
  const std::vector<double> corners = body.get().obstacle_triangles(id);
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
void skip_obstacles(BodyObject& body, std::int64_t id) {
  while (body.next_obstacle < id) {
    const std::int64_t skipped = body.body.add_obstacle(default_obstacle());
    body.body.remove_obstacle(skipped);
    body.next_obstacle = skipped + 1;
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

py::dict kept_obstacles(BodyObject& body) {
  py::list kept;
  for (const std::int64_t id : body.get().obstacle_ids()) {
    const ObstacleObject now = read_obstacle(body, id);
    const auto hosted = body.obstacles.find(id);
    const HostedObstacle known = hosted != body.obstacles.end() ? hosted->second : HostedObstacle{};
    kept.append(py::make_tuple(id, known.shape, now.description.stiffness, now.description.damping,
                               now.description.friction, kept_motion(known, now)));
  }
  py::dict result;
  result["obstacles"] = kept;
  result["next"] = body.next_obstacle;
  return result;
}

void set_obstacles(BodyObject& body, const py::dict& kept) {
  std::vector<std::int64_t> of_scene = body.get().obstacle_ids();
  for (const py::handle entry : kept["obstacles"].cast<py::list>()) {
    const auto obstacle = entry.cast<py::tuple>();
    const auto id = obstacle[0].cast<std::int64_t>();
    const auto shape = obstacle[1].cast<SharedShape>();
    const double law[] = {obstacle[2].cast<double>(), obstacle[3].cast<double>(), obstacle[4].cast<double>()};
    std::erase(of_scene, id);
    if (shape == nullptr) {
      body.body.set_obstacle_law(id, law[0], law[1], law[2]);
      continue;
    }
    skip_obstacles(body, id);
    add_obstacle(body, shape, law[0], law[1], law[2], std::nullopt);
  }
  for (const std::int64_t id : of_scene) body.body.remove_obstacle(id);
  skip_obstacles(body, kept["next"].cast<std::int64_t>());
}

void set_obstacle_motions(BodyObject& body, const py::dict& kept) {
  for (const py::handle entry : kept["obstacles"].cast<py::list>()) {
    const auto obstacle = entry.cast<py::tuple>();
    if (!obstacle[5].is_none())
      move_obstacle(body, obstacle[0].cast<std::int64_t>(), read_motion_tuple(obstacle[5].cast<py::tuple>()));
  }
}

void bind_obstacles(py::module_& module, BodyClass& body) {
  PYBIND11_NUMPY_DTYPE(exmat_contact, vertex, obstacle, position, normal, force, depth);
  bind_shape(module);
  bind_obstacle(module);
  body.def("add_obstacle", &add_obstacle, py::arg("shape"), py::kw_only(), py::arg("stiffness") = 1e6,
           py::arg("damping") = 0.0, py::arg("friction") = 0.0, py::arg("motion") = py::none(),
           "An obstacle of this body alone, which its frame's `motion` places; its number, which no later one gets. "
           "Pressure per depth [N/m^3], pressure per approach velocity [N s/m^3], Coulomb's coefficient. The model has "
           "to know of contact: use_contact, or a scene with obstacles.")
      .def("remove_obstacle", &remove_obstacle, py::arg("id"), "What it held by friction is let go.")
      .def("move_obstacle", &move_obstacle, py::arg("id"), py::arg("motion"),
           "Where its frame is now, and how it moves on from here until it is moved again. What touches is carried "
           "along by the velocities and not by a jump of the pose.")
      .def("set_obstacle_law", &set_obstacle_law, py::arg("id"), py::kw_only(), py::arg("stiffness") = py::none(),
           py::arg("damping") = py::none(), py::arg("friction") = py::none(), "What is None stays.")
      .def_property_readonly(
          "obstacles", &obstacle_ids,
          "Numbers of all obstacles, the scene's and those added, shape (count,), ascending. A copy.")
      .def("obstacle", &read_obstacle, py::arg("id"), "An Obstacle: what it is, its law and where it is now.")
      .def("obstacle_triangles", &obstacle_triangles, py::arg("id"),
           "Corners of the triangles of a mesh or height field in the obstacle's frame, shape (f, 3, 3) [m]; (0, 3, 3) "
           "of other shapes. A copy.")
      .def_property_readonly(
          "contacts", &contacts,
          "Vertices that touched obstacles at the end of the last step, a structured array of shape (count,): vertex, "
          "obstacle, position [m], normal (away from the obstacle), force on the body [N] and depth [m]. A copy.")
      .def("contact_load", &contact_load, py::arg("obstacle") = py::none(),
           "What contacts did in the last call that stepped the body, as a constant force and torque over its steps, "
           "shapes (3,) [N] and (3,) [N m]: on an obstacle, about its frame's origin; None: on the body, of obstacles "
           "and other bodies together, about its centre of mass where it is free.");
}

}  // namespace exmat::python

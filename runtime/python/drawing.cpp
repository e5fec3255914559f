#include <limits>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

// exmat/drawing.h: surfaces, cubature elements, energies, targets, times, load capacity.

namespace exmat::python {
namespace {

const std::vector<const char*> kSurfaces{"auto", "object", "render"};

std::shared_ptr<SurfaceObject> surface_of(const std::shared_ptr<ModelObject>& model, const std::string& kind) {
  return std::make_shared<SurfaceObject>(model, number_of(py::str(kind), "kind", kSurfaces));
}

std::shared_ptr<PointsObject> points_on(const SurfaceObject& surface, const py::object& given, const Numbers& shares) {
  const Ids triangles = whole_numbers(given, "triangles");
  if (triangles.ndim() != 1) throw Error(EXMAT_INVALID_ARGUMENT, "triangles: expected an array of one dimension");
  require_shape(shares, "shares", {triangles.size(), 3});
  return std::make_shared<PointsObject>(Points::on_surface(surface.surface, read_span(triangles), read_span(shares)),
                                        surface.model.shared());
}

py::array_t<float> normals_at(const SurfaceObject& surface,
                              const py::array_t<float, py::array::c_style | py::array::forcecast>& positions) {
  require_shape(positions, "positions", {static_cast<py::ssize_t>(surface.count), 3});
  py::array_t<float> normals({static_cast<py::ssize_t>(surface.count), py::ssize_t{3}});
  surface.surface.read_normals({positions.data(), static_cast<std::size_t>(positions.size())}, span_of(normals));
  return normals;
}

py::array surface_positions(BodyObject& body, const SurfaceObject& surface, const py::object& out) {
  return positions_of(body, surface.surface, surface.count, out);
}

py::array_t<float> energy_density(BodyObject& body, SurfaceObject& surface) {
  py::array_t<float> density(static_cast<py::ssize_t>(surface.count));
  body.get().read_energy_density(surface.surface, span_of(density));
  return density;
}

std::optional<RayHit> cast_ray(BodyObject& body, const SurfaceObject& surface, const Numbers& origin,
                               const Numbers& direction, double within) {
  require_shape(origin, "origin", {3});
  require_shape(direction, "direction", {3});
  const auto hit =
      body.get().cast_ray(surface.surface, read_span(origin).first<3>(), read_span(direction).first<3>(), within);
  return hit;
}

std::optional<RayHit> cast_ray_through(WorldObject& world, const std::vector<std::shared_ptr<SurfaceObject>>& given,
                                       const Numbers& origin, const Numbers& direction, double within) {
  require_shape(origin, "origin", {3});
  require_shape(direction, "direction", {3});
  std::vector<const Surface*> surfaces;
  for (const auto& surface : given) {
    if (!surface) throw Error(EXMAT_INVALID_ARGUMENT, "surfaces: expected surfaces, found None");
    surfaces.push_back(&surface->surface);
  }
  return world.get().cast_ray(surfaces, read_span(origin).first<3>(), read_span(direction).first<3>(), within);
}

py::array_t<double> placement(BodyObject& body) {
  py::array_t<double> rows({3, 4});
  check(exmat_body_read_placement(body.get().get(), rows.mutable_data()));
  return rows;
}

py::array_t<double> target(BodyObject& body, const RegionName& region) {
  py::array_t<double> q(static_cast<py::ssize_t>(body.model->modes));
  body.get().read_target(span_of(q), region_of(body.model->model, region));
  return q;
}

double lost(const CapacityObject& capacity, BodyObject& body, const PointsObject& points, const Numbers& forces) {
  require_shape(forces, "forces", {static_cast<py::ssize_t>(points.count), 3});
  return capacity.capacity.lost(body.get(), points.points, read_span(forces));
}

void set_capacity(BodyObject& body, const CapacityObject* capacity) {
  body.get().set_capacity(capacity == nullptr ? nullptr : &capacity->capacity);
}

py::dict profile(const WorldRef& world) {
  const exmat_profile now = world.profile();
  py::dict seconds;
  for (const auto& [name, member] :
       {std::pair{"weights", &exmat_profile::weights}, std::pair{"target", &exmat_profile::target},
        std::pair{"internal_force", &exmat_profile::internal_force}, std::pair{"solve", &exmat_profile::solve},
        std::pair{"contact", &exmat_profile::contact}, std::pair{"broad_phase", &exmat_profile::broad_phase},
        std::pair{"candidates", &exmat_profile::candidates}, std::pair{"single_bodies", &exmat_profile::single_bodies},
        std::pair{"islands", &exmat_profile::islands}})
    seconds[name] = now.*member;
  return seconds;
}

/// Binds the profile of a body alone, a world or a batch.
template <typename Class>
void bind_profile(Class& type) {
  using Object = typename Class::type;
  type.def(
          "set_profiled", [](Object& object, bool profiled) { own_obstacles_of(object).world.set_profiled(profiled); },
          py::arg("profiled"), "Whether its steps are timed by stages from now on.")
      .def_property_readonly(
          "profile", [](Object& object) { return profile(obstacles_of(object).world); },
          "Seconds that each stage took in the last call that stepped: weights, target, internal_force, solve and "
          "contact of bodies that touch no other, by the threads' clocks; broad_phase, candidates, single_bodies and "
          "islands on the wall clock.");
}

void bind_surface(py::module_& module) {
  py::class_<SurfaceObject, std::shared_ptr<SurfaceObject>>(
      module, "Surface", "Triangles of a model's bodies that are drawn, and their k points; they never change.")
      .def(py::init(&surface_of), py::arg("model").none(false), py::arg("kind") = "auto",
           "`kind`: \"object\", the boundary of the tets, \"render\", the render mesh, or \"auto\": this if the bundle "
           "has one, else that.")
      .def("__len__", [](const SurfaceObject& surface) { return surface.count; })
      .def_property_readonly(
          "model", [](const SurfaceObject& surface) { return surface.model.object(); }, "The model that it is of.")
      .def_property_readonly(
          "kind",
          [](const SurfaceObject& surface) { return kSurfaces[static_cast<std::size_t>(surface.surface.kind())]; },
          "\"object\" or \"render\".")
      .def_property_readonly(
          "triangles",
          [](const SurfaceObject& surface) {
            return array_of(surface.surface.triangles(), {surface.surface.triangles().size() / 3, 3});
          },
          "Three of its points of each triangle, outward: shape (f, 3), int32. A copy, as all below.")
      .def_property_readonly(
          "vertices",
          [](const SurfaceObject& surface) { return array_of(surface.surface.vertices(), {surface.count}); },
          "The vertex of the object that each point is, or is nearest to at rest: shape (k,).")
      .def_property_readonly(
          "rest",
          [](const SurfaceObject& surface) {
            return array_of(surface.surface.rest(), {surface.count, 3});
          },
          "X, its points at rest: shape (k, 3) [m].")
      .def_property_readonly(
          "basis",
          [](const SurfaceObject& surface) {
            const std::size_t modes = surface.model->modes;
            return array_of(surface.surface.basis(modes), {surface.count, 3, modes});
          },
          "U of its points, which are at R (X + U q) + t: shape (k, 3, r), float32 [kg^(-1/2)].")
      .def("normals", &normals_at, py::arg("positions"),
           "Unit normals of its points at positions of shape (k, 3) [m]: float32 of the same shape. Points at one "
           "place, as along the seams of a texture, share theirs unless an edge of more than 60 degrees is there.")
      .def("points", &points_on, py::arg("triangles"), py::arg("shares"),
           "Points on triangles of it, of numbers of shape (k,), at the corners' `shares` of shape (k, 3) and sum 1.");
}

void bind_capacity(py::module_& module) {
  py::class_<CapacityObject, std::shared_ptr<CapacityObject>>(
      module, "Capacity",
      "How much of a force the modes of a model can answer. Factorises a matrix of all degrees of freedom.")
      .def(py::init([](const std::shared_ptr<ModelObject>& model, double spread) {
             const py::gil_scoped_release unlocked;
             return std::make_unique<CapacityObject>(CapacityObject{Capacity(model->model, spread)});
           }),
           py::arg("model").none(false), py::arg("spread") = 0.0,
           "`spread` >= 0 [m]: a force acts on the surface within that distance of its point.")
      .def_property_readonly(
          "time_scale", [](const CapacityObject& capacity) { return capacity.capacity.time_scale(); },
          "The time that work is compared in [s].")
      .def("lost", &lost, py::arg("body"), py::arg("points"), py::arg("forces"),
           "The share in [0, 1] of the work of forces of shape (k, 3) [N], world, that the modes lose.")
      .def(
          "contact_lost",
          [](const CapacityObject& capacity, BodyObject& body) { return capacity.capacity.contact_lost(body.get()); },
          py::arg("body"), "The same of the contact forces at the end of the body's last step.");
}

}  // namespace

void bind_ray_hit(py::module_& module) {
  const auto array = [](const std::array<double, 3>& numbers) { return py::array_t<double>(3, numbers.data()); };
  py::class_<RayHit>(module, "RayHit", "A point of a surface, or of an obstacle, that a ray meets.")
      .def_readonly("triangle", &RayHit::triangle, "Its number in the surface.")
      .def_property_readonly(
          "shares", [array](const RayHit& hit) { return array(hit.shares); },
          "Those of the triangle's corners, shape (3,), sum 1, as Surface.points() takes them.")
      .def_readonly("distance", &RayHit::distance, "[m]")
      .def_property_readonly(
          "normal", [array](const RayHit& hit) { return array(hit.normal); }, "Outward, of length 1: shape (3,).")
      .def_readonly("body", &RayHit::body, "Of World.cast_ray(): the id of the body; else -1.")
      .def_readonly("surface", &RayHit::surface, "Of World.cast_ray(): the place of its surface in the list; else 0.")
      .def_readonly("obstacle", &RayHit::obstacle,
                    "Of World.cast_ray(): the id of the obstacle; else -1. Triangle, body and surface of one are -1.");
}

void bind_drawing(py::module_& module, BodyClass& body, WorldClass& world, BatchClass& batch) {
  bind_surface(module);
  bind_ray_hit(module);
  bind_capacity(module);
  bind_profile(body);
  bind_profile(world);
  bind_profile(batch);
  world.def(
      "cast_ray", &cast_ray_through, py::arg("surfaces"), py::arg("origin"), py::arg("direction"),
      py::arg("within") = std::numeric_limits<double>::infinity(),
      "The first triangle of all bodies, as Body.cast_ray(), or the obstacle that the ray enters before; bodies have "
      "those surfaces of the list that are of their model, others are not seen. Bodies in their modes cost little "
      "where the ray misses the box about all that these reach.");
  body.def("positions", &surface_positions, py::arg("surface"), py::arg("out") = py::none(),
           "Those of the k points of a surface, likewise.")
      .def("energy_density", &energy_density, py::arg("surface"),
           "Elastic energy per volume at rest at the points of a surface, shape (k,), float32 [J/m^3].")
      .def("cast_ray", &cast_ray, py::arg("surface"), py::arg("origin"), py::arg("direction"),
           py::arg("within") = std::numeric_limits<double>::infinity(),
           "The first triangle of a surface, as it is now, that a ray from `origin` [m] along `direction` meets within "
           "so "
           "many metres, from either side, None where it meets nothing.")
      .def_property_readonly("placement", &placement,
                             "The rotation R and the shift t of x = R (X + U q) + t, side by side: shape (3, 4).")
      .def("target", &target, py::arg("region") = py::none(),
           "The target of the last step as far as the modes see it, of the whole body or of a region: shape (r,).")
      .def("set_capacity", &set_capacity, py::arg("capacity").none(true),
           "Reports say from now on how much of the work of applied and of contact forces the modes lose. None: no "
           "longer. Copies have none.");
}

}  // namespace exmat::python

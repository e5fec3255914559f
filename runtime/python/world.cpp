#include <pybind11/stl.h>

#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

using Shared = std::shared_ptr<WorldObject>;

py::ssize_t count(const WorldObject& world) { return static_cast<py::ssize_t>(world.bodies.size()); }
py::ssize_t modes(const WorldObject& world) { return static_cast<py::ssize_t>(world.model->modes); }

Shared make_world(std::shared_ptr<ModelObject> model, std::int64_t count) {
  if (count < 1) throw Error(EXMAT_INVALID_ARGUMENT, "count: expected at least 1");
  std::vector<Body> made;
  {
    const py::gil_scoped_release unlocked;
    for (std::int64_t i = 0; i < count; ++i) made.emplace_back(model->model);
  }
  const ModelHold hold(model);
  BodyList bodies;
  for (Body& body : made) bodies.push_back(std::make_shared<BodyObject>(std::move(body), hold));
  return std::make_shared<WorldObject>(std::move(model), std::move(bodies));
}

void step(WorldObject& world, std::int64_t steps, int threads) {
  step_bodies(world.bodies, world.handles, steps, threads);
}

/// The bodies of a sequence; the list keeps them.
BodyList list_of(const py::sequence& bodies) {
  BodyList list;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    list.push_back(py::object(bodies[i]).cast<std::shared_ptr<BodyObject>>());
  return list;
}

std::vector<exmat_body*> handles_of(const BodyList& bodies) {
  std::vector<exmat_body*> handles;
  for (const auto& body : bodies) handles.push_back(body->get().get());
  return handles;
}

void step_list(const py::sequence& bodies, std::int64_t steps, int threads) {
  const BodyList list = list_of(bodies);
  step_bodies(list, handles_of(list), steps, threads);
}

std::uint64_t hash_of(const py::sequence& bodies) {
  const BodyList list = list_of(bodies);
  const std::vector<exmat_body*> handles = handles_of(list);
  std::uint64_t hash = 0;
  detail::check(exmat_bodies_hash(handles.data(), static_cast<std::int64_t>(handles.size()), &hash));
  return hash;
}

/// Rows of `width` numbers, one of each body, by read(body, span).
template <typename Number, typename Read>
py::array_t<Number> gather(WorldObject& world, const py::object& out, std::vector<py::ssize_t> shape,
                           const Read& read) {
  shape.insert(shape.begin(), count(world));
  auto rows = target_array<Number>(out, shape);
  const std::size_t width = static_cast<std::size_t>(rows.size()) / world.bodies.size();
  Number* row = rows.mutable_data();
  for (const auto& body : world.bodies) {
    read(body->get(), std::span<Number>(row, width));
    row += width;
  }
  return rows;
}

py::array_t<double> displacements(WorldObject& world, const py::object& out) {
  return gather<double>(world, out, {modes(world)},
                        [](BodyRef& body, std::span<double> row) { body.read_displacement(row); });
}

py::array_t<double> velocities(WorldObject& world, const py::object& out) {
  return gather<double>(world, out, {modes(world)},
                        [](BodyRef& body, std::span<double> row) { body.read_velocity(row); });
}

py::array_t<double> weights(WorldObject& world) {
  return gather<double>(world, py::none(), {static_cast<py::ssize_t>(world.model->examples)},
                        [](BodyRef& body, std::span<double> row) { body.read_weights(row); });
}

py::array_t<double> energies(WorldObject& world) {
  return gather<double>(world, py::none(), {3}, [](BodyRef& body, std::span<double> row) {
    const exmat_energies now = body.energies();
    row[0] = now.kinetic;
    row[1] = now.elastic;
    row[2] = now.potential;
  });
}

py::array_t<double> times(WorldObject& world) {
  return gather<double>(world, py::none(), {}, [](BodyRef& body, std::span<double> row) { row[0] = body.time(); });
}

py::array_t<std::uint32_t> status(WorldObject& world) {
  return gather<std::uint32_t>(world, py::none(), {},
                               [](BodyRef& body, std::span<std::uint32_t> row) { row[0] = body.report().status; });
}

py::array_t<float> positions(WorldObject& world, const PointsObject& points, const py::object& out) {
  return gather<float>(world, out, {static_cast<py::ssize_t>(points.count), 3},
                       [&](BodyRef& body, std::span<float> row) { body.read_positions(points.points, row); });
}

void set_reduced(WorldObject& world, const Numbers& q, const Numbers& v) {
  require_shape(q, "q", {count(world), modes(world)});
  require_shape(v, "v", {count(world), modes(world)});
  for (const auto& body : world.bodies) body->get();
  const std::size_t width = world.model->modes;
  for (std::size_t i = 0; i < world.bodies.size(); ++i)
    world.bodies[i]->body.set_reduced(read_span(q).subspan(i * width, width), read_span(v).subspan(i * width, width));
}

/// Of shape (k, 3), the same for all, or (N, k, 3).
void apply_forces(WorldObject& world, const PointsObject& points, const Numbers& forces) {
  const auto k = static_cast<py::ssize_t>(points.count);
  if (forces.ndim() == 2)
    require_shape(forces, "forces", {k, 3});
  else
    require_shape(forces, "forces", {count(world), k, 3});
  const std::size_t step = forces.ndim() == 2 ? 0 : 3 * points.count;
  for (std::size_t i = 0; i < world.bodies.size(); ++i)
    world.bodies[i]->get().apply_forces(points.points, read_span(forces).subspan(i * step, 3 * points.count));
}

void take_stiffness(WorldObject& world, const Numbers& kappa) {
  if (kappa.ndim() > 0) require_shape(kappa, "kappa", {count(world)});
  for (std::size_t i = 0; i < world.bodies.size(); ++i)
    set_factor(*world.bodies[i], ExampleFactor::kStiffness, kappa.data()[kappa.ndim() > 0 ? i : 0], -1);
}

void take_weights(WorldObject& world, const py::object& given) {
  if (given.is_none()) {
    for (const auto& body : world.bodies) set_weights(*body, {}, -1);
    return;
  }
  const auto rows = given.cast<Numbers>();
  const auto width = static_cast<py::ssize_t>(world.model->examples);
  if (rows.ndim() == 1)
    require_shape(rows, "weights", {width});
  else
    require_shape(rows, "weights", {count(world), width});
  for (std::size_t i = 0; i < world.bodies.size(); ++i) {
    const double* row = rows.data() + (rows.ndim() == 1 ? 0 : static_cast<py::ssize_t>(i) * width);
    set_weights(*world.bodies[i], {row, row + width}, -1);
  }
}

std::vector<StateObject> states(WorldObject& world) {
  std::vector<StateObject> result;
  for (const auto& body : world.bodies) result.push_back(state_of(*body));
  return result;
}

void set_states(WorldObject& world, const std::vector<StateObject>& given) {
  if (given.size() != world.bodies.size()) throw Error(EXMAT_INVALID_ARGUMENT, "states: expected one for each body");
  for (std::size_t i = 0; i < given.size(); ++i) set_state(*world.bodies[i], given[i]);
}

std::shared_ptr<BodyObject> body_at(WorldObject& world, py::ssize_t index) {
  if (index < 0) index += count(world);
  if (index < 0 || index >= count(world)) throw py::index_error("there is no such body");
  return world.bodies[static_cast<std::size_t>(index)];
}

Shared restored(const py::tuple& kept) {
  return std::make_shared<WorldObject>(kept[0].cast<std::shared_ptr<ModelObject>>(), kept[1].cast<BodyList>());
}

}  // namespace

void bind_world(py::module_& module) {
  py::class_<WorldObject, Shared>(
      module, "World",
      "N bodies of one model, stepped together: arrays have N as their first dimension. No body touches another. "
      "Results do not depend on the number of threads.")
      .def(py::init(&make_world), py::arg("model"), py::arg("count"), "`count` = N >= 1 bodies, each at its start.")
      .def_property_readonly(
          "model", [](const WorldObject& world) { return world.model.object(); }, "The model that they are of.")
      .def("__len__", &count)
      .def("__getitem__", &body_at, py::arg("index"), "The Body of this index itself.")
      .def(
          "step", &step, py::arg("n") = 1, py::arg("threads") = 0,
          "Takes `n` steps of each body by up to `threads` threads, 0: one for each processor. Raises NonFinite, which "
          "names the first such body; the others have taken all their steps.")
      .def_property_readonly(
          "q", [](WorldObject& world) { return displacements(world, py::none()); },
          "Reduced displacements, shape (N, r) [kg^(1/2) m]. A copy.")
      .def_property_readonly(
          "v", [](WorldObject& world) { return velocities(world, py::none()); },
          "Reduced velocities, shape (N, r) [kg^(1/2) m/s]. A copy.")
      .def("displacements", &displacements, py::arg("out") = py::none(), "As q, into `out` (N, r) float64.")
      .def("velocities", &velocities, py::arg("out") = py::none(), "As v, into `out` (N, r) float64.")
      .def_property_readonly("weights", &weights, "Weights of the examples, shape (N, K). A copy.")
      .def_property_readonly("energies", &energies, "Kinetic, elastic and potential, shape (N, 3) [J]. A copy.")
      .def_property_readonly("time", &times, "Shape (N,) [s]. A copy.")
      .def_property_readonly("status", &status, "Bits of Report.status of the last call, shape (N,), uint32. A copy.")
      .def("positions", &positions, py::arg("points"), py::arg("out") = py::none(),
           "World positions of k points, shape (N, k, 3), float32 [m], into `out` or a new array.")
      .def("set_reduced", &set_reduced, py::arg("q"), py::arg("v"),
           "Each body as Body.set_reduced(), by the rows of `q` and `v`, shapes (N, r).")
      .def(
          "reset",
          [](WorldObject& world) {
            for (const auto& body : world.bodies) body->get().reset();
          },
          "All back to their start at time 0.")
      .def("apply_forces", &apply_forces, py::arg("points"), py::arg("forces"),
           "Forces [N] on k points as Body.apply_forces(): of shape (N, k, 3), or (k, 3) for all alike.")
      .def(
          "clear_forces",
          [](WorldObject& world) {
            for (const auto& body : world.bodies) body->get().clear_forces();
          },
          "Ends all applied forces.")
      .def("set_example_stiffness", &take_stiffness, py::arg("kappa"),
           "kappa [1/s^2] of each body, shape (N,), or one for all.")
      .def("set_example_weights", &take_weights, py::arg("weights"),
           "Weights as Body.set_example_weights(), shape (N, K), or (K,) for all; None: those of the poses again.")
      .def_property("states", &states, &set_states, "The State of each body, a list of N copies; likewise to be set.")
      .def(py::pickle([](const WorldObject& world) { return py::make_tuple(world.model.object(), world.bodies); },
                      &restored));
  module.def(
      "step", &step_list, py::arg("bodies"), py::arg("n") = 1, py::arg("threads") = 0,
      "Takes `n` steps of each of some different bodies, of any models, by up to `threads` threads, 0: one for each "
      "processor. Raises as World.step().");
  module.def(
      "state_hash", &hash_of, py::arg("bodies"),
      "Hash over the bits of the states of some bodies, in order: as a hexadecimal number of 16 digits it is the state "
      "hash that `exmat-runtime run` prints.");
}

}  // namespace exmat::python

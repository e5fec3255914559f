#include <pybind11/stl.h>

#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

using Shared = std::shared_ptr<BatchObject>;

py::ssize_t count(const BatchObject& batch) { return static_cast<py::ssize_t>(batch.bodies.size()); }
py::ssize_t modes(const BatchObject& batch) { return static_cast<py::ssize_t>(batch.model->modes); }

BodyObject& body_of(BatchObject& batch, std::size_t index) {
  return *batch.bodies.at(static_cast<std::int64_t>(index));
}

/// Rows of `width` numbers, one of each body, by read(body, span).
template <typename Number, typename Read>
py::array_t<Number> gather(BatchObject& batch, const py::object& out, std::vector<py::ssize_t> shape,
                           const Read& read) {
  shape.insert(shape.begin(), count(batch));
  auto rows = target_array<Number>(out, shape);
  const std::size_t width = static_cast<std::size_t>(rows.size()) / batch.bodies.size();
  Number* row = rows.mutable_data();
  for (const auto& [id, body] : batch.bodies) {
    read(body->get(), std::span<Number>(row, width));
    row += width;
  }
  return rows;
}

py::array_t<double> displacements(BatchObject& batch, const py::object& out) {
  return gather<double>(batch, out, {modes(batch)},
                        [](BodyRef& body, std::span<double> row) { body.read_displacement(row); });
}

py::array_t<double> velocities(BatchObject& batch, const py::object& out) {
  return gather<double>(batch, out, {modes(batch)},
                        [](BodyRef& body, std::span<double> row) { body.read_velocity(row); });
}

py::array_t<double> weights(BatchObject& batch) {
  return gather<double>(batch, py::none(), {static_cast<py::ssize_t>(batch.model->examples)},
                        [](BodyRef& body, std::span<double> row) { body.read_weights(row); });
}

py::array_t<double> energies(BatchObject& batch) {
  return gather<double>(batch, py::none(), {3}, [](BodyRef& body, std::span<double> row) {
    const exmat_energies now = body.energies();
    row[0] = now.kinetic;
    row[1] = now.elastic;
    row[2] = now.potential;
  });
}

py::array_t<std::uint32_t> status(BatchObject& batch) {
  return gather<std::uint32_t>(batch, py::none(), {},
                               [](BodyRef& body, std::span<std::uint32_t> row) { row[0] = body.report().status; });
}

py::array positions(BatchObject& batch, const PointsObject& points, const py::object& out) {
  return in_precision_of(out, [&](auto number) {
    using Number = decltype(number);
    return gather<Number>(batch, out, {static_cast<py::ssize_t>(points.count), 3},
                          [&](BodyRef& body, std::span<Number> row) { body.read_positions(points.points, row); });
  });
}

void set_reduced(BatchObject& batch, const Numbers& q, const Numbers& v) {
  require_shape(q, "q", {count(batch), modes(batch)});
  require_shape(v, "v", {count(batch), modes(batch)});
  reset_world(batch);
  const std::size_t width = batch.model->modes;
  for (std::size_t i = 0; i < batch.bodies.size(); ++i)
    body_of(batch, i).body.set_reduced(read_span(q).subspan(i * width, width), read_span(v).subspan(i * width, width));
}

/// Applies forces of shape (k, 3), the same for all, or (N, k, 3).
void apply_forces(BatchObject& batch, const PointsObject& points, const Numbers& forces) {
  const auto k = static_cast<py::ssize_t>(points.count);
  if (forces.ndim() == 2)
    require_shape(forces, "forces", {k, 3});
  else
    require_shape(forces, "forces", {count(batch), k, 3});
  const std::size_t step = forces.ndim() == 2 ? 0 : 3 * points.count;
  for (std::size_t i = 0; i < batch.bodies.size(); ++i)
    body_of(batch, i).get().apply_forces(points.points, read_span(forces).subspan(i * step, 3 * points.count));
}

void take_stiffness(BatchObject& batch, const Numbers& kappa) {
  if (kappa.ndim() > 0) require_shape(kappa, "kappa", {count(batch)});
  for (std::size_t i = 0; i < batch.bodies.size(); ++i)
    set_factor(body_of(batch, i), ExampleFactor::kStiffness, kappa.data()[kappa.ndim() > 0 ? i : 0], -1);
}

void take_weights(BatchObject& batch, const std::optional<Numbers>& given) {
  if (!given) {
    for (const auto& [id, body] : batch.bodies) set_weights(*body, {}, -1);
    return;
  }
  const Numbers& rows = *given;
  const auto width = static_cast<py::ssize_t>(batch.model->examples);
  if (rows.ndim() == 1)
    require_shape(rows, "weights", {width});
  else
    require_shape(rows, "weights", {count(batch), width});
  for (std::size_t i = 0; i < batch.bodies.size(); ++i) {
    const double* row = rows.data() + (rows.ndim() == 1 ? 0 : static_cast<py::ssize_t>(i) * width);
    set_weights(body_of(batch, i), {row, row + width}, -1);
  }
}

std::shared_ptr<BodyObject> body_at(BatchObject& batch, py::ssize_t index) {
  if (index < 0) index += count(batch);
  if (index < 0 || index >= count(batch)) throw py::index_error("there is no such body");
  return batch.bodies.at(index);
}

py::tuple kept(BatchObject& batch) { return py::make_tuple(batch.model.object(), count(batch), kept_world(batch)); }

Shared restored(const py::tuple& from) {
  auto batch =
      std::make_shared<BatchObject>(from[0].cast<std::shared_ptr<ModelObject>>(), from[1].cast<std::int64_t>());
  restore_world(*batch, from[2].cast<py::dict>());
  return batch;
}

World apart() {
  exmat_contact_law law = default_contact_law();
  law.apart = 1;
  return World(law);
}

}  // namespace

BatchObject::BatchObject(std::shared_ptr<ModelObject> its_model, std::int64_t count)
    : WorldObject(apart()), model(std::move(its_model)) {
  constexpr std::int64_t kMost = 1000000;  // as a scene's instances
  if (count < 1 || count > kMost) throw Error(EXMAT_INVALID_ARGUMENT, "count: expected 1 to 1000000");
  for (std::int64_t i = 0; i < count; ++i) add_body(*this, std::make_shared<BodyObject>(model));
}

BatchClass bind_batch(py::module_& module) {
  BatchClass type(module, "Batch",
                  "N bodies of one model, stepped together: arrays have N as their first dimension. They touch "
                  "obstacles and not each other. Results do not depend on the number of threads.");
  type.def(py::init([](std::shared_ptr<ModelObject> model, std::int64_t count) {
             return std::make_shared<BatchObject>(std::move(model), count);
           }),
           py::arg("model").none(false), py::arg("count"), "`count` = N >= 1 bodies, each at its start.")
      .def_property_readonly(
          "model", [](const BatchObject& batch) { return batch.model.object(); }, "The model that they are of.")
      .def("__len__", &count)
      .def("__getitem__", &body_at, py::arg("index"), "The Body of this index itself.")
      .def(
          "step", [](BatchObject& batch, std::int64_t steps, int threads) { return step_world(batch, steps, threads); },
          py::arg("n") = 1, py::arg("threads") = 0,
          "Takes `n` steps of each body by up to `threads` threads, 0: one for each processor. Returns a WorldReport. "
          "Raises NonFinite at the first step in which a body meets NaN or infinity: it is then as it was before.")
      .def_property_readonly(
          "q", [](BatchObject& batch) { return displacements(batch, py::none()); },
          "Reduced displacements, shape (N, r) [kg^(1/2) m]. A copy.")
      .def_property_readonly(
          "v", [](BatchObject& batch) { return velocities(batch, py::none()); },
          "Reduced velocities, shape (N, r) [kg^(1/2) m/s]. A copy.")
      .def("displacements", &displacements, py::arg("out") = py::none(), "As q, into `out` (N, r) float64.")
      .def("velocities", &velocities, py::arg("out") = py::none(), "As v, into `out` (N, r) float64.")
      .def_property_readonly("weights", &weights, "Weights of the examples, shape (N, K). A copy.")
      .def_property_readonly("energies", &energies, "Kinetic, elastic and potential, shape (N, 3) [J]. A copy.")
      .def_property_readonly(
          "time", [](BatchObject& batch) { return batch.get().time(); }, "That of all its bodies [s].")
      .def_property_readonly("status", &status, "Bits of Report.status of the last call, shape (N,), uint32. A copy.")
      .def("positions", &positions, py::arg("points"), py::arg("out") = py::none(),
           "World positions of k points, shape (N, k, 3) [m], as Body.positions().")
      .def("set_reduced", &set_reduced, py::arg("q"), py::arg("v"),
           "All back to time 0, each body with its row of `q` and `v`, shapes (N, r).")
      .def(
          "reset", [](BatchObject& batch) { reset_world(batch); }, "All back to their start at time 0.")
      .def("apply_forces", &apply_forces, py::arg("points"), py::arg("forces"),
           "Forces [N] on k points as Body.apply_forces(): of shape (N, k, 3), or (k, 3) for all alike.")
      .def(
          "clear_forces",
          [](BatchObject& batch) {
            for (const auto& [id, body] : batch.bodies) body->get().clear_forces();
          },
          "Ends all applied forces.")
      .def("set_example_stiffness", &take_stiffness, py::arg("kappa"),
           "kappa [1/s^2] of each body, shape (N,), or one for all.")
      .def("set_example_weights", &take_weights, py::arg("weights"),
           "Weights as Body.set_example_weights(), shape (N, K), or (K,) for all; None: those of the poses again.")
      .def_property(
          "state", [](BatchObject& batch) { return state_of(batch); },
          [](BatchObject& batch, const WorldStateObject& state) { set_state(batch, state); },
          "The whole WorldState, a copy; likewise to be set.")
      .def(py::pickle(&kept, &restored));
  return type;
}

}  // namespace exmat::python

#include <algorithm>
#include <array>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

using Vector3 = std::array<double, 3>;
using Shared = std::shared_ptr<BodyObject>;

py::array_t<double> array_of(const double* numbers, std::size_t count) {
  return py::array_t<double>(static_cast<py::ssize_t>(count), numbers);
}

// ---- what is read

void bind_report(py::module_& module) {
  py::class_<exmat_report>(module, "Report", "What the steps of one call did: sums, unless said otherwise.")
      .def_readonly("steps", &exmat_report::steps, "Steps taken.")
      .def_readonly("status", &exmat_report::status,
                    "Bits of all steps: 1 non-finite, 2 iteration limit, 4 stagnated, 8 target not converged, 16 "
                    "subnormal numbers set to zero and 32 asleep, which are no faults.")
      .def_readonly("newton_iterations", &exmat_report::newton_iterations, "Newton iterations.")
      .def_readonly("factorisations", &exmat_report::factorisations, "Factorisations of the Hessian.")
      .def_readonly("line_search_evaluations", &exmat_report::line_search_evaluations, "Of line searches.")
      .def_readonly("projections", &exmat_report::projections, "Hessians that were made positive definite.")
      .def_readonly("target_iterations", &exmat_report::target_iterations, "Newton iterations towards targets.")
      .def_readonly("residual", &exmat_report::residual,
                    "Of the equation of motion at the end of the last step [kg^(1/2) m/s^2].")
      .def_readonly("seconds", &exmat_report::seconds, "Wall clock [s].")
      .def("__repr__", [](const exmat_report& report) {
        return py::str("Report(steps={}, status={}, newton_iterations={}, residual={:.3g}, seconds={:.3g})")
            .format(report.steps, report.status, report.newton_iterations, report.residual, report.seconds);
      });
}

void bind_energies(py::module_& module) {
  py::class_<exmat_energies>(module, "Energies", "Of the last step [J].")
      .def_readonly("kinetic", &exmat_energies::kinetic, "Of the body in the world [J].")
      .def_readonly("elastic", &exmat_energies::elastic, "[J].")
      .def_readonly("potential", &exmat_energies::potential, "Of gravity, 0 at rest [J].")
      .def_property_readonly(
          "total", [](const exmat_energies& now) { return now.kinetic + now.elastic + now.potential; },
          "Their sum [J].")
      .def("__repr__", [](const exmat_energies& now) {
        return py::str("Energies(kinetic={:.6g}, elastic={:.6g}, potential={:.6g})")
            .format(now.kinetic, now.elastic, now.potential);
      });
}

exmat_motion make_motion(const Vector3& position, const std::array<double, 4>& orientation, const Vector3& linear,
                         const Vector3& angular) {
  exmat_motion motion{};
  std::ranges::copy(position, motion.position);
  std::ranges::copy(orientation, motion.orientation);
  std::ranges::copy(linear, motion.linear_velocity);
  std::ranges::copy(angular, motion.angular_velocity);
  return motion;
}

void bind_motion(py::module_& module) {
  py::class_<exmat_motion>(module, "Motion", "How a body moves as a whole, world frame. Its arrays are copies.")
      .def(py::init(&make_motion), py::kw_only(), py::arg("position") = Vector3{},
           py::arg("orientation") = std::array<double, 4>{1, 0, 0, 0}, py::arg("linear_velocity") = Vector3{},
           py::arg("angular_velocity") = Vector3{}, "Shapes (3,), (4,), (3,), (3,), as the properties.")
      .def_property_readonly(
          "position", [](const exmat_motion& motion) { return array_of(motion.position, 3); },
          "Displacement of the centre of mass from rest, shape (3,) [m].")
      .def_property_readonly(
          "orientation", [](const exmat_motion& motion) { return array_of(motion.orientation, 4); },
          "Unit quaternion, w first, shape (4,).")
      .def_property_readonly(
          "linear_velocity", [](const exmat_motion& motion) { return array_of(motion.linear_velocity, 3); },
          "Of the centre of mass, shape (3,) [m/s].")
      .def_property_readonly(
          "angular_velocity", [](const exmat_motion& motion) { return array_of(motion.angular_velocity, 3); },
          "Shape (3,) [rad/s].");
}

void bind_state(py::module_& module) {
  py::class_<StateObject, std::shared_ptr<StateObject>>(
      module, "State",
      "All that a body carries from step to step, copied. Bodies of the same bundle and settings take it and go on to "
      "the last bit. It can be pickled and compared.")
      .def_property_readonly(
          "numbers",
          [](const py::object& self) {
            const auto& state = self.cast<const StateObject&>();
            return view(state.numbers.data(), state.numbers.size(), self);
          },
          "The state as numbers, shape (size,): read-only, without a copy.")
      .def_readonly("input_sha256", &StateObject::sha, "Of the bundle that it belongs to.")
      .def(
          "__eq__", [](const StateObject& state, const StateObject& other) { return state == other; },
          py::is_operator())
      .def("__copy__", [](const StateObject& state) { return state; })
      .def(
          "__deepcopy__", [](const StateObject& state, const py::dict&) { return state; }, py::arg("memo"))
      .def(py::pickle(
          [](const StateObject& state) {
            return py::make_tuple(array_of(state.numbers.data(), state.numbers.size()), state.sha);
          },
          [](const py::tuple& kept) {
            const auto numbers = kept[0].cast<Numbers>();
            return StateObject{{numbers.data(), numbers.data() + numbers.size()}, kept[1].cast<std::string>()};
          }))
      .attr("__hash__") = py::none();
}

// ---- what bodies do

exmat_report step(BodyObject& body, std::int64_t steps) {
  body.get();
  exmat_report report;
  report.size = sizeof report;
  body.stepping = true;
  exmat_status status = EXMAT_OK;
  {
    const py::gil_scoped_release unlocked;
    status = exmat_body_step(body.body.get(), steps, &report);
  }
  body.stepping = false;
  detail::check(status);
  return report;
}

void apply_forces(BodyObject& body, const PointsObject& points, const Numbers& forces) {
  require_shape(forces, "forces", {static_cast<py::ssize_t>(points.count), 3});
  body.get().apply_forces(points.points, read_span(forces));
}

py::array_t<float> positions(BodyObject& body, const PointsObject& points, const py::object& out) {
  auto xyz = target_array<float>(out, {static_cast<py::ssize_t>(points.count), 3});
  body.get().read_positions(points.points, span_of(xyz));
  return xyz;
}

/// Of the name of a region, the whole body where it is None.
std::int64_t region_of(const BodyObject& body, const py::object& name) {
  if (name.is_none()) return -1;
  const auto wanted = name.cast<std::string>();
  const Model& model = body.model->model;
  for (std::size_t i = 0; i < model.regions(); ++i)
    if (model.region_name(i) == wanted) return static_cast<std::int64_t>(i);
  throw Error(EXMAT_INVALID_ARGUMENT, ("region: the model has none that is named " + wanted).c_str());
}

py::array_t<double> region_weights(BodyObject& body, const std::string& name) {
  const auto region = static_cast<std::size_t>(region_of(body, py::str(name)));
  py::array_t<double> weights(static_cast<py::ssize_t>(body.model->model.region_examples(region)));
  body.get().read_region_weights(region, span_of(weights));
  return weights;
}

void set_reduced(BodyObject& body, const Numbers& q, const Numbers& v) {
  const auto modes = static_cast<py::ssize_t>(body.model->modes);
  require_shape(q, "q", {modes});
  require_shape(v, "v", {modes});
  body.get().set_reduced(read_span(q), read_span(v));
}

void take_weights(BodyObject& body, const py::object& weights, const py::object& region) {
  std::vector<double> numbers;
  if (!weights.is_none()) numbers = weights.cast<std::vector<double>>();
  if (!weights.is_none() && numbers.empty())
    throw Error(EXMAT_INVALID_ARGUMENT, "weights: expected one for each example");
  set_weights(body, numbers, region_of(body, region));
}

// ---- copies

using KeptFactors = std::map<std::pair<int, std::int64_t>, double>;

py::tuple kept(BodyObject& body) {
  KeptFactors factors;
  for (const auto& [key, number] : body.factors) factors[{static_cast<int>(key.first), key.second}] = number;
  return py::make_tuple(body.model, state_of(body), factors, body.weights, body.gravity);
}

Shared restored(const py::tuple& from) {
  auto body = std::make_shared<BodyObject>(from[0].cast<std::shared_ptr<ModelObject>>());
  for (const auto& [key, number] : from[2].cast<KeptFactors>())
    set_factor(*body, static_cast<ExampleFactor>(key.first), number, key.second);
  for (const auto& [region, weights] : from[3].cast<std::map<std::int64_t, std::vector<double>>>())
    set_weights(*body, weights, region);
  if (const auto gravity = from[4].cast<std::optional<std::array<double, 3>>>()) set_gravity(*body, *gravity);
  set_state(*body, from[1].cast<StateObject>());
  return body;
}

Shared copy(BodyObject& body) { return restored(kept(body)); }

void bind_body_class(py::module_& module) {
  py::class_<BodyObject, Shared>(
      module, "Body",
      "One body of a model: its state and the forces on it. Steps release the interpreter's lock; until they are done, "
      "other threads are refused. copy.copy() and pickle keep the state and what was set for this body alone.")
      .def(py::init([](std::shared_ptr<ModelObject> model) { return std::make_shared<BodyObject>(std::move(model)); }),
           py::arg("model"), "At rest at time 0, or as the model's scene starts it.")
      .def_readonly("model", &BodyObject::model, "The model that it is of.")
      .def("step", &step, py::arg("n") = 1,
           "Takes `n` >= 0 steps. Returns their Report. Raises NonFinite where a step meets NaN or infinity: the body "
           "is "
           "then as it was before that step.")
      .def_property_readonly(
          "q",
          [](const py::object& self) {
            const auto& body = self.cast<BodyObject&>();
            return view(exmat_body_displacement(body.body.get()), body.model->modes, self);
          },
          "Reduced displacement, shape (r,) [kg^(1/2) m]: read-only and without a copy. It changes with the body and "
          "keeps it alive; q.copy() stays.")
      .def_property_readonly(
          "v",
          [](const py::object& self) {
            const auto& body = self.cast<BodyObject&>();
            return view(exmat_body_velocity(body.body.get()), body.model->modes, self);
          },
          "Reduced velocity, shape (r,) [kg^(1/2) m/s]: a view, as q.")
      .def_property_readonly(
          "weights",
          [](const py::object& self) {
            const auto& body = self.cast<BodyObject&>();
            return view(exmat_body_weights(body.body.get()), body.model->examples, self);
          },
          "Weights of the examples in the last step, shape (K,), sum 1: a view, as q.")
      .def("region_weights", &region_weights, py::arg("region"),
           "Those of a region, by its name: shape (K of the region,). A copy.")
      .def("positions", &positions, py::arg("points"), py::arg("out") = py::none(),
           "World positions of k points, shape (k, 3), float32 [m]: into `out`, a contiguous array that is returned, "
           "or a "
           "new one.")
      .def_property_readonly(
          "energies", [](BodyObject& body) { return body.get().energies(); }, "Energies of the last step.")
      .def_property_readonly(
          "report", [](BodyObject& body) { return body.get().report(); },
          "Report of the last call that stepped the body, also where it raised.")
      .def_property_readonly(
          "time", [](const BodyObject& body) { return body.body.time(); }, "[s].")
      .def("set_reduced", &set_reduced, py::arg("q"), py::arg("v"),
           "As reset(), with the displacement `q` and velocity `v`, shapes (r,).")
      .def(
          "reset", [](BodyObject& body) { body.get().reset(); }, "Back to its start at time 0, without applied forces.")
      .def("apply_forces", &apply_forces, py::arg("points"), py::arg("forces"),
           "Adds forces of shape (k, 3) [N], world frame, on the points to those that act in every step from now on.")
      .def(
          "clear_forces", [](BodyObject& body) { body.get().clear_forces(); }, "Ends all applied forces.")
      .def(
          "restart_integrator", [](BodyObject& body) { body.get().restart_integrator(); },
          "After an abrupt change of forces: keeps the impulse exact, at the price of one step of first order.")
      .def_property(
          "motion", [](BodyObject& body) { return body.get().motion(); },
          [](BodyObject& body, const exmat_motion& motion) { body.get().set_motion(motion); },
          "Motion as a whole. To be set of free bodies alone.")
      .def_property(
          "state", [](BodyObject& body) { return state_of(body); }, &set_state,
          "The whole State, a copy; a State of the same bundle and time step to be set.")
      .def("set_gravity", &set_gravity, py::arg("gravity"),
           "Gravity of this body alone, three numbers [m/s^2]; after an abrupt change restart_integrator() keeps the "
           "impulse exact. reset() keeps it.")
      .def(
          "set_example_damping",
          [](BodyObject& body, double c_kappa, const py::object& region) {
            set_factor(body, ExampleFactor::kDamping, c_kappa, region_of(body, region));
          },
          py::arg("c_kappa"), py::arg("region") = py::none(), "c_kappa [1/s], likewise.")
      .def(
          "set_example_bias",
          [](BodyObject& body, double bias, const py::object& region) {
            set_factor(body, ExampleFactor::kBias, bias, region_of(body, region));
          },
          py::arg("bias"), py::arg("region") = py::none(), "Factor in [0, 1] on the weight of the rest pose, likewise.")
      .def(
          "set_example_stiffness",
          [](BodyObject& body, double kappa, const py::object& region) {
            set_factor(body, ExampleFactor::kStiffness, kappa, region_of(body, region));
          },
          py::arg("kappa"), py::arg("region") = py::none(),
          "kappa [1/s^2] of this body alone, of the whole body or of a region by its name. reset() keeps it. The model "
          "has "
          "to have the example force.")
      .def("set_example_weights", &take_weights, py::arg("weights"), py::arg("region") = py::none(),
           "Weights of shape (K,), not negative and of sum 1, in place of those of the pose; the bias does not act on "
           "them. "
           "None: those of the pose again.")
      .def("__copy__", &copy)
      .def(
          "__deepcopy__", [](BodyObject& body, const py::dict&) { return copy(body); }, py::arg("memo"))
      .def(py::pickle(&kept, &restored));
}

}  // namespace

void bind_body(py::module_& module) {
  bind_report(module);
  bind_energies(module);
  bind_motion(module);
  bind_state(module);
  bind_body_class(module);
}

}  // namespace exmat::python

#include <array>
#include <limits>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

using Shared = std::shared_ptr<BodyObject>;

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
  check(status);
  return report;
}

void apply_forces(BodyObject& body, const PointsObject& points, const Numbers& forces) {
  require_shape(forces, "forces", {static_cast<py::ssize_t>(points.count), 3});
  body.get().apply_forces(points.points, read_span(forces));
}

std::int64_t add_forces(BodyObject& body, const PointsObject& points, const Numbers& forces) {
  require_shape(forces, "forces", {static_cast<py::ssize_t>(points.count), 3});
  return body.get().add_forces(points.points, read_span(forces));
}

void set_forces(BodyObject& body, std::int64_t id, const PointsObject& points, const Numbers& forces) {
  require_shape(forces, "forces", {static_cast<py::ssize_t>(points.count), 3});
  body.get().set_forces(id, points.points, read_span(forces));
}

py::tuple compliance(BodyObject& body, const PointsObject& points) {
  const auto size = static_cast<py::ssize_t>(3 * points.count);
  py::array_t<double> velocity({size / 3, py::ssize_t{3}}), matrix({size, size});
  body.get().read_compliance(points.points, span_of(velocity), span_of(matrix));
  return py::make_tuple(velocity, matrix);
}

void apply_impulses(BodyObject& body, const PointsObject& points, const Numbers& impulses) {
  require_shape(impulses, "impulses", {static_cast<py::ssize_t>(points.count), 3});
  body.get().apply_impulses(points.points, read_span(impulses));
}

py::array_t<double> sensitivity(BodyObject& body, const PointsObject& points, const RegionName& region) {
  const std::int64_t own = region_of(body.model->model, region);
  const std::size_t examples =
      own < 0 ? body.model->model.examples() : body.model->model.region_examples(static_cast<std::size_t>(own));
  py::array_t<double> matrix(
      {static_cast<py::ssize_t>(points.count), py::ssize_t{3}, static_cast<py::ssize_t>(examples)});
  body.get().read_sensitivity(points.points, span_of(matrix), own);
  return matrix;
}

/// The numbers of an array of one dimension; none where there is no array.
std::vector<double> row_of(const std::optional<Numbers>& numbers, const char* name) {
  if (!numbers) return {};
  require_shape(*numbers, name, {numbers->size()});
  return {numbers->data(), numbers->data() + numbers->size()};
}

void reach(BodyObject& body, const PointsObject* points, const std::optional<Numbers>& targets,
           const RegionName& region, const std::optional<Numbers>& lowest, const std::optional<Numbers>& highest,
           double change, double horizon) {
  if (points == nullptr && !targets) return body.get().stop_reaching();
  if (points == nullptr || !targets)
    throw Error(EXMAT_INVALID_ARGUMENT, "points, targets: expected both, or neither to stop");
  require_shape(*targets, "targets", {static_cast<py::ssize_t>(points->count), 3});
  const std::vector<double> least = row_of(lowest, "lowest"), most = row_of(highest, "highest");
  if (lowest && highest && least.size() != most.size())
    throw Error(EXMAT_INVALID_ARGUMENT, "lowest, highest: expected as many numbers");
  exmat_reach settings = default_reach();
  settings.region = region_of(body.model->model, region);
  settings.change = change;
  settings.horizon = horizon;
  if (lowest) settings.lowest = least.data();
  if (highest) settings.highest = most.data();
  settings.examples = static_cast<std::int64_t>(std::max(least.size(), most.size()));
  body.get().reach(points->points, read_span(*targets), settings);
}

py::array positions(BodyObject& body, const PointsObject& points, const py::object& out) {
  return positions_of(body, points.points, points.count, out);
}

py::array_t<double> region_weights(BodyObject& body, const std::string& name) {
  const auto region = static_cast<std::size_t>(region_of(body.model->model, name));
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

void take_weights(BodyObject& body, const std::optional<Numbers>& weights, const RegionName& region) {
  const std::vector<double> numbers = row_of(weights, "weights");
  if (weights && numbers.empty()) throw Error(EXMAT_INVALID_ARGUMENT, "weights: expected one for each example");
  set_weights(body, numbers, region_of(body.model->model, region));
}

// ---- copies

/// A body in a world is kept without its attachments, as a copy is in none.
py::tuple kept(BodyObject& body) {
  py::object state = py::cast(state_of(body));
  if (!body.world) state = snapshot_of(body.get().world());
  return py::make_tuple(body.model.object(), state, kept_settings(body), kept_obstacles(obstacles_of(body)));
}

Shared restored(const py::tuple& from) {
  auto body = std::make_shared<BodyObject>(ModelHold(from[0].cast<std::shared_ptr<ModelObject>>()));
  const auto obstacles = from[3].cast<py::dict>();
  set_settings(*body, from[2].cast<py::tuple>());
  set_obstacles(obstacles_of(*body), obstacles);
  if (py::isinstance<py::bytes>(from[1])) {
    set_snapshot(body->get().world(), from[1].cast<py::bytes>());
    return body;
  }
  set_state(*body, from[1].cast<StateObject>());
  set_obstacle_motions(obstacles_of(*body), obstacles);
  return body;
}

Shared copy(BodyObject& body) { return restored(kept(body)); }

// ---- the class

void bind_stepping(BodyClass& type) {
  type.def(py::init([](std::shared_ptr<ModelObject> model) {
             return std::make_shared<BodyObject>(ModelHold(std::move(model)));
           }),
           py::arg("model").none(false), "At rest at time 0, or as the model's scene starts it.")
      .def_property_readonly(
          "model", [](const BodyObject& body) { return body.model.object(); }, "The model that it is of.")
      .def("step", &step, py::arg("n") = 1,
           "Takes `n` >= 0 steps of a body that is in no world. Returns their Report. Raises NonFinite where a step "
           "meets NaN or infinity: the body is then as it was before that step.")
      .def_property_readonly(
          "report", [](BodyObject& body) { return body.get().report(); },
          "Report of the last call that stepped the body, also where it raised.")
      .def_property_readonly(
          "time", [](const BodyObject& body) { return body.body.time(); }, "[s].")
      .def("set_reduced", &set_reduced, py::arg("q"), py::arg("v"),
           "As reset(), with the displacement `q` and velocity `v`, shapes (r,).")
      .def(
          "reset", [](BodyObject& body) { body.get().reset(); },
          "Back to its start at time 0, without applied forces and the attachments that a host has made; those of the "
          "scene hold as at its start.")
      .def_property(
          "motion", [](BodyObject& body) { return body.get().motion(); },
          [](BodyObject& body, const exmat_motion& motion) { body.get().set_motion(motion); },
          "Motion as a whole. To be set of free bodies alone.")
      .def_property(
          "state", [](BodyObject& body) { return state_of(body); },
          [](BodyObject& body, const StateObject& state) { set_state(body, state); },
          "The whole State, a copy; a State of the same bundle and time step to be set.");
}

void bind_readings(BodyClass& type) {
  type.def_property_readonly(
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
           "World positions of k points, shape (k, 3) [m]: into `out`, a contiguous array that is returned, or a new "
           "one. In single precision, or in double where `out` is float64 (not of all_vertices()).")
      .def_property_readonly(
          "energies", [](BodyObject& body) { return body.get().energies(); }, "Energies of the last step.");
}

void bind_actions(BodyClass& type) {
  type.def("apply_forces", &apply_forces, py::arg("points"), py::arg("forces"),
           "Adds forces of shape (k, 3) [N], world frame, on the points to those that act in every step from now on.")
      .def(
          "clear_forces", [](BodyObject& body) { body.get().clear_forces(); }, "Ends all applied forces.")
      .def("add_forces", &add_forces, py::arg("points"), py::arg("forces"),
           "As apply_forces(), with an id, which it returns: these can be changed and removed while all others stay to "
           "the last bit. They end with clear_forces(), reset() and a state that is set, which holds the sum of all.")
      .def("set_forces", &set_forces, py::arg("id"), py::arg("points"), py::arg("forces"),
           "Puts forces of shape (k, 3) [N], world frame, on the points in place of those that had the id.")
      .def(
          "remove_forces", [](BodyObject& body, std::int64_t id) { body.get().remove_forces(id); }, py::arg("id"),
          "Ends the forces of this id: the body then is as if it had never got them.")
      .def(
          "restart_integrator", [](BodyObject& body) { body.get().restart_integrator(); },
          "After an abrupt change of forces: keeps the impulse exact, at the price of one step of first order.");
}

std::span<const double, 12> frame_of(const Numbers& frame) {
  require_shape(frame, "frame", {3, 4});
  return std::span<const double, 12>(read_span(frame).data(), 12);
}

exmat_attachment attachment_of(const std::string& kind, double stiffness, double damping, double break_force) {
  exmat_attachment attachment = default_attachment();
  attachment.kind = number_of(py::str(kind), "kind", {"fixed", "ball", "spring"});
  attachment.stiffness = stiffness;
  attachment.damping = damping;
  attachment.break_force = break_force;
  return attachment;
}

std::int64_t attach(BodyObject& body, const py::object& vertices, const Numbers& frame, const std::string& kind,
                    double stiffness, double damping, double break_force) {
  const Ids ids = whole_numbers(vertices, "vertices");
  return body.get().attach(read_span(ids), frame_of(frame), attachment_of(kind, stiffness, damping, break_force));
}

std::int64_t attach_to(BodyObject& body, const py::object& vertices, BodyObject& other,
                       const py::object& other_vertices, const std::string& kind, double stiffness, double damping,
                       double break_force) {
  const Ids ids = whole_numbers(vertices, "vertices"), other_ids = whole_numbers(other_vertices, "other_vertices");
  return body.get().attach_to(read_span(ids), other.get(), read_span(other_ids),
                              attachment_of(kind, stiffness, damping, break_force));
}

void bind_settings(BodyClass& type) {
  type.def("set_gravity", &set_gravity, py::arg("gravity"),
           "Gravity of this body alone, three numbers [m/s^2]; after an abrupt change restart_integrator() keeps the "
           "impulse exact. reset() keeps it.")
      .def("set_group", &set_group, py::arg("group"), py::arg("mask"),
           "Says whom it touches: bodies and obstacles of which each one's mask has a bit of the other's group. 1 and "
           "all bits at first.")
      .def_property_readonly(
          "group",
          [](BodyObject& body) {
            std::uint32_t group = 0, mask = 0;
            check(exmat_body_read_group(body.get().get(), &group, &mask));
            return py::make_tuple(group, mask);
          },
          "Group and mask.")
      .def(
          "set_damping",
          [](BodyObject& body, double alpha, double beta) {
            set_damping(body, {alpha, beta});
          },
          py::arg("alpha"), py::arg("beta"),
          "Rayleigh damping of this body alone: alpha >= 0 [1/s] of the mass, beta >= 0 [s] of the stiffness.")
      .def(
          "set_integrator",
          [](BodyObject& body, const std::string& integrator) {
            set_integrator(body, number_of(py::str(integrator), "integrator", kIntegrators));
          },
          py::arg("integrator"), "\"bdf2\", \"backward_euler\" or \"newmark\", of this body alone.")
      .def_property(
          "space", [](BodyObject& body) { return kSpaces[static_cast<std::size_t>(body.get().space())]; },
          [](BodyObject& body, const std::string& space) {
            set_space(body, number_of(py::str(space), "space", kSpaces));
          },
          "Space of the last step, \"reduced\" or \"full\"; setting it, to \"reduced\", \"full\" or \"auto\", holds "
          "from the "
          "next step on, for a model of space \"full\" or \"auto\".")
      .def("attach", &attach, py::arg("vertices"), py::arg("frame"), py::arg("kind") = "fixed",
           py::arg("stiffness") = 1e4, py::arg("damping") = 0.0,
           py::arg("break_force") = std::numeric_limits<double>::infinity(),
           "Holds `vertices` of the object by a frame of shape (3, 4), by where they are in it now: \"fixed\", each of "
           "them; \"ball\", their mean by mass; \"spring\", that by a stiffness [N/m] and a damping [N s/m]. Beyond "
           "break_force [N] it lets go. Of a body of space \"reduced\", \"fixed\" holds their mean and the rotation "
           "that "
           "fits them best. Returns its id.")
      .def(
          "attach_to", &attach_to, py::arg("vertices"), py::arg("other"), py::arg("other_vertices"),
          py::arg("kind") = "fixed", py::arg("stiffness") = 1e4, py::arg("damping") = 0.0,
          py::arg("break_force") = std::numeric_limits<double>::infinity(),
          "Attaches `vertices` of the object to `other_vertices` of another body of the same world, from where both "
          "are now: \"fixed\", the two patches go and turn alike; \"ball\", the mean by mass of `vertices` stays where "
          "it is in the other's patch; \"spring\", a stiffness [N/m] and a damping [N s/m] pull it there. Both step in "
          "their modes, and do not touch each other while it holds. Beyond break_force [N] it lets go. Returns its id, "
          "which is this body's.")
      .def("compliance", &compliance, py::arg("points"),
           "Velocities of k points at the end of the last step, of shape (k, 3) [m/s], and what impulses on their "
           "coordinates make of them in a step, of shape (3k, 3k) [1/kg].")
      .def("apply_impulses", &apply_impulses, py::arg("points"), py::arg("impulses"),
           "Gives k points impulses [N s] of shape (k, 3): velocities change by the compliance times these, and the "
           "body moves on by that times the time step.")
      .def("reach", &reach, py::arg("points") = py::none(), py::arg("targets") = py::none(), py::kw_only(),
           py::arg("region") = py::none(), py::arg("lowest") = py::none(), py::arg("highest") = py::none(),
           py::arg("change") = 0.05, py::arg("horizon") = 0.5,
           "Examples as muscles: from the next step on their weights are chosen so that k points come as near to "
           "`targets`, world, of shape (k, 3) [m], as they can, the sum of squared distances being least. `lowest` and "
           "`highest`: limits of the weights, one for each example. `change`: most that a weight changes in a step. "
           "`horizon` [s]: how far ahead the body is looked at; of the order of its slowest period. Without arguments "
           "the weights stay as they are; set_example_weights(None) gives them back to the pose.")
      .def("sensitivity", &sensitivity, py::arg("points"), py::arg("region") = py::none(),
           "Displacement of k points at the end of the next step by weight that goes from the rest pose to each "
           "example, of shape (k, 3, K) [m]; of a body that steps in its modes.")
      .def(
          "move_attachment",
          [](BodyObject& body, std::int64_t id, const Numbers& frame) {
            body.get().move_attachment(id, frame_of(frame));
          },
          py::arg("id"), py::arg("frame"), "Where its frame is at the end of the next step: shape (3, 4).")
      .def(
          "detach", [](BodyObject& body, std::int64_t id) { body.get().detach(id); }, py::arg("id"), "Lets it go.")
      .def(
          "attachment_load",
          [](BodyObject& body, std::int64_t id) {
            const AttachmentLoad load = body.get().attachment_load(id);
            return py::make_tuple(array_of(load.force.data(), 3), array_of(load.torque.data(), 3), load.broken);
          },
          py::arg("id"),
          "What the body exerts on the frame in the last step: force [N], torque about its origin [N m], and whether "
          "it "
          "broke.")
      .def(
          "set_bones",
          [](BodyObject& body, const Numbers& transforms, bool teleport) {
            require_shape(transforms, "transforms", {static_cast<py::ssize_t>(body.model->model.bones()), 3, 4});
            body.get().set_bones(read_span(transforms), teleport);
          },
          py::arg("transforms"), py::arg("teleport") = false,
          "Where the bones are at the end of the next step, and of those after it until the next call: shape (b, 3, "
          "4), "
          "as Model.bound_bones. teleport: the body is there at once, without a motion that led there; so is the first "
          "call's.")
      .def_property_readonly(
          "bones",
          [](BodyObject& body) {
            const std::size_t bones = body.model->model.bones();
            return array_of(bones > 0 ? body.get().bones(bones) : std::vector<double>(), {bones, 3, 4});
          },
          "The bones at the end of the last step: shape (b, 3, 4), none of a body without a skeleton. A copy.")
      .def(
          "set_example_damping",
          [](BodyObject& body, double c_kappa, const RegionName& region) {
            set_factor(body, ExampleFactor::kDamping, c_kappa, region_of(body.model->model, region));
          },
          py::arg("c_kappa"), py::arg("region") = py::none(), "c_kappa [1/s], likewise.")
      .def(
          "set_example_bias",
          [](BodyObject& body, double bias, const RegionName& region) {
            set_factor(body, ExampleFactor::kBias, bias, region_of(body.model->model, region));
          },
          py::arg("bias"), py::arg("region") = py::none(), "Factor in [0, 1] on the weight of the rest pose, likewise.")
      .def(
          "set_example_stiffness",
          [](BodyObject& body, double kappa, const RegionName& region) {
            set_factor(body, ExampleFactor::kStiffness, kappa, region_of(body.model->model, region));
          },
          py::arg("kappa"), py::arg("region") = py::none(),
          "kappa [1/s^2] of this body alone, of the whole body or of a region by its name. reset() keeps it. The model "
          "has to have the example force.")
      .def("set_example_weights", &take_weights, py::arg("weights"), py::arg("region") = py::none(),
           "Weights of shape (K,), not negative and of sum 1, in place of those of the pose; the bias does not act on "
           "them. None: those of the pose again.");
}

void bind_copies(BodyClass& type) {
  type.def("__copy__", &copy)
      .def(
          "__deepcopy__", [](BodyObject& body, const py::dict&) { return copy(body); }, py::arg("memo"))
      .def(py::pickle(&kept, &restored));
}

}  // namespace

BodyClass bind_body(py::module_& module) {
  BodyClass type(module, "Body",
                 "One body of a model: its state and the forces on it. Steps release the interpreter's lock; until "
                 "they are done, other threads are refused. copy.copy() and pickle keep the state and what was set for "
                 "this body alone; the copy is in no world.");
  bind_stepping(type);
  bind_readings(type);
  bind_actions(type);
  bind_settings(type);
  bind_copies(type);
  return type;
}

}  // namespace exmat::python

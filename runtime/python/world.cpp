#include <algorithm>
#include <cstring>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

// Worlds: world.hpp for Python.

namespace exmat::python {
namespace {

using SharedBody = std::shared_ptr<BodyObject>;

using Shared = std::shared_ptr<WorldObject>;

template <typename Make>
Shared made(const Make& make) {
  const py::gil_scoped_release unlocked;
  return std::make_shared<WorldObject>(make());
}

Shared empty_world(double stiffness, double damping, double friction, bool self_contact) {
  exmat_contact_law law = default_contact_law();
  law.stiffness = stiffness;
  law.damping = damping;
  law.friction = friction;
  law.self = self_contact ? 1 : 0;
  return made([&] { return World(law); });
}

Shared of_scene(const std::string& path) {
  return made([&] { return World::from_scene(path); });
}

Shared of_text(const std::string& scene, const std::string& path) {
  return made([&] { return World::from_text(scene, path); });
}

std::uint64_t hash_of(const BodyList& bodies) {
  std::vector<exmat_body*> handles;
  for (const auto& body : bodies) {
    if (!body) throw Error(EXMAT_INVALID_ARGUMENT, "bodies: expected bodies, found None");
    handles.push_back(body->get().get());
  }
  std::uint64_t hash = 0;
  check(exmat_bodies_hash(handles.data(), static_cast<std::int64_t>(handles.size()), &hash));
  return hash;
}

// ---- bodies

std::shared_ptr<ModelObject> model_of_kind(WorldObject& world, std::int64_t kind) {
  for (const std::int64_t id : world.get().ids())
    if (world.hold->world.kind(id) == kind) return std::make_shared<ModelObject>(world.hold->world.body(id).model());
  throw Error(EXMAT_INVALID_ARGUMENT, "kind: the world has no such body");
}

std::int64_t kinds(WorldObject& world) {
  std::int64_t last = -1;
  for (const std::int64_t id : world.get().ids()) last = std::max(last, world.hold->world.kind(id));
  return last + 1;
}

/// Makes the Python bodies of a scene's world, whose models by kind are given.
void take_models(WorldObject& world, const std::vector<std::shared_ptr<ModelObject>>& models) {
  for (const std::int64_t id : world.get().ids()) {
    const auto kind = static_cast<std::size_t>(world.hold->world.kind(id));
    world.bodies[id] = std::make_shared<BodyObject>(world.hold->world.body(id), ModelHold(models.at(kind)), world.hold);
    world.next_id = id + 1;
  }
}

SharedBody body_at(WorldObject& world, std::int64_t id) {
  const auto found = world.bodies.find(id);
  if (found == world.bodies.end()) throw py::key_error("the world has no body " + std::to_string(id));
  return found->second;
}

SharedBody remove(WorldObject& world, std::int64_t id) {
  World& from = world.get();
  SharedBody body = body_at(world, id);
  body->get();
  body->own.reset(from.remove(id).release());
  body->world = nullptr;
  body->obstacles = {{}, exmat_world_obstacles(body->body.world().get())};
  world.bodies.erase(id);
  return body;
}

py::array_t<std::int64_t> ids(const WorldObject& world) {
  py::array_t<std::int64_t> ids(static_cast<py::ssize_t>(world.bodies.size()));
  std::ranges::transform(world.bodies, ids.mutable_data(), [](const auto& member) { return member.first; });
  return ids;
}

// ---- steps, and what is read

template <typename Struct>
py::array_t<Struct> structured(const std::vector<Struct>& list) {
  return py::array_t<Struct>(static_cast<py::ssize_t>(list.size()), list.data());
}

void set_law(WorldObject& world, std::optional<double> stiffness, std::optional<double> damping,
             std::optional<double> friction, std::optional<double> release) {
  exmat_contact_law law = world.get().contact_law();
  law.stiffness = stiffness.value_or(law.stiffness);
  law.damping = damping.value_or(law.damping);
  law.friction = friction.value_or(law.friction);
  law.release = release.value_or(law.release);
  world.hold->world.set_contact_law(law);
}

void bind_world_state(py::module_& module) {
  py::class_<WorldStateObject>(
      module, "WorldState",
      "All that the bodies of a world carry from step to step and what their contacts remember, copied. A world of as "
      "many such bodies takes it and goes on to the last bit. It can be pickled and compared.")
      .def_property_readonly(
          "numbers",
          [](const py::object& self) {
            const auto& state = self.cast<const WorldStateObject&>();
            return view(state.numbers.data(), state.numbers.size(), self);
          },
          "The state as numbers, shape (size,): read-only, without a copy.")
      .def_readonly("input_sha256", &WorldStateObject::shas, "Of the bundle of each body, in the order of their ids.")
      .def(
          "__eq__", [](const WorldStateObject& state, const WorldStateObject& other) { return state == other; },
          py::is_operator())
      .def("__copy__", [](const WorldStateObject& state) { return state; })
      .def(
          "__deepcopy__", [](const WorldStateObject& state, const py::dict&) { return state; }, py::arg("memo"))
      .def(py::pickle(
          [](const WorldStateObject& state) {
            return py::make_tuple(array_of(state.numbers.data(), state.numbers.size()), state.shas);
          },
          [](const py::tuple& kept) {
            const auto numbers = kept[0].cast<Numbers>();
            return WorldStateObject{{numbers.data(), numbers.data() + numbers.size()},
                                    kept[1].cast<std::vector<std::string>>()};
          }))
      .attr("__hash__") = py::none();
}

// ---- copies

void bind_copies(py::module_& module, WorldClass& type) {
  using ModelClass = py::class_<ModelObject, std::shared_ptr<ModelObject>>;
  py::reinterpret_borrow<ModelClass>(module.attr("Model"))
      .def(py::init(&model_of_kind), py::arg("world"), py::arg("kind"));
  type.def_property_readonly("_kinds", &kinds)
      .def("_take_models", &take_models, py::arg("models"))
      .def("_kept", &kept_world)
      .def("_restore", &restore_world, py::arg("kept"));
}

}  // namespace

std::int64_t add_body(WorldObject& world, const SharedBody& body) {
  World& to = world.get();
  exmat_body* const handle = body->get().get();
  std::int64_t id = -1;
  const exmat_status status = [&] {
    const py::gil_scoped_release unlocked;
    return exmat_world_add_body(to.get(), handle, &id);
  }();
  check(status);
  static_cast<void>(body->own.release());
  body->world = world.hold;
  world.bodies[id] = body;
  world.next_id = id + 1;
  return id;
}

BodyList bodies_of(const WorldObject& world) {
  BodyList list;
  for (const auto& [id, body] : world.bodies) list.push_back(body);
  return list;
}

exmat_world_report step_world(WorldObject& world, std::int64_t steps, int threads) {
  World& stepped = world.get();
  const BodyList bodies = bodies_of(world);
  const Stepping stepping(bodies);
  exmat_world_report report{};
  report.size = sizeof report;
  world.hold->stepping = true;
  const exmat_status status = [&] {
    const py::gil_scoped_release unlocked;
    return exmat_world_step(stepped.get(), steps, threads, &report);
  }();
  world.hold->stepping = false;
  if (status == EXMAT_OK || status == EXMAT_NON_FINITE) world.report = report;
  check(status);
  return report;
}

void reset_world(WorldObject& world) {
  for (const auto& [id, body] : world.bodies) body->get();
  world.get().reset();
}

// ---- states

namespace {

std::vector<std::string> shas_of(const WorldObject& world) {
  std::vector<std::string> shas;
  for (const auto& [id, body] : world.bodies) shas.push_back(body->model->sha);
  return shas;
}

}  // namespace

WorldStateObject state_of(WorldObject& world) { return {world.get().state(), shas_of(world)}; }

void set_state(WorldObject& world, const WorldStateObject& state) {
  for (const auto& [id, body] : world.bodies) body->get();
  if (state.shas != shas_of(world))
    throw Error(EXMAT_INVALID_ARGUMENT,
                "state: it is of bodies of other bundles; take a world of the bodies that it was read with");
  world.get().set_state(state.numbers);
}

namespace {

py::bytes save(WorldObject& world) { return snapshot_of(world.get()); }

void restore(WorldObject& world, const py::bytes& snapshot) {
  for (const auto& [id, body] : world.bodies) body->get();
  set_snapshot(world.get(), snapshot);
}

}  // namespace

// ---- copies

py::dict kept_world(WorldObject& world) {
  const exmat_contact_law law = world.get().contact_law();
  py::list bodies;
  for (const auto& [id, body] : world.bodies) {
    const bool of_scene = world.hold->world.kind(id) >= 0;
    bodies.append(py::make_tuple(id, of_scene ? py::none() : body->model.object(), kept_settings(*body)));
  }
  py::dict result;
  result["law"] = py::make_tuple(law.stiffness, law.damping, law.friction, law.release);
  result["next"] = world.next_id;
  result["bodies"] = bodies;
  result["obstacles"] = kept_obstacles(obstacles_of(world));
  result["snapshot"] = save(world);
  return result;
}

namespace {

/// Ids up to `id` are given to nobody else: a body of this model comes and goes.
void skip_ids(WorldObject& world, std::int64_t id, const ModelHold& model) {
  while (world.next_id < id) {
    const std::int64_t skipped = world.get().add(Body(model->model));
    static_cast<void>(world.get().remove(skipped));
    world.next_id = skipped + 1;
  }
}

void restore_bodies(WorldObject& world, const py::list& kept) {
  std::vector<std::int64_t> gone;
  for (const auto& member : world.bodies) gone.push_back(member.first);
  for (const py::handle entry : kept) {
    const auto body = entry.cast<py::tuple>();
    const auto id = body[0].cast<std::int64_t>();
    if (std::erase(gone, id) == 0) {
      const ModelHold model(body[1].cast<std::shared_ptr<ModelObject>>());
      skip_ids(world, id, model);
      add_body(world, std::make_shared<BodyObject>(model));
    }
    set_settings(*body_at(world, id), body[2].cast<py::tuple>());
  }
  for (const std::int64_t id : gone) remove(world, id);
}

}  // namespace

void restore_world(WorldObject& world, const py::dict& kept) {
  const auto law = kept["law"].cast<py::tuple>();
  const auto bodies = kept["bodies"].cast<py::list>();
  const auto obstacles = kept["obstacles"].cast<py::dict>();
  set_law(world, law[0].cast<double>(), law[1].cast<double>(), law[2].cast<double>(), law[3].cast<double>());
  restore_bodies(world, bodies);
  if (!world.bodies.empty()) skip_ids(world, kept["next"].cast<std::int64_t>(), world.bodies.begin()->second->model);
  set_obstacles(obstacles_of(world), obstacles);
  restore(world, kept["snapshot"].cast<py::bytes>());
}

WorldClass bind_world(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(exmat_body_contact, body, other, vertex, position, normal, force, depth);
  PYBIND11_NUMPY_DTYPE(exmat_touch, body, other, obstacle, change);
  bind_world_state(module);
  WorldClass type(module, "World", "The base of exmat.World.");
  type.def(py::init(&empty_world), py::arg("stiffness"), py::arg("damping"), py::arg("friction"),
           py::arg("self_contact"))
      .def(py::init(&of_scene), py::arg("path"))
      .def(py::init(&of_text), py::arg("scene"), py::arg("path"))
      .def("__len__", [](const WorldObject& world) { return world.bodies.size(); })
      .def(
          "__contains__", [](const WorldObject& world, std::int64_t id) { return world.bodies.contains(id); },
          py::arg("id"))
      .def("__getitem__", &body_at, py::arg("id"), "The Body of this id itself.")
      .def(
          "__iter__", [](const WorldObject& world) { return py::iter(ids(world).attr("tolist")()); },
          "Over the ids, ascending.")
      .def_property_readonly("ids", &ids, "Of all bodies, shape (N,), ascending. A copy.")
      .def_property_readonly("bodies", &bodies_of, "All bodies, in the order of their ids: a list of the Body of each.")
      .def("add", &add_body, py::arg("body").none(false),
           "The body is the world's from now on, as it is and where it is: its id, which no later one gets. What it "
           "overlaps pushes it out. Its functions serve as before, but for those that step it.")
      .def("remove", &remove, py::arg("id"), "Takes a body out and returns it.")
      .def(
          "name",
          [](WorldObject& world, std::int64_t id) {
            body_at(world, id);
            return world.get().name(id);
          },
          py::arg("id"), "Of a body of a scene, with its number where there are several: \"teddy_12\"; else \"\".")
      .def(
          "kind",
          [](WorldObject& world, std::int64_t id) {
            body_at(world, id);
            return world.get().kind(id);
          },
          py::arg("id"), "Of a body of a scene its place among the scene's \"bodies\"; -1 of one that was added.")
      .def_property_readonly(
          "contact_law", [](WorldObject& world) { return world.get().contact_law(); },
          "How bodies touch: a ContactLaw.")
      .def("set_contact_law", &set_law, py::kw_only(), py::arg("stiffness") = py::none(),
           py::arg("damping") = py::none(), py::arg("friction") = py::none(), py::arg("release") = py::none(),
           "What is None stays.")
      .def(
          "set_full_bodies", [](WorldObject& world, int most) { world.get().set_full_bodies(most); }, py::arg("most"),
          "Most bodies of space \"auto\" that step in all vertices at once; at first any number.")
      .def("step", &step_world, py::arg("n") = 1, py::arg("threads") = 0,
           "Takes `n` steps of all bodies by up to `threads` threads, 0: one for each processor; the results do not "
           "depend on their number. Returns a WorldReport. Raises NonFinite, which names the first such body: it and "
           "what touches it are as they were before that step.")
      .def_property_readonly(
          "report", [](WorldObject& world) { return world.get(), world.report; },
          "WorldReport of the last call that stepped, also where it raised.")
      .def_property_readonly(
          "contacts", [](WorldObject& world) { return structured(world.get().contacts()); },
          "Vertices that touched another body, or their own, at the end of the last step, a "
          "structured array of shape (count,): body, other (ids), vertex, position [m], normal "
          "(away from the other), force on the body [N] and depth [m]. A copy.")
      .def_property_readonly(
          "touches", [](WorldObject& world) { return structured(world.get().touches()); },
          "Who touched before the last call that stepped, or after it, a structured array of shape "
          "(count,): body, other (ids; body where it touches itself, -1 of an obstacle), obstacle "
          "(its id, else -1) and change: 0 began, 1 stays, 2 ended. A copy.")
      .def_property_readonly(
          "energies", [](WorldObject& world) { return world.get().energies(); }, "Of all bodies together.")
      .def_property_readonly(
          "state_hash", [](WorldObject& world) { return world.get().hash(); }, "As state_hash(world.bodies).")
      .def("reset", &reset_world,
           "All bodies back to their start at time 0, without applied forces and the attachments that a host has made; "
           "those of the scene hold as at its start.")
      .def_property_readonly(
          "time", [](WorldObject& world) { return world.get().time(); }, "That of all its bodies [s].")
      .def_property(
          "state", [](WorldObject& world) { return state_of(world); },
          [](WorldObject& world, const WorldStateObject& state) { set_state(world, state); },
          "The whole WorldState, a copy; likewise to be set.")
      .def("save", &save, "A snapshot for rollback: all that steps and set... functions change, as bytes.")
      .def("restore", &restore, py::arg("snapshot"),
           "Goes back to a snapshot of save(), of this world or of one made the same way; the next steps then are the "
           "same to the last bit. Of other bodies or obstacles it is refused.");
  module.def("state_hash", &hash_of, py::arg("bodies"),
             "Hash over the bits of the states of some bodies, in order: as a hexadecimal number of 16 digits it is "
             "the state hash that `exmat-runtime run` prints.");
  bind_copies(module, type);
  return type;
}

}  // namespace exmat::python

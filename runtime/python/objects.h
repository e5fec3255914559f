#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <exmat/exmat.hpp>
#include <map>
#include <memory>
#include <optional>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// Structs behind the Python classes. All calls into Python, and all that reads or sets `stepping`, hold the
// interpreter's lock.

namespace exmat::python {

namespace py = pybind11;

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using RegionName = std::optional<std::string>;
using Ids = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;  ///< made by whole_numbers()

/// r modes, K examples of the whole body.
struct ModelObject {
  explicit ModelObject(Model its_model) : model(std::move(its_model)), sha(model.input_sha256()) {}

  Model model;
  std::string sha;
  std::size_t modes = model.modes(), examples = model.examples();
};

/// A model and its Python object, which knows how it is made again.
class ModelHold {
 public:
  explicit ModelHold(std::shared_ptr<ModelObject> model) : model_(std::move(model)), object_(py::cast(model_)) {}

  const ModelObject* operator->() const noexcept { return model_.get(); }
  const std::shared_ptr<ModelObject>& shared() const noexcept { return model_; }
  const py::object& object() const noexcept { return object_; }

 private:
  std::shared_ptr<ModelObject> model_;
  py::object object_;
};

/// k points.
struct PointsObject {
  PointsObject(Points its_points, std::shared_ptr<ModelObject> its_model)
      : points(std::move(its_points)), model(std::move(its_model)) {}

  Points points;
  ModelHold model;
  std::size_t count = points.size();
};

/// Its k points.
struct SurfaceObject {
  SurfaceObject(const std::shared_ptr<ModelObject>& its_model, std::int32_t kind)
      : surface(its_model->model, kind), model(its_model) {}

  Surface surface;
  ModelHold model;
  std::size_t count = surface.points();
};

struct CapacityObject {
  Capacity capacity;
};

struct StateObject {
  std::vector<double> numbers;
  std::string sha;

  bool operator==(const StateObject&) const = default;
};

/// Shape of an obstacle, in its own frame.
struct ShapeObject {
  exmat_obstacle description;   ///< its law is not looked at
  std::optional<Shape> arrays;  ///< present for a mesh or a height field
  py::tuple arguments;          ///< that it was made of
};

/// An obstacle as it was when it was read.
struct ObstacleObject {
  exmat_obstacle description;
  exmat_motion motion;
};

/// One of a world's obstacles that its host added, moved or gave a law.
struct HostedObstacle {
  std::shared_ptr<ShapeObject> shape;  ///< null: the scene's
  std::optional<exmat_motion> moved;   ///< by the last call that moved it
};

/// The obstacles of a world, as copies have to know them.
struct ObstacleRecord {
  std::map<std::int64_t, HostedObstacle> hosted;  ///< by id
  std::int64_t next = 0;                          ///< no id that was given is this or above
};

/// A world and its obstacles; its bodies keep it.
struct WorldHold {
  explicit WorldHold(World its_world)
      : world(std::move(its_world)), obstacles{{}, exmat_world_obstacles(world.get())} {}

  /// Throws where another thread steps it.
  World& get() {
    if (stepping) throw Error(EXMAT_INVALID_ARGUMENT, "another thread steps this world");
    return world;
  }

  World world;
  ObstacleRecord obstacles;
  bool stepping = false;
};

/// A factor of an example force that a body may have of its own.
enum class ExampleFactor { kStiffness, kDamping, kBias };

struct BodyObject {
  explicit BodyObject(const ModelHold& its_model) : BodyObject(Body(its_model->model), its_model) {}
  BodyObject(Body made, ModelHold its_model);
  /// Body of a world, which owns it.
  BodyObject(BodyRef its_body, ModelHold its_model, std::shared_ptr<WorldHold> its_world);

  /// Throws where another thread steps it.
  BodyRef& get() {
    if (stepping) throw Error(EXMAT_INVALID_ARGUMENT, "another thread steps this body");
    return body;
  }

  std::shared_ptr<WorldHold> world;  ///< that it was added to; null: none
  Owner<exmat_body, exmat_body_destroy> own;
  BodyRef body;
  ModelHold model;
  bool stepping = false;
  std::map<std::pair<ExampleFactor, std::int64_t>, double> factors;  ///< that were set, by region
  std::map<std::int64_t, std::vector<double>> weights;               ///< likewise
  std::optional<std::array<double, 3>> gravity;                      ///< likewise
  std::optional<std::array<double, 2>> damping;                      ///< likewise
  std::optional<std::int32_t> integrator, space;                     ///< likewise
  std::optional<std::array<std::uint32_t, 2>> group;                 ///< likewise, and its mask
  ObstacleRecord obstacles;                                          ///< obstacles of a world of its own
};

using BodyList = std::vector<std::shared_ptr<BodyObject>>;

struct WorldStateObject {
  std::vector<double> numbers;
  std::vector<std::string> shas;  ///< hashes of the bodies' bundles

  bool operator==(const WorldStateObject&) const = default;
};

struct WorldObject {
  explicit WorldObject(World its_world) : hold(std::make_shared<WorldHold>(std::move(its_world))) {}

  World& get() { return hold->get(); }

  std::shared_ptr<WorldHold> hold;
  std::map<std::int64_t, std::shared_ptr<BodyObject>> bodies;
  std::int64_t next_id = 0;  ///< no id that was given is this or above
  exmat_world_report report{};
};

/// Bodies of one model that are apart, with ids 0, 1, ...
struct BatchObject : WorldObject {
  BatchObject(std::shared_ptr<ModelObject> its_model, std::int64_t count);

  ModelHold model;
};

/// Marks bodies as being stepped while it lives.
class Stepping {
 public:
  explicit Stepping(const BodyList& bodies) : bodies_(bodies) {
    for (const auto& body : bodies) body->get();
    mark(true);
  }
  ~Stepping() { mark(false); }
  Stepping(const Stepping&) = delete;
  Stepping& operator=(const Stepping&) = delete;

 private:
  void mark(bool stepping) {
    for (const auto& body : bodies_) body->stepping = stepping;
  }
  const BodyList& bodies_;
};

/// Steps all bodies without the interpreter's lock.
exmat_world_report step_world(WorldObject& world, std::int64_t steps, int threads);
/// Back to the start at time 0.
void reset_world(WorldObject& world);
/// The body is the world's from now on.
std::int64_t add_body(WorldObject& world, const std::shared_ptr<BodyObject>& body);
BodyList bodies_of(const WorldObject& world);
WorldStateObject state_of(WorldObject& world);
void set_state(WorldObject& world, const WorldStateObject& state);
/// All that a world carries and what was set, for pickle, and a world made in the same way that takes it.
py::dict kept_world(WorldObject& world);
void restore_world(WorldObject& world, const py::dict& kept);

/// Sets what a body has instead of its model, and remembers it.
void set_factor(BodyObject& body, ExampleFactor factor, double number, std::int64_t region);
void set_gravity(BodyObject& body, const std::array<double, 3>& gravity);
void set_damping(BodyObject& body, const std::array<double, 2>& alpha_and_beta);
void set_integrator(BodyObject& body, std::int32_t integrator);
void set_space(BodyObject& body, std::int32_t space);
void set_group(BodyObject& body, std::uint32_t group, std::uint32_t mask);
void set_weights(BodyObject& body, const std::vector<double>& weights, std::int64_t region);

StateObject state_of(BodyObject& body);
void set_state(BodyObject& body, const StateObject& state);

/// Settings of a body beside its state, for pickle, and a body that takes them.
py::tuple kept_settings(BodyObject& body);
void set_settings(BodyObject& body, const py::tuple& kept);

/// All that steps and a host have changed in a world, and back into one of the same bodies and obstacles.
py::bytes snapshot_of(const WorldRef& world);
void set_snapshot(WorldRef world, const py::bytes& snapshot);

/// The world of a body or of a world object, and its obstacles.
struct ObstacleAccess {
  WorldRef world;
  ObstacleRecord& record;
};
/// To be read; throws where another thread steps it.
ObstacleAccess obstacles_of(BodyObject& body);
inline ObstacleAccess obstacles_of(WorldObject& world) { return {world.get(), world.hold->obstacles}; }
/// To be changed: a body alone has obstacles of its own.
ObstacleAccess own_obstacles_of(BodyObject& body);
inline ObstacleAccess own_obstacles_of(WorldObject& world) { return obstacles_of(world); }

py::dict kept_obstacles(const ObstacleAccess& from);
void set_obstacles(const ObstacleAccess& to, const py::dict& kept);
/// To be called after the state is set, with which obstacles stay where they are.
void set_obstacle_motions(const ObstacleAccess& to, const py::dict& kept);

/// Number of the region of that name; -1, the whole body, where it is None.
std::int64_t region_of(const Model& model, const RegionName& name);

/// A number that is one of `names`.
std::int32_t number_of(const py::handle& value, const char* setting, const std::vector<const char*>& names);
inline const std::vector<const char*> kSpaces{"reduced", "full", "auto"};
inline const std::vector<const char*> kIntegrators{"bdf2", "backward_euler", "newmark"};

exmat_motion read_motion_tuple(const py::tuple& kept);
py::tuple motion_tuple(const exmat_motion& motion);

/// Whole numbers that fit; throws InvalidArgument of Python where `values` are others.
Ids whole_numbers(const py::object& values, const char* name);

/// Throws InvalidArgument of Python unless `array` has this shape.
void require_shape(const py::array& array, const char* name, const std::vector<py::ssize_t>& shape);

/// `out`, which has to be a contiguous array of this shape, or a new one where it is None.
template <typename Number>
py::array_t<Number> target_array(const py::object& out, const std::vector<py::ssize_t>& shape) {
  if (out.is_none()) return py::array_t<Number>(shape);
  if (!py::isinstance<py::array_t<Number, py::array::c_style>>(out))
    throw Error(EXMAT_INVALID_ARGUMENT, sizeof(Number) == sizeof(float) ? "out: expected a contiguous float32 array"
                                                                        : "out: expected a contiguous float64 array");
  auto array = py::reinterpret_borrow<py::array_t<Number>>(out);
  require_shape(array, "out", shape);
  if (!array.writeable()) throw Error(EXMAT_INVALID_ARGUMENT, "out: expected an array that can be written");
  return array;
}

/// An array at `data` that nobody may write; it keeps `owner` alive.
py::array view(const double* data, std::size_t count, const py::object& owner);

/// A copy.
template <typename Number>
py::array_t<Number> array_of(const std::vector<Number>& numbers, const std::vector<std::size_t>& shape) {
  py::array_t<Number> array(std::vector<py::ssize_t>(shape.begin(), shape.end()));
  std::ranges::copy(numbers, array.mutable_data());
  return array;
}
template <typename Number>
py::array_t<Number> array_of(const std::vector<Number>& numbers) {
  return array_of(numbers, {numbers.size()});
}

inline py::array_t<double> array_of(const double* numbers, std::size_t count) {
  return py::array_t<double>(static_cast<py::ssize_t>(count), numbers);
}

template <typename Array>
auto span_of(Array& array) {
  using Number = typename Array::value_type;
  return std::span<Number>(array.mutable_data(), static_cast<std::size_t>(array.size()));
}
template <typename Array>
auto read_span(const Array& array) {
  return std::span<const typename Array::value_type>(array.data(), static_cast<std::size_t>(array.size()));
}

/// Result of read(0.0) where `out` is of doubles, else of read(0.0F).
template <typename Read>
py::array in_precision_of(const py::object& out, const Read& read) {
  return py::isinstance<py::array_t<double>>(out) ? py::array(read(0.0)) : py::array(read(0.0F));
}

/// World positions [k x 3] of the k points of Points or of a Surface: into `out`, of either precision, or a new array.
template <typename Of>
py::array positions_of(BodyObject& body, const Of& points, std::size_t k, const py::object& out) {
  return in_precision_of(out, [&](auto number) {
    auto xyz = target_array<decltype(number)>(out, {static_cast<py::ssize_t>(k), 3});
    body.get().read_positions(points, span_of(xyz));
    return xyz;
  });
}

}  // namespace exmat::python

namespace pybind11::detail {

/// Refuses an object of __new__() alone, which holds nothing yet, before `Caster` makes one of unset memory.
template <typename Object, typename Caster>
struct CheckedCaster : Caster {
  bool load(handle source, bool convert) {
    const auto* made = reinterpret_cast<const instance*>(source.ptr());
    if (!source.is_none() && isinstance<Object>(source) && made->simple_layout && !made->simple_holder_constructed)
      throw type_error("expected an object that its class has made, found one of __new__() alone");
    return Caster::load(source, convert);
  }
};
template <typename Object>
using MadeCaster = CheckedCaster<Object, type_caster_base<Object>>;
template <typename Object>
using SharedCaster = CheckedCaster<Object, copyable_holder_caster<Object, std::shared_ptr<Object>>>;

/// Refuses complex numbers, whose imaginary parts would be lost, and texts, in arrays and lists.
template <>
class type_caster<exmat::python::Numbers> : public pyobject_caster<exmat::python::Numbers> {
 public:
  bool load(handle source, bool convert) {
    if (!convert) return pyobject_caster::load(source, false);  // an array of doubles or none
    const auto given = array::ensure(source);
    return given && std::string_view("biufO").find(given.dtype().kind()) != std::string_view::npos &&
           pyobject_caster::load(given, true);
  }
};

/// Says what it expects where pybind11 lists types of C++.
template <std::size_t kCount>
struct FewNumbersCaster : array_caster<std::array<double, kCount>, double, false, kCount> {
  bool load(handle source, bool convert) {
    if (array_caster<std::array<double, kCount>, double, false, kCount>::load(source, convert)) return true;
    if (!convert) return false;  // another overload may take it
    const std::string found = str(repr(source));
    throw type_error("expected " + std::to_string(kCount) + " numbers, found " + found);
  }
};

// clang-format off
template <> struct type_caster<std::array<double, 3>> : FewNumbersCaster<3> {};
template <> struct type_caster<std::array<double, 4>> : FewNumbersCaster<4> {};
template <> struct type_caster<exmat::python::ModelObject> : MadeCaster<exmat::python::ModelObject> {};
template <> struct type_caster<exmat::python::PointsObject> : MadeCaster<exmat::python::PointsObject> {};
template <> struct type_caster<exmat::python::BodyObject> : MadeCaster<exmat::python::BodyObject> {};
template <> struct type_caster<exmat::python::WorldObject> : MadeCaster<exmat::python::WorldObject> {};
template <> struct type_caster<exmat::python::BatchObject> : MadeCaster<exmat::python::BatchObject> {};
template <> struct type_caster<exmat::python::ShapeObject> : MadeCaster<exmat::python::ShapeObject> {};
template <> struct type_caster<exmat::python::StateObject> : MadeCaster<exmat::python::StateObject> {};
template <> struct type_caster<exmat::python::WorldStateObject> : MadeCaster<exmat::python::WorldStateObject> {};
template <> struct type_caster<exmat::python::SurfaceObject> : MadeCaster<exmat::python::SurfaceObject> {};
template <> struct type_caster<exmat::python::CapacityObject> : MadeCaster<exmat::python::CapacityObject> {};
template <> struct type_caster<exmat::python::ObstacleObject> : MadeCaster<exmat::python::ObstacleObject> {};
template <> struct type_caster<exmat_motion> : MadeCaster<exmat_motion> {};
template <> struct type_caster<exmat_report> : MadeCaster<exmat_report> {};
template <> struct type_caster<exmat_energies> : MadeCaster<exmat_energies> {};
template <> struct type_caster<exmat_world_report> : MadeCaster<exmat_world_report> {};
template <> struct type_caster<exmat_contact_law> : MadeCaster<exmat_contact_law> {};
template <> struct type_caster<std::shared_ptr<exmat::python::ModelObject>> : SharedCaster<exmat::python::ModelObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::PointsObject>> : SharedCaster<exmat::python::PointsObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::BodyObject>> : SharedCaster<exmat::python::BodyObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::WorldObject>> : SharedCaster<exmat::python::WorldObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::BatchObject>> : SharedCaster<exmat::python::BatchObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::ShapeObject>> : SharedCaster<exmat::python::ShapeObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::StateObject>> : SharedCaster<exmat::python::StateObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::WorldStateObject>> : SharedCaster<exmat::python::WorldStateObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::SurfaceObject>> : SharedCaster<exmat::python::SurfaceObject> {};
template <> struct type_caster<std::shared_ptr<exmat::python::CapacityObject>> : SharedCaster<exmat::python::CapacityObject> {};
// clang-format on

}  // namespace pybind11::detail

namespace exmat::python {

using BodyClass = py::class_<BodyObject, std::shared_ptr<BodyObject>>;
using WorldClass = py::class_<WorldObject, std::shared_ptr<WorldObject>>;
using BatchClass = py::class_<BatchObject, std::shared_ptr<BatchObject>>;

void bind_errors();
/// Functions below a module or class say in Python's words what they take where they are given something else.
void speak_in_words(const py::handle& scope);
void bind_model(py::module_& module);
void bind_reports(py::module_& module);
void bind_states(py::module_& module);
BodyClass bind_body(py::module_& module);
WorldClass bind_world(py::module_& module);
BatchClass bind_batch(py::module_& module);
void bind_obstacles(py::module_& module, BodyClass& body, WorldClass& world, BatchClass& batch);
void bind_drawing(py::module_& module, BodyClass& body, WorldClass& world, BatchClass& batch);

}  // namespace exmat::python

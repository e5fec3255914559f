#pragma once

#include <array>
#include <cstdint>
#include <exmat/exmat.hpp>
#include <map>
#include <memory>
#include <optional>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <string>
#include <utility>
#include <vector>

// What the Python classes hold. All calls into Python, and all that reads or sets `stepping`, hold the interpreter's
// lock.

namespace exmat::python {

namespace py = pybind11;

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Ids = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

/// r modes, K examples of the whole body.
struct ModelObject {
  explicit ModelObject(Model its_model) : model(std::move(its_model)), sha(model.input_sha256()) {}

  Model model;
  std::string sha;
  std::size_t modes = model.modes(), examples = model.examples();
};

/// k points.
struct PointsObject {
  Points points;
  std::shared_ptr<ModelObject> model;
  std::size_t count = points.size();
};

struct StateObject {
  std::vector<double> numbers;
  std::string sha;

  bool operator==(const StateObject&) const = default;
};

/// A factor of an example force that a body may have of its own.
enum class ExampleFactor { kStiffness, kDamping, kBias };

struct BodyObject {
  explicit BodyObject(std::shared_ptr<ModelObject> its_model) : body(its_model->model), model(std::move(its_model)) {}

  /// Throws where another thread steps it.
  Body& get() {
    if (stepping) throw Error(EXMAT_INVALID_ARGUMENT, "another thread steps this body");
    return body;
  }

  Body body;
  std::shared_ptr<ModelObject> model;
  bool stepping = false;
  std::map<std::pair<ExampleFactor, std::int64_t>, double> factors;  ///< that were set, by region
  std::map<std::int64_t, std::vector<double>> weights;               ///< likewise
  std::optional<std::array<double, 3>> gravity;                      ///< likewise
};

using BodyList = std::vector<std::shared_ptr<BodyObject>>;

struct WorldObject {
  WorldObject(std::shared_ptr<ModelObject> its_model, BodyList its_bodies);

  std::shared_ptr<ModelObject> model;
  BodyList bodies;
  std::vector<exmat_body*> handles;
};

/// Steps them without the interpreter's lock.
void step_bodies(const BodyList& bodies, const std::vector<exmat_body*>& handles, std::int64_t steps, int threads);

/// Sets what a body has instead of its model, and remembers it.
void set_factor(BodyObject& body, ExampleFactor factor, double number, std::int64_t region);
void set_gravity(BodyObject& body, const std::array<double, 3>& gravity);
void set_weights(BodyObject& body, const std::vector<double>& weights, std::int64_t region);

StateObject state_of(BodyObject& body);
void set_state(BodyObject& body, const StateObject& state);

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

template <typename Array>
auto span_of(Array& array) {
  using Number = typename Array::value_type;
  return std::span<Number>(array.mutable_data(), static_cast<std::size_t>(array.size()));
}
inline std::span<const double> read_span(const Numbers& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

void bind_errors();
void bind_model(py::module_& module);
void bind_body(py::module_& module);
void bind_world(py::module_& module);

}  // namespace exmat::python

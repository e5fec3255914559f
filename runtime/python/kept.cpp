#include <array>
#include <cstring>
#include <pybind11/stl.h>
#include <string_view>
#include <vector>

#include "runtime/python/objects.h"

// States, and what else a body has of its own, as copies and pickles keep it.

namespace exmat::python {
namespace {

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

using KeptFactors = std::map<std::pair<int, std::int64_t>, double>;
using KeptWeights = std::map<std::int64_t, std::vector<double>>;

}  // namespace

py::tuple kept_settings(BodyObject& body) {
  KeptFactors factors;
  for (const auto& [key, number] : body.factors) factors[{static_cast<int>(key.first), key.second}] = number;
  return py::make_tuple(factors, body.weights, body.gravity, body.damping, body.integrator, body.group, body.space);
}

void set_settings(BodyObject& body, const py::tuple& kept) {
  for (const auto& [key, number] : kept[0].cast<KeptFactors>())
    set_factor(body, static_cast<ExampleFactor>(key.first), number, key.second);
  for (const auto& [region, weights] : kept[1].cast<KeptWeights>()) set_weights(body, weights, region);
  if (const auto gravity = kept[2].cast<std::optional<std::array<double, 3>>>()) set_gravity(body, *gravity);
  if (const auto damping = kept[3].cast<std::optional<std::array<double, 2>>>()) set_damping(body, *damping);
  if (const auto integrator = kept[4].cast<std::optional<std::int32_t>>()) set_integrator(body, *integrator);
  if (const auto group = kept[5].cast<std::optional<std::array<std::uint32_t, 2>>>())
    set_group(body, (*group)[0], (*group)[1]);
  if (const auto space = kept[6].cast<std::optional<std::int32_t>>()) set_space(body, *space);
}

py::bytes snapshot_of(const WorldRef& world) {
  const std::size_t size = exmat_world_snapshot_size(world.get());
  std::vector<double> numbers(size / sizeof(double));
  check(exmat_world_save(world.get(), numbers.data(), size));
  return {reinterpret_cast<const char*>(numbers.data()), size};
}

void set_snapshot(WorldRef world, const py::bytes& snapshot) {
  const auto bytes = static_cast<std::string_view>(snapshot);
  std::vector<double> numbers((bytes.size() + sizeof(double) - 1) / sizeof(double) + 1);
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  check(exmat_world_restore(world.get(), numbers.data(), bytes.size()));
}

void bind_states(py::module_& module) { bind_state(module); }

}  // namespace exmat::python

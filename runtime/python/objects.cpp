#include "runtime/python/objects.h"

#include <algorithm>

namespace exmat::python {
namespace {

std::string shape_text(const py::ssize_t* shape, std::size_t dimensions) {
  std::string text = "(";
  for (std::size_t i = 0; i < dimensions; ++i) text += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  return text + (dimensions == 1 ? ",)" : ")");
}

}  // namespace

BodyObject::BodyObject(Body made, ModelHold its_model)
    : own(made.release()), body(own.get()), model(std::move(its_model)) {
  obstacles.next = exmat_world_obstacles(body.world().get());
}

BodyObject::BodyObject(BodyRef its_body, ModelHold its_model, std::shared_ptr<WorldHold> its_world)
    : world(std::move(its_world)), body(its_body), model(std::move(its_model)) {}

void set_factor(BodyObject& body, ExampleFactor factor, double number, std::int64_t region) {
  BodyRef& target = body.get();
  switch (factor) {
    case ExampleFactor::kStiffness:
      target.set_example_stiffness(number, region);
      break;
    case ExampleFactor::kDamping:
      target.set_example_damping(number, region);
      break;
    case ExampleFactor::kBias:
      target.set_example_bias(number, region);
      break;
  }
  body.factors[{factor, region}] = number;
}

void set_gravity(BodyObject& body, const std::array<double, 3>& gravity) {
  body.get().set_gravity(gravity);
  body.gravity = gravity;
}

void set_damping(BodyObject& body, const std::array<double, 2>& alpha_and_beta) {
  body.get().set_damping(alpha_and_beta[0], alpha_and_beta[1]);
  body.damping = alpha_and_beta;
}

void set_space(BodyObject& body, std::int32_t space) {
  body.get().set_space(space);
  body.space = space;
}

void set_integrator(BodyObject& body, std::int32_t integrator) {
  body.get().set_integrator(integrator);
  body.integrator = integrator;
}

void set_group(BodyObject& body, std::uint32_t group, std::uint32_t mask) {
  body.get().set_group(group, mask);
  body.group = {group, mask};
}

void set_weights(BodyObject& body, const std::vector<double>& weights, std::int64_t region) {
  body.get().set_example_weights(weights, region);
  if (weights.empty())
    body.weights.erase(region);
  else
    body.weights[region] = weights;
}

StateObject state_of(BodyObject& body) { return {body.get().state(), body.model->sha}; }

void set_state(BodyObject& body, const StateObject& state) {
  if (state.sha != body.model->sha)
    throw Error(EXMAT_INVALID_ARGUMENT,
                "state: it is of another bundle; take a body of the bundle that it was read with");
  body.get().set_state(state.numbers);
}

std::int32_t number_of(const py::handle& value, const char* setting, const std::vector<const char*>& names) {
  std::string expected;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (value.equal(py::str(names[i]))) return static_cast<std::int32_t>(i);
    expected += (i > 0 ? ", " : "") + std::string(names[i]);
  }
  throw Error(
      EXMAT_INVALID_ARGUMENT,
      (std::string(setting) + " = " + std::string(py::str(py::repr(value))) + ": expected one of " + expected).c_str());
}

Ids whole_numbers(const py::object& values, const char* name) {
  const auto expected = [&](const std::string& what) {
    return Error(EXMAT_INVALID_ARGUMENT, (std::string(name) + ": expected " + what).c_str());
  };
  const py::array given = py::array::ensure(values);
  if (!given) throw expected("whole numbers");
  const char kind = given.dtype().kind();
  if (kind != 'i' && kind != 'u' && given.size() > 0) throw expected("whole numbers");
  Ids numbers = given.cast<Ids>();
  if (kind == 'u' && std::ranges::any_of(read_span(numbers), [](std::int64_t number) { return number < 0; }))
    throw expected("whole numbers below 2^63");
  return numbers;
}

void require_shape(const py::array& array, const char* name, const std::vector<py::ssize_t>& shape) {
  const auto dimensions = static_cast<std::size_t>(array.ndim());
  if (std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + dimensions)) return;
  const std::string message = std::string(name) + ": shape " + shape_text(array.shape(), dimensions) + ": expected " +
                              shape_text(shape.data(), shape.size());
  throw Error(EXMAT_INVALID_ARGUMENT, message.c_str());
}

py::array view(const double* data, std::size_t count, const py::object& owner) {
  py::array_t<double> array({static_cast<py::ssize_t>(count)}, {static_cast<py::ssize_t>(sizeof(double))}, data, owner);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

}  // namespace exmat::python

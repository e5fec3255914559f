#include <cinttypes>
#include <cmath>
#include <fmt/format.h>
#include <span>
#include <utility>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"
#include "runtime/api/world_handle.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

ExampleSettings& example_settings(exmat_body& body, std::int64_t region) {
  return body.scene.examples[body.example_force(region)];
}

void check_weights(std::span<const double> weights, Eigen::Index examples) {
  constexpr double kSumTolerance = 1e-9;
  if (std::ssize(weights) != examples)
    throw InvalidArgument(fmt::format("count = {}: expected {}", weights.size(), examples));
  double sum = 0;
  for (const double weight : weights) {
    if (!(weight >= 0)) throw InvalidArgument("weights: expected numbers that are not negative");
    sum += weight;
  }
  if (!(std::abs(sum - 1) <= kSumTolerance))
    throw InvalidArgument(fmt::format("weights: their sum is {:g}: expected 1", sum));
}

exmat_status require_factor(const char* function, const char* name, double number) noexcept {
  if (number >= 0 && number <= kFarthest) return EXMAT_OK;
  return fail(EXMAT_INVALID_ARGUMENT, "%s: %s = %g: expected a number >= 0, of at most %g", function, name, number,
              kFarthest);
}

}  // namespace

std::size_t exmat_body::example_force(std::int64_t region) const {
  const Model& model = this->model();
  const bool whole = region == -1 && model.has_whole_body_examples();
  if (model.examples.empty())
    throw InvalidArgument("the model has no example force: set use_examples, or let its scene have examples");
  if (region == -1 && !whole)
    throw InvalidArgument(
        fmt::format("the model has examples of its {} regions alone, none of the whole body: expected one of these",
                    model.region_count()));
  if (!whole && model.region(region) == nullptr)
    throw InvalidArgument(fmt::format("region = {}: the model has {}{} regions", region,
                                      model.has_whole_body_examples() ? "the whole body (-1) and " : "",
                                      model.region_count()));
  const std::size_t found = whole ? 0 : static_cast<std::size_t>(model.region(region) - model.examples.data());
  if (found >= scene.examples.size()) throw InvalidArgument("the model was created without its example force");
  return found;
}

exmat_status exmat_body_set_gravity(exmat_body* body, const double* gravity) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(gravity);
  if (const double* const far = find_far(gravity, 3))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: gravity: %g: expected finite numbers of at most %g", __func__, *far,
                kFarthest);
  body->scene.gravity = Eigen::Map<const Eigen::Vector3d>(gravity);
  body->scene.gravity_force.noalias() = body->model().gravity_load.transpose() * body->scene.gravity;
  return EXMAT_OK;
}

exmat_status exmat_body_set_damping(exmat_body* body, double alpha, double beta) noexcept {
  EXMAT_REQUIRE(body);
  for (const auto& [name, factor] : {std::pair("alpha", alpha), std::pair("beta", beta)})
    if (const exmat_status status = require_factor(__func__, name, factor)) return status;
  body->scene.mass_damping = alpha;
  body->scene.stiffness_damping = beta;
  return EXMAT_OK;
}

exmat_status exmat_body_set_integrator(exmat_body* body, std::int32_t integrator) noexcept {
  EXMAT_REQUIRE(body);
  if (integrator < EXMAT_BDF2 || integrator > EXMAT_NEWMARK)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: integrator = %" PRId32 ": expected 0 to 2", __func__, integrator);
  body->scene.integrator = static_cast<Integrator>(integrator);
  body->state.begins_anew = true;
  return EXMAT_OK;
}

exmat_status exmat_body_set_space(exmat_body* body, std::int32_t space) noexcept {
  EXMAT_REQUIRE(body);
  if (space < EXMAT_SPACE_REDUCED || space > EXMAT_SPACE_AUTO)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: space = %" PRId32 ": expected 0 to 2", __func__, space);
  if (space != EXMAT_SPACE_REDUCED && !body->source->loaded.full)
    return fail(
        EXMAT_INVALID_ARGUMENT,
        "%s: the model was created for steps in the modes alone: set settings.space, or the space of its scene, to "
        "full or auto",
        __func__);
  if (space != EXMAT_SPACE_FULL && body->model().skeleton)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: space = %" PRId32 ": expected full space: the body is on a skeleton",
                __func__, space);
  const bool in_modes = space == EXMAT_SPACE_REDUCED;
  const bool held = is_held(body->state.attachments) || body->world->world.is_attached(place_of(*body));
  if (held && in_modes != (body->scene.space.space == Space::kReduced))
    return fail(EXMAT_INVALID_ARGUMENT,
                "%s: space = %" PRId32 ": a body that is held stays in its modes, or in full or auto: detach it first",
                __func__, space);
  body->scene.space.space = static_cast<Space>(space);
  return EXMAT_OK;
}

std::int32_t exmat_body_space(const exmat_body* body) noexcept {
  if (body == nullptr) return -1;
  return body->state.full ? EXMAT_SPACE_FULL : EXMAT_SPACE_REDUCED;
}

exmat_status exmat_body_set_example_stiffness(exmat_body* body, std::int64_t region, double kappa) noexcept {
  EXMAT_REQUIRE(body);
  if (const exmat_status status = require_factor(__func__, "kappa", kappa)) return status;
  return guarded(__func__, [&] { example_settings(*body, region).stiffness = kappa; });
}

exmat_status exmat_body_set_example_damping(exmat_body* body, std::int64_t region, double c_kappa) noexcept {
  EXMAT_REQUIRE(body);
  if (const exmat_status status = require_factor(__func__, "c_kappa", c_kappa)) return status;
  return guarded(__func__, [&] { example_settings(*body, region).damping = c_kappa; });
}

exmat_status exmat_body_set_example_bias(exmat_body* body, std::int64_t region, double bias) noexcept {
  EXMAT_REQUIRE(body);
  if (!(bias >= 0 && bias <= 1))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: bias = %g: expected a number of 0 to 1", __func__, bias);
  return guarded(__func__, [&] { example_settings(*body, region).bias = bias; });
}

exmat_status exmat_body_set_example_weights(exmat_body* body, std::int64_t region, const double* weights,
                                            std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  if (count > 0) EXMAT_REQUIRE(weights);
  return guarded(__func__, [&] {
    const std::size_t force = body->example_force(region);
    const std::span given(weights, static_cast<std::size_t>(count));
    if (count > 0) check_weights(given, body->model().examples[force].weights.examples());
    body->scene.examples[force].given_weights = Eigen::Map<const Eigen::VectorXd>(weights, count);
    if (body->full() != nullptr) put_by_shifts(*body->full(), body->scene, body->state);
  });
}

#include "runtime/sim/step/reach.h"

#include <algorithm>
#include <cinttypes>
#include <fmt/format.h>

#include "common/config/scene_config.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/points_in_modes.h"
#include "runtime/api/settings.h"
#include "runtime/sim/step/sleep.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

exmat_reach default_reach() noexcept {
  const ReachConfig defaults;
  return {sizeof(exmat_reach), -1, defaults.change, defaults.horizon, nullptr, nullptr, 0};
}

/// Duration of a step of the scene's integrator as one of backward Euler, 1 / c_v [s].
double duration_of(const StepScene& scene) noexcept {
  if (scene.integrator == Integrator::kBdf2) return 2 * scene.time_step / 3;
  return scene.integrator == Integrator::kNewmark ? scene.time_step / 2 : scene.time_step;
}

Eigen::VectorXd limits_of(const double* given, double usual, const char* name, Eigen::Index examples) {
  if (given == nullptr) return Eigen::VectorXd::Constant(examples, usual);
  Eigen::VectorXd limits = Eigen::Map<const Eigen::VectorXd>(given, examples);
  for (Eigen::Index k = 0; k < examples; ++k)
    if (!(limits[k] >= 0 && limits[k] <= 1))
      throw InvalidArgument(fmt::format("reach.{}[{}] = {:g}: expected a number of 0 to 1", name, k, limits[k]));
  return limits;
}

/// Throws InvalidArgument where settings are out of their ranges.
ReachTargets targets_of(const exmat_body& body, const exmat_reach& given) {
  ReachTargets targets;
  targets.force = body.example_force(given.region);
  if (!(given.change > 0 && given.change <= 1))
    throw InvalidArgument(fmt::format("reach.change = {:g}: expected a number above 0, at most 1", given.change));
  if (!(given.horizon > 0 && given.horizon <= kFarthest))
    throw InvalidArgument(fmt::format("reach.horizon = {:g}: expected a finite number above 0", given.horizon));
  const Eigen::Index examples = body.model().examples[targets.force].weights.examples();
  const bool limited = given.lowest != nullptr || given.highest != nullptr;
  if (given.examples != (limited ? examples : 0))
    throw InvalidArgument(fmt::format("reach.examples = {}: expected {}", given.examples, limited ? examples : 0));
  targets.change = given.change;
  targets.horizon = given.horizon;
  targets.lowest = limits_of(given.lowest, 0, "lowest", examples);
  targets.highest = limits_of(given.highest, 1, "highest", examples);
  if (!can_hold(targets.lowest, targets.highest))
    throw InvalidArgument(
        fmt::format("reach: expected limits between which weights add up to 1, none of lowest above that of highest, "
                    "found sums of {:g} and {:g}",
                    targets.lowest.sum(), targets.highest.sum()));
  return targets;
}

void set_reach(ReachTargets targets, exmat_body& body) {
  Reach* const now = body.reach.get();
  const bool fits =
      now != nullptr && now->targets().force == targets.force && now->targets().places.size() == targets.places.size();
  if (fits)
    now->targets() = std::move(targets);
  else
    body.reach = std::make_unique<Reach>(body.model(), body.scene, body.state, std::move(targets));
  body.reaches_by_scene = false;
  wake(body.state);
}

}  // namespace

exmat_status exmat_reach_default(exmat_reach* reach, std::size_t size) noexcept {
  EXMAT_REQUIRE(reach);
  if (const exmat_status status = check_size(__func__, size, kReachSizes)) return status;
  give(default_reach(), size, reach);
  return EXMAT_OK;
}

exmat_status exmat_body_reach(exmat_body* body, const exmat_points* points, const double* targets,
                              std::int64_t coordinates, const exmat_reach* reach) noexcept {
  EXMAT_REQUIRE(body);
  if (points == nullptr) {
    EXMAT_REQUIRE_LENGTH(coordinates, 0);
    body->reach.reset();
    body->reaches_by_scene = false;
    return EXMAT_OK;
  }
  EXMAT_REQUIRE(targets);
  if (const exmat_status status = check_points_in_modes(__func__, *body, *points)) return status;
  EXMAT_REQUIRE_LENGTH(coordinates, points->set.basis_rows.rows());
  if (const double* const far = find_far(targets, coordinates))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: targets[%td] = %g: expected finite numbers of at most %g", __func__,
                far - targets, *far, kFarthest);
  if (reach != nullptr)
    if (const exmat_status status = check_size(__func__, reach->size, kReachSizes)) return status;
  return guarded(__func__, [&] {
    ReachTargets made = targets_of(*body, reach != nullptr ? completed(*reach, default_reach()) : default_reach());
    made.rest = points->set.rest;
    made.basis_rows = points->set.basis_rows;
    made.places = Eigen::Map<const Eigen::VectorXd>(targets, coordinates);
    set_reach(std::move(made), *body);
  });
}

exmat_status exmat_body_read_sensitivity(const exmat_body* body, std::int64_t region, const exmat_points* points,
                                         double* sensitivity, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(sensitivity);
  if (const exmat_status status = check_points_in_modes(__func__, *body, *points)) return status;
  return guarded(__func__, [&] {
    const std::size_t force = body->example_force(region);
    WeightResponse response(body->model(), body->scene, body->state, force);
    response.update(duration_of(body->scene), Tangent::kExact);
    const MaterialPoints own{points->set.rest, points->set.basis_rows};
    const Eigen::MatrixXd S = response.response().jacobian(own) * response.ways().leftCols(response.examples());
    if (count != S.size()) throw InvalidArgument(fmt::format("count = {}: expected {}", count, S.size()));
    Eigen::Map<RowMatrix>(sensitivity, S.rows(), S.cols()) = S.colwise() - S.col(0);
  });
}

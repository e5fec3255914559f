#include <algorithm>
#include <cinttypes>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/points_in_modes.h"
#include "runtime/api/world_handle.h"
#include "runtime/sim/space/full/full_response.h"
#include "runtime/sim/step/impulse_response.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// Refuses points of another model and points for drawing alone.
exmat_status check_points(const char* function, const exmat_body& body, const exmat_points& points) noexcept {
  if (points.source != body.source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", function);
  return require_rows(function, points.set);
}

/// Response of a body in full space, as it is in `state`.
FullImpulseResponse full_response(const exmat_body& body, State& state) {
  World& world = body.world->world;
  const int place = place_of(body);
  FullWorkspace& own = *world.full_scratch(place);
  own.fit(*body.full(), body.scene);
  return {*body.full(), body.model(), body.scene, state, world.scratch(place), own};
}

}  // namespace

exmat_status exmat::runtime::check_points_in_modes(const char* function, const exmat_body& body,
                                                   const exmat_points& points) noexcept {
  if (const exmat_status status = check_points(function, body, points)) return status;
  if (body.state.full)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: expected a body that steps in its modes, found one in all its vertices",
                function);
  return EXMAT_OK;
}

exmat_status exmat_body_read_compliance(const exmat_body* body, const exmat_points* points, double* velocity,
                                        double* compliance, std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  if (const exmat_status status = check_points(__func__, *body, *points)) return status;
  EXMAT_REQUIRE_LENGTH(coordinates, points->set.basis_rows.rows());
  const auto give = [&](const Eigen::VectorXd& own) {
    if (velocity != nullptr) Eigen::Map<Eigen::VectorXd>(velocity, coordinates) = own;
  };
  return guarded(__func__, [&] {
    if (body->state.full) {
      State state = body->state;
      FullImpulseResponse response = full_response(*body, state);
      const VertexPoints own{points->set.corners, points->set.shares};
      give(response.velocity(own));
      if (compliance != nullptr) Eigen::Map<RowMatrix>(compliance, coordinates, coordinates) = response.compliance(own);
      return;
    }
    const MaterialPoints own{points->set.rest, points->set.basis_rows};
    const ImpulseResponse response(body->model(), body->scene, body->state);
    give(response.velocity(own));
    if (compliance == nullptr) return;
    const Eigen::MatrixXd J = response.jacobian(own);
    Eigen::Map<RowMatrix>(compliance, coordinates, coordinates) = J * response.solve(J.transpose());
  });
}

exmat_status exmat_body_apply_impulses(exmat_body* body, const exmat_points* points, const double* impulses,
                                       std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(impulses);
  if (const exmat_status status = check_points(__func__, *body, *points)) return status;
  EXMAT_REQUIRE_LENGTH(coordinates, points->set.basis_rows.rows());
  if (const double* const far = find_far(impulses, coordinates))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: impulses[%td] = %g: expected finite numbers of at most %g", __func__,
                far - impulses, *far, kFarthest);
  return guarded(__func__, [&] {
    const Eigen::Map<const Eigen::VectorXd> all(impulses, coordinates);
    if (body->state.full) {
      full_response(*body, body->state).apply({points->set.corners, points->set.shares}, all);
      return;
    }
    const MaterialPoints own{points->set.rest, points->set.basis_rows};
    const ImpulseResponse response(body->model(), body->scene, body->state);
    response.apply(own, all, scratch_of(*body), body->state);
    body->world->world.was_pushed(place_of(*body));
  });
}

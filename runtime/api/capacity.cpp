#include <cmath>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_steps.h"
#include "runtime/api/reading.h"
#include "runtime/api/world_handle.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// [3n] on the vertices of a body at the end of its last step, in its own frame.
Eigen::VectorXd contact_load(const exmat_body& body) {
  const Eigen::Matrix3d to_own = body.model().frame->placement(body.state.frame).rotation.transpose();
  Eigen::VectorXd load = Eigen::VectorXd::Zero(3 * body.source->loaded.summary.vertices);
  for (const ContactRecord::Touch& touch : body.contacts.touches())
    load.segment<3>(3 * static_cast<Eigen::Index>(touch.vertex)) += to_own * touch.force;
  if (body.world == nullptr) return load;
  for (const exmat_body_contact& contact : body.world->contacts)
    if (exmat_world_body(body.world, contact.body) == &body)
      load.segment<3>(3 * contact.vertex) += to_own * Eigen::Vector3d(contact.force);
  return load;
}

/// A body that steps in all vertices feels all of a load.
double lost_share(const LoadCapacity& capacity, const exmat_body& body, const Eigen::VectorXd& load) {
  return body.state.full ? 0 : capacity.lost_share(load);
}

}  // namespace

namespace exmat::runtime {

void measure_lost_work(exmat_body& body) noexcept {
  if (!body.capacity) return;
  try {
    body.report.lost_applied = lost_share(*body.capacity, body, body.load);
    body.report.lost_contact = lost_share(*body.capacity, body, contact_load(body));
  } catch (const std::exception&) {  // no memory for it: not measured
    body.report.lost_applied = body.report.lost_contact = -1;
  }
}

}  // namespace exmat::runtime

exmat_status exmat_capacity_create(const exmat_model* model, double spread, exmat_capacity** capacity) noexcept {
  EXMAT_REQUIRE(capacity);
  *capacity = nullptr;
  EXMAT_REQUIRE(model);
  if (!(spread >= 0 && std::isfinite(spread)))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: spread = %g: expected a finite number >= 0", __func__, spread);
  return guarded(__func__, [&] {
    const ReducedModel data = [&] {
      const std::lock_guard lock(reading());
      return read_groups(*model->source, {"object", "modal"});
    }();
    *capacity = new exmat_capacity{model->source, std::make_shared<const LoadCapacity>(data, spread)};
  });
}

void exmat_capacity_destroy(exmat_capacity* capacity) noexcept { delete capacity; }

double exmat_capacity_time_scale(const exmat_capacity* capacity) noexcept {
  return capacity != nullptr ? capacity->capacity->time_scale() : -1;
}

exmat_status exmat_capacity_read_lost(const exmat_capacity* capacity, const exmat_body* body,
                                      const exmat_points* points, const double* forces, std::int64_t coordinates,
                                      double* lost) noexcept {
  EXMAT_REQUIRE(capacity);
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(forces);
  EXMAT_REQUIRE(lost);
  if (points->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", __func__);
  EXMAT_REQUIRE_LENGTH(coordinates, points->set.rest.size());
  if (const double* const far = find_far(forces, coordinates))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: forces: %g: expected finite numbers of at most %g", __func__, *far,
                kFarthest);
  return guarded(__func__, [&] {
    const Placement placement = body->model().frame->placement(body->state.frame);
    const VertexArray own = Eigen::Map<const VertexArray>(forces, coordinates / 3, 3) * placement.rotation;
    *lost = lost_share(*capacity->capacity, *body, capacity->capacity->spread_load(points->set.rest, own));
  });
}

exmat_status exmat_capacity_read_contact_lost(const exmat_capacity* capacity, const exmat_body* body,
                                              double* lost) noexcept {
  EXMAT_REQUIRE(capacity);
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(lost);
  return guarded(__func__, [&] { *lost = lost_share(*capacity->capacity, *body, contact_load(*body)); });
}

exmat_status exmat_body_set_capacity(exmat_body* body, const exmat_capacity* capacity) noexcept {
  EXMAT_REQUIRE(body);
  if (capacity != nullptr && capacity->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the capacity is that of another model", __func__);
  return guarded(__func__, [&] {
    Eigen::VectorXd load;
    if (capacity != nullptr) load = Eigen::VectorXd::Zero(3 * body->source->loaded.summary.vertices);
    std::vector<Eigen::VectorXd> loads(body->forces.size(), load);
    for (std::size_t i = 0; i < loads.size(); ++i) body->forces[i].load = std::move(loads[i]);
    body->load = std::move(load);
    body->capacity = capacity != nullptr ? capacity->capacity : nullptr;
  });
}

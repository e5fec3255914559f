#include "runtime/api/applied_forces.h"

#include <algorithm>
#include <cinttypes>
#include <utility>
#include <variant>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"
#include "runtime/api/world_handle.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// The state of a body has the sum of all forces of the host. While some of them have an id, the body keeps each of them
// and the sum of the others, and their sum is taken again, in this order, whenever one changes: a force that was
// removed leaves no rounding behind.

namespace {

/// Forces on points that were checked; their sum in the modes is exmat_body::force.
struct GivenForces {
  const PointSet* points = nullptr;
  const double* forces = nullptr;                                  ///< [3k]
  Eigen::Vector3d force{Eigen::Vector3d::Zero()}, torque = force;  ///< about the centre of mass
  Eigen::VectorXd load{};                                          ///< [3n] of a body with a capacity
};

/// Checks a caller's forces and reads them; changes nothing but scratch of the body.
exmat_status read_forces(const char* function, exmat_body& body, const exmat_points* points, const double* forces,
                         std::int64_t coordinates, GivenForces& given) noexcept {
  if (points == nullptr) return null_argument(function, "points");
  if (forces == nullptr) return null_argument(function, "forces");
  if (points->source != body.source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", function);
  if (const exmat_status status = require_rows(function, points->set)) return status;
  const RowMatrix& rows = points->set.basis_rows;
  if (coordinates != rows.rows()) return wrong_length(function, "coordinates", coordinates, rows.rows());
  if (const double* const far = find_far(forces, coordinates))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: forces: %g: expected finite numbers of at most %g", function, *far,
                kFarthest);
  given.points = &points->set;
  given.forces = forces;
  const Placement placement = body.model().frame->placement(body.state.frame);
  Eigen::VectorXd& sum = body.force;
  sum.setZero();
  for (Eigen::Index i = 0; i < rows.rows(); i += 3) {
    const Eigen::Vector3d force = Eigen::Map<const Eigen::Vector3d>(forces + i);
    given.force += force;
    given.torque += (world_position(points->set, i / 3, body, placement) - placement.position).cross(force);
    sum += rows.middleRows<3>(i).transpose().lazyProduct(placement.rotation.transpose() * force);
  }
  if (!sum.allFinite()) return fail(EXMAT_INVALID_ARGUMENT, "%s: forces: expected a finite sum", function);
  if (!body.capacity) return EXMAT_OK;
  return guarded(function, [&] {
    const Eigen::Map<const VertexArray> world(forces, coordinates / 3, 3);
    given.load = body.capacity->spread_load(points->set.rest, world * placement.rotation);
  });
}

/// [f] of world forces [3k] on the points.
void add_vertex_forces(const PointSet& points, const double* forces, const FullSpace& space,
                       Eigen::VectorXd& sum) noexcept {
  for (Eigen::Index i = 0; i < points.corners.rows(); ++i)
    for (Eigen::Index c = 0; c < points.corners.cols(); ++c)
      if (const std::int32_t number = space.number(points.corners(i, c)); number >= 0)
        sum.segment<3>(3 * number) += points.shares(i, c) * Eigen::Map<const Eigen::Vector3d>(forces + 3 * i);
}

/// Adds forces to the sums `to`, or, where that is null, to those of the state.
void add_forces(const GivenForces& given, exmat_body& body, AppliedForces* to) noexcept {
  State& state = body.state;
  (to != nullptr ? to->modes : state.applied_force) += body.force;
  if (body.full() != nullptr)
    add_vertex_forces(*given.points, given.forces, body.full()->space,
                      to != nullptr ? to->vertices : state.vertex_force);
  if (body.capacity) (to != nullptr ? to->load : body.load) += given.load;
  if (to == nullptr) return body.model().frame->apply(given.force, given.torque, state.frame);
  to->force += given.force;
  to->torque += given.torque;
}

void clear_forces(AppliedForces& forces) noexcept {
  for (Eigen::VectorXd* const sum : {&forces.modes, &forces.vertices, &forces.load}) sum->setZero();
  forces.force.setZero();
  forces.torque.setZero();
}

void clear_applied(exmat_body& body) noexcept {
  for (Eigen::VectorXd* const sum : {&body.state.applied_force, &body.state.vertex_force, &body.load}) sum->setZero();
  body.model().frame->clear_forces(body.state.frame);
}

/// The sums of the state.
AppliedForces applied_sums(const exmat_body& body) {
  AppliedForces sums{-1, body.state.applied_force, body.state.vertex_force};
  sums.load = body.load;
  if (const auto* const free = std::get_if<FreeState>(&body.state.frame)) {
    sums.force = free->applied_force;
    sums.torque = free->applied_torque;
  }
  return sums;
}

/// Sets the sums of the state from all forces of a body that keeps them.
void sum_forces(exmat_body& body) noexcept {
  clear_applied(body);
  for (const AppliedForces& forces : body.forces) {
    body.state.applied_force += forces.modes;
    body.state.vertex_force += forces.vertices;
    body.load += forces.load;
    body.model().frame->apply(forces.force, forces.torque, body.state.frame);
  }
}

/// Forces of this id; where there are none the end of the list, after fail().
auto find_forces(const char* function, exmat_body& body, std::int64_t id) noexcept {
  const auto found = id >= 0 ? std::ranges::find(body.forces, id, &AppliedForces::id) : body.forces.end();
  if (found == body.forces.end())
    fail(EXMAT_INVALID_ARGUMENT, "%s: id = %" PRId64 ": expected that of forces that act on the body", function, id);
  return found;
}

}  // namespace

exmat_status exmat_body_apply_forces(exmat_body* body, const exmat_points* points, const double* forces,
                                     std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  GivenForces given;
  if (const exmat_status status = read_forces(__func__, *body, points, forces, coordinates, given)) return status;
  add_forces(given, *body, body->forces.empty() ? nullptr : &body->forces.front());
  if (!body->forces.empty()) sum_forces(*body);
  return EXMAT_OK;
}

exmat_status exmat_body_add_forces(exmat_body* body, const exmat_points* points, const double* forces,
                                   std::int64_t coordinates, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(id);
  GivenForces given;
  if (const exmat_status status = read_forces(__func__, *body, points, forces, coordinates, given)) return status;
  return guarded(__func__, [&] {
    AppliedForces made = applied_sums(*body);
    clear_forces(made);
    made.id = body->next_forces;
    add_forces(given, *body, &made);
    body->forces.reserve(body->forces.size() + 2);
    if (body->forces.empty()) body->forces.push_back(applied_sums(*body));
    body->forces.push_back(std::move(made));
    sum_forces(*body);
    *id = body->next_forces++;
  });
}

exmat_status exmat_body_set_forces(exmat_body* body, std::int64_t id, const exmat_points* points, const double* forces,
                                   std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  const auto found = find_forces(__func__, *body, id);
  if (found == body->forces.end()) return EXMAT_INVALID_ARGUMENT;
  GivenForces given;
  if (const exmat_status status = read_forces(__func__, *body, points, forces, coordinates, given)) return status;
  clear_forces(*found);
  add_forces(given, *body, &*found);
  sum_forces(*body);
  return EXMAT_OK;
}

exmat_status exmat_body_remove_forces(exmat_body* body, std::int64_t id) noexcept {
  EXMAT_REQUIRE(body);
  const auto found = find_forces(__func__, *body, id);
  if (found == body->forces.end()) return EXMAT_INVALID_ARGUMENT;
  body->forces.erase(found);
  sum_forces(*body);
  if (body->forces.size() == 1) body->forces.clear();  // the state has the others
  return EXMAT_OK;
}

exmat_status exmat_body_clear_forces(exmat_body* body) noexcept {
  EXMAT_REQUIRE(body);
  clear_applied(*body);
  body->forces.clear();
  return EXMAT_OK;
}

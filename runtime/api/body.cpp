#include <algorithm>
#include <cinttypes>
#include <utility>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_steps.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/world_loader.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace exmat::runtime {

void put_to_start(exmat_body& body) noexcept {
  body.state = body.start;  // vectors of the same lengths, but perhaps attachments: no allocation
  if (body.full() != nullptr) put_by_shifts(*body.full(), body.scene, body.state);
  body.load.setZero();
  body.forces.clear();
  begin_steps(body);
  was_put(body);
}

}  // namespace exmat::runtime

namespace {

/// World position [m] of a point of a body in full space.
Eigen::Vector3d full_position(const PointSet& points, Eigen::Index i, const Placement& placement,
                              const exmat_body& body) noexcept {
  Eigen::Vector3d position = points.rest.row(i);
  for (Eigen::Index c = 0; c < points.corners.cols(); ++c)
    position +=
        points.shares(i, c) * full_displacement(*body.full(), placement, *body.state.full, points.corners(i, c));
  return position;
}

void put_to_rest(exmat_body& body) noexcept {
  const double time = body.state.time;
  put_to_start(body);
  follow_time(body, time);
}

}  // namespace

namespace exmat::runtime {

Eigen::Vector3d world_position(const PointSet& points, Eigen::Index i, const exmat_body& body,
                               const Placement& placement) noexcept {
  if (body.state.full) return full_position(points, i, placement, body);
  const Eigen::Vector3d displacement = points.basis_rows.middleRows<3>(3 * i).lazyProduct(body.state.q);
  return placement.to_world(points.rest.row(i).transpose() + displacement);
}

}  // namespace exmat::runtime

exmat_body::exmat_body(std::shared_ptr<const Source> its_source, State its_start)
    : source(std::move(its_source)),
      scene(source->loaded.scene),
      start(std::move(its_start)),
      drawing(VertexPositions::make_workspace(model().modes())),
      force(Eigen::VectorXd::Zero(model().modes())),
      frame_numbers(model().frame->numbers(start.frame).size()) {
  source->loaded.keys.apply_start(model(), scene);
  Workspace workspace(model(), scene);
  refresh_weights(model(), scene, start, workspace);
  if (full() != nullptr) put_by_shifts(*full(), scene, start);
  state = start;
  next_attachment = std::ssize(state.attachments);
  if (!source->loaded.reach) return;
  reach = std::make_unique<Reach>(model(), scene, state, source->loaded.reach->targets);
  reaches_by_scene = true;
}

exmat_body::~exmat_body() = default;

exmat_status exmat_body_create(const exmat_model* model, exmat_body** body) noexcept {
  EXMAT_REQUIRE(body);
  *body = nullptr;
  EXMAT_REQUIRE(model);
  return guarded(__func__, [&] {
    auto made = std::make_unique<exmat_body>(model->source, start_of(model->source->loaded));
    join_own(*made);
    *body = made.release();
  });
}

void exmat_body_destroy(exmat_body* body) noexcept {
  if (body != nullptr && !body->own && body->world != nullptr) leave_world(*body);
  delete body;
}

exmat_status exmat_body_model(const exmat_body* body, exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  EXMAT_REQUIRE(body);
  return guarded(__func__, [&] { *model = new exmat_model{body->source}; });
}

exmat_status exmat_body_reset(exmat_body* body) noexcept {
  EXMAT_REQUIRE(body);
  put_to_rest(*body);
  return EXMAT_OK;
}

exmat_status exmat_body_set_reduced(exmat_body* body, const double* q, const double* v, std::int64_t modes) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(q);
  EXMAT_REQUIRE(v);
  EXMAT_REQUIRE_LENGTH(modes, body->modes());
  for (const double* const numbers : {q, v})
    if (const double* const far = find_far(numbers, modes))
      return fail(EXMAT_INVALID_ARGUMENT, "%s: q, v: %g: expected finite numbers of at most %g", __func__, *far,
                  kFarthest);
  if (body->model().skeleton)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: expected a body without a skeleton, which steps in all its vertices",
                __func__);
  put_to_rest(*body);
  State& state = body->state;
  state.q = state.q_previous = Eigen::Map<const Eigen::VectorXd>(q, modes);
  state.v = state.v_previous = Eigen::Map<const Eigen::VectorXd>(v, modes);
  state.elastic_energy = body->model().internal_force.energy(state.q, scratch_of(*body).elasticity);
  follow_frame(body->model(), body->scene, state, scratch_of(*body));
  refresh_weights(body->model(), body->scene, state, scratch_of(*body));
  return EXMAT_OK;
}

exmat_status exmat_body_read_report(const exmat_body* body, exmat_report* report) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(report);
  if (const exmat_status status = check_size(__func__, report->size, kReportSizes)) return status;
  give(body->report, report->size, report);
  return EXMAT_OK;
}

exmat_status exmat_body_restart_integrator(exmat_body* body) noexcept {
  EXMAT_REQUIRE(body);
  body->state.begins_anew = true;
  return EXMAT_OK;
}

exmat_status exmat_body_read_point_compliance(const exmat_body* body, const exmat_points* points,
                                              double* compliance) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(compliance);
  if (points->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", __func__);
  *compliance = 0;
  FullWorkspace* const scratch = body->world->world.full_scratch(place_of(*body));
  if (!body->state.full || scratch == nullptr) return EXMAT_OK;
  return guarded(__func__, [&] {
    const PointSet& set = points->set;
    const RowMatrix shares = set.shares / static_cast<double>(set.shares.rows());
    *compliance = runtime::compliance(*body->full(), {set.corners.data(), static_cast<std::size_t>(set.corners.size())},
                                      {shares.data(), static_cast<std::size_t>(shares.size())}, *scratch);
  });
}

exmat_status exmat_body_read_positions(exmat_body* body, const exmat_points* points, float* xyz,
                                       std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(xyz);
  if (points->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", __func__);
  EXMAT_REQUIRE_LENGTH(coordinates, 3 * points->set.positions.points());
  const Placement placement = body->model().frame->placement(body->state.frame);
  if (body->state.full) {
    for (Eigen::Index i = 0; i < points->set.rest.rows(); ++i)
      Eigen::Map<Eigen::Vector3f>(xyz + 3 * i) = full_position(points->set, i, placement, *body).cast<float>();
    return EXMAT_OK;
  }
  points->set.positions.evaluate(body->state.q, body->drawing, xyz);
  if (!body->model().frame->moves()) return EXMAT_OK;
  for (std::int64_t i = 0; i < coordinates; i += 3) {
    Eigen::Map<Eigen::Vector3f> point(xyz + i);
    point = placement.to_world(point.cast<double>()).cast<float>();
  }
  return EXMAT_OK;
}

exmat_status exmat_body_read_positions_double(const exmat_body* body, const exmat_points* points, double* xyz,
                                              std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(xyz);
  if (points->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", __func__);
  if (const exmat_status status = require_rows(__func__, points->set)) return status;
  EXMAT_REQUIRE_LENGTH(coordinates, points->set.basis_rows.rows());
  const Placement placement = body->model().frame->placement(body->state.frame);
  for (Eigen::Index i = 0; i < points->set.rest.rows(); ++i)
    Eigen::Map<Eigen::Vector3d>(xyz + 3 * i) = world_position(points->set, i, *body, placement);
  return EXMAT_OK;
}

exmat_status exmat_body_read_motion(const exmat_body* body, exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(motion);
  if (const exmat_status status = check_size(__func__, motion->size, kMotionSizes)) return status;
  const FrameMotion now = body->model().frame->motion(body->state.frame);
  exmat_motion found{};
  for (int i = 0; i < 3; ++i) {
    found.position[i] = now.position[i];
    found.orientation[i + 1] = now.orientation.vec()[i];
    found.linear_velocity[i] = now.linear_velocity[i];
    found.angular_velocity[i] = now.angular_velocity[i];
  }
  found.orientation[0] = now.orientation.w();
  give(found, motion->size, motion);
  return EXMAT_OK;
}

exmat_status exmat_body_set_motion(exmat_body* body, const exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(motion);
  if (const exmat_status status = check_size(__func__, motion->size, kMotionSizes)) return status;
  FrameMotion wanted;
  wanted.position = Eigen::Vector3d(motion->position);
  wanted.linear_velocity = Eigen::Vector3d(motion->linear_velocity);
  wanted.angular_velocity = Eigen::Vector3d(motion->angular_velocity);
  const double* turn = motion->orientation;
  wanted.orientation = Eigen::Quaterniond(turn[0], turn[1], turn[2], turn[3]);
  const double length = wanted.orientation.norm();
  if (!std::isfinite(length) || !(length > 0))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: motion: expected finite numbers and a quaternion that is not 0", __func__);
  for (const double* const member : {motion->position, motion->linear_velocity, motion->angular_velocity})
    if (const double* const far = find_far(member, 3))
      return fail(EXMAT_INVALID_ARGUMENT, "%s: motion: %g: expected finite numbers of at most %g", __func__, *far,
                  kFarthest);
  const RigidPlace before{body->model().frame->placement(body->state.frame),
                          body->model().frame->velocity(body->state.frame)};
  if (!move_body(body->model(), body->scene, wanted, body->state, scratch_of(*body)))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the body has fixed vertices", __func__);
  if (body->state.full) move_full(*body->full(), body->model(), before, body->state);
  was_put(*body);
  return EXMAT_OK;
}

exmat_status exmat_body_read_reduced(const exmat_body* body, double* q, double* v, std::int64_t modes) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE_LENGTH(modes, body->modes());
  if (q != nullptr) std::copy_n(body->state.q.data(), modes, q);
  if (v != nullptr) std::copy_n(body->state.v.data(), modes, v);
  return EXMAT_OK;
}

exmat_status exmat_body_read_weights(const exmat_body* body, double* weights, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE_LENGTH(count, body->model().example_count());
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(weights);
  std::copy_n(body->state.examples.front().weights.data(), count, weights);
  return EXMAT_OK;
}

exmat_status exmat_body_read_region_weights(const exmat_body* body, std::int64_t region, double* weights,
                                            std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  const ExampleModel* examples = body->model().region(region);
  if (examples == nullptr)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: region = %" PRId64 ": expected one of the model's %" PRId64, __func__,
                region, static_cast<std::int64_t>(body->model().region_count()));
  EXMAT_REQUIRE_LENGTH(count, examples->weights.examples());
  EXMAT_REQUIRE(weights);
  const auto force = static_cast<std::size_t>(examples - body->model().examples.data());
  std::copy_n(body->state.examples[force].weights.data(), count, weights);
  return EXMAT_OK;
}

exmat_status exmat_body_read_energies(const exmat_body* body, exmat_energies* result) noexcept {
  EXMAT_REQUIRE(body);
  if (result == nullptr) return null_argument(__func__, "energies");
  if (const exmat_status status = check_size(__func__, result->size, kEnergiesSizes)) return status;
  const Energies now = body->world->world.energies(place_of(*body));
  give(exmat_energies{0, now.kinetic, now.elastic, now.potential, now.contact}, result->size, result);
  return EXMAT_OK;
}

double exmat_body_time(const exmat_body* body) noexcept { return body != nullptr ? body->state.time : -1; }

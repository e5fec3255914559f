#include <algorithm>
#include <array>
#include <cinttypes>
#include <omp.h>
#include <span>
#include <utility>

#include "common/core/timer.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_obstacles.h"
#include "runtime/api/body_steps.h"
#include "runtime/api/handles.h"
#include "runtime/api/startable_threads.h"
#include "runtime/api/world_handle.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

void advance(exmat_body& body, Workspace& workspace, std::int64_t steps) noexcept {
  const Timer timer;
  begin_steps(body);
  body.profile = {};
  workspace.profile = body.profiled ? &body.profile : nullptr;
  while (body.report.steps < steps && !non_finite(body)) {
    apply_keys(body);
    add_step(step(body.model(), body.scene, body.state, workspace), workspace, body);
  }
  workspace.profile = nullptr;
  measure_lost_work(body);
  body.report.seconds = timer.seconds();
}

void put_to_rest(exmat_body& body) noexcept {
  const double time = body.state.time;
  body.state = body.start;  // vectors of the same lengths: no allocation
  body.load.setZero();
  begin_steps(body);
  keep_host_obstacles(time, body);
  was_put(body);
}

/// Whether two bodies may step side by side, and each in the scratch of the first.
bool are_alike(const exmat_body& first, const exmat_body& body) noexcept {
  return first.source == body.source && !body.profiled &&
         body.obstacles.size() == body.source->loaded.scene.obstacles.size() &&
         can_step_side_by_side(body.model(), body.scene);
}

/// As advance(), for at most kLanes bodies that are alike.
void advance_side_by_side(std::span<exmat_body* const> bodies, LaneWorkspace& workspace, std::int64_t steps) noexcept {
  const Timer timer;
  std::array<LaneBody, kLanes> lanes;
  std::array<exmat_body*, kLanes> running;
  std::array<StepReport, kLanes> reports;
  for (exmat_body* body : bodies) begin_steps(*body);
  for (std::int64_t n = 0; n < steps; ++n) {
    std::size_t count = 0;
    for (exmat_body* body : bodies) {
      if (non_finite(*body)) continue;
      apply_keys(*body);
      lanes[count] = {&body->scene, &body->state};
      running[count++] = body;
    }
    reports.fill({});
    step_side_by_side(running.front()->model(), {lanes.data(), count}, workspace, {reports.data(), count});
    for (std::size_t lane = 0; lane < count; ++lane) add_step(reports[lane], workspace.body(lane), *running[lane]);
  }
  for (exmat_body* body : bodies) body->report.seconds = timer.seconds() / static_cast<double>(bodies.size());
}

/// Whether one may step in the scratch of the other.
bool lends(const exmat_body* lender, const exmat_body& body) noexcept {
  return lender != nullptr && lender->source == body.source && lender->obstacles.size() == body.obstacles.size();
}

/// At most kLanes bodies, side by side as far as they follow each other and are alike. `lender` is one whose scratch is
/// in the cache, or null.
void advance_group(std::span<exmat_body* const> group, exmat_body*& lender, std::int64_t steps) noexcept {
  while (!group.empty()) {
    exmat_body& first = *group.front();
    std::size_t count = 0;
    while (count < group.size() && are_alike(first, *group[count])) ++count;
    std::unique_ptr<LaneWorkspace> workspace;
    if (std::cmp_greater_equal(count, kFewestLanes))
      workspace = first.source->lanes->take(first.model(), first.source->loaded.scene);
    if (workspace) {
      advance_side_by_side(group.first(count), *workspace, steps);
      first.source->lanes->give_back(std::move(workspace));
    } else {
      count = std::max<std::size_t>(count, 1);
      for (exmat_body* body : group.first(count)) {
        if (!lends(lender, *body)) lender = body;
        advance(*body, lender->workspace, steps);
      }
    }
    group = group.subspan(count);
  }
}

}  // namespace

exmat_body::exmat_body(std::shared_ptr<const Source> its_source, State its_start)
    : source(std::move(its_source)),
      scene(source->loaded.scene),
      start(std::move(its_start)),
      workspace(model(), scene),
      drawing(VertexPositions::make_workspace(model().modes())),
      force(Eigen::VectorXd::Zero(model().modes())),
      frame_numbers(model().frame->numbers(start.frame).size()) {
  source->loaded.keys.apply_start(model(), scene);
  refresh_weights(model(), scene, start, workspace);
  state = start;
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) obstacles.push_back({next_obstacle++, false});
  contacts.prepare(model(), obstacles.size());
}

exmat_status exmat_body_create(const exmat_model* model, exmat_body** body) noexcept {
  EXMAT_REQUIRE(body);
  *body = nullptr;
  EXMAT_REQUIRE(model);
  return guarded(__func__,
                 [&] { *body = std::make_unique<exmat_body>(model->source, model->source->loaded.start).release(); });
}

void exmat_body_destroy(exmat_body* body) noexcept {
  if (body != nullptr && body->world != nullptr) leave_world(*body);
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
  if (!all_finite(q, modes) || !all_finite(v, modes))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: q, v: expected finite numbers", __func__);
  put_to_rest(*body);
  State& state = body->state;
  state.q = state.q_previous = Eigen::Map<const Eigen::VectorXd>(q, modes);
  state.v = state.v_previous = Eigen::Map<const Eigen::VectorXd>(v, modes);
  state.elastic_energy = body->model().internal_force.energy(state.q, body->workspace.elasticity);
  follow_frame(body->model(), body->scene, state, body->workspace);
  refresh_weights(body->model(), body->scene, state, body->workspace);
  return EXMAT_OK;
}

exmat_status exmat_body_step(exmat_body* body, std::int64_t steps, exmat_report* report) noexcept {
  EXMAT_REQUIRE(body);
  if (steps < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: steps = %" PRId64 ": expected >= 0", __func__, steps);
  if (report != nullptr)
    if (const exmat_status status = check_size(__func__, report->size, kReportSizes)) return status;
  if (body->world != nullptr)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the body is in a world: exmat_world_step() steps it", __func__);
  if (!acquire(*body)) return fail(EXMAT_INVALID_ARGUMENT, "%s: another thread steps this body", __func__);
  advance(*body, body->workspace, steps);
  const bool finite = !non_finite(*body);
  if (report != nullptr) give(body->report, report->size, report);
  const exmat_status status = finite ? EXMAT_OK : fail_non_finite(__func__, "body", *body);
  release(*body);
  return status;
}

exmat_status exmat_bodies_step(exmat_body* const* bodies, std::int64_t count, std::int64_t steps,
                               std::int32_t threads) noexcept {
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  if (steps < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: steps = %" PRId64 ": expected >= 0", __func__, steps);
  if (threads < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: threads = %" PRId32 ": expected >= 0", __func__, threads);
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(bodies);
  const std::span all(bodies, static_cast<std::size_t>(count));
  const auto null = std::ranges::find(all, nullptr);
  if (null != all.end()) return fail(EXMAT_INVALID_ARGUMENT, "%s: bodies[%td] is NULL", __func__, null - all.begin());
  const auto hosted = std::ranges::find_if(all, [](const exmat_body* body) { return body->world != nullptr; });
  if (hosted != all.end())
    return fail(EXMAT_INVALID_ARGUMENT, "%s: bodies[%td] is in a world: exmat_world_step() steps it", __func__,
                hosted - all.begin());
  const auto taken = std::ranges::find_if(all, [](exmat_body* body) { return !acquire(*body); });
  if (taken != all.end()) {
    std::for_each(all.begin(), taken, [](exmat_body* body) { release(*body); });
    return fail(EXMAT_INVALID_ARGUMENT, "%s: bodies[%td] is listed twice, or another thread steps it", __func__,
                taken - all.begin());
  }
  const int wanted = threads > 0 ? threads : omp_get_num_procs();
  const int used = startable_threads(static_cast<int>(std::min<std::int64_t>(wanted, count)));
#pragma omp parallel num_threads(used) if (used > 1)
  {
    exmat_body* lender = nullptr;  // of this thread: bodies of one model share the scratch that is in its cache
#pragma omp for schedule(dynamic)
    for (std::int64_t first = 0; first < count; first += kLanes)
      advance_group(all.subspan(static_cast<std::size_t>(first),
                                static_cast<std::size_t>(std::min<std::int64_t>(kLanes, count - first))),
                    lender, steps);
  }
  exmat_status status = EXMAT_OK;
  const auto failed = std::ranges::find_if(all, [](const exmat_body* body) { return non_finite(*body); });
  if (failed != all.end()) {
    char which[40];
    std::snprintf(which, sizeof which, "bodies[%td]", failed - all.begin());
    status = fail_non_finite(__func__, which, **failed);
  }
  for (exmat_body* body : all) release(*body);
  return status;
}

exmat_status exmat_body_read_report(const exmat_body* body, exmat_report* report) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(report);
  if (const exmat_status status = check_size(__func__, report->size, kReportSizes)) return status;
  give(body->report, report->size, report);
  return EXMAT_OK;
}

exmat_status exmat_body_apply_forces(exmat_body* body, const exmat_points* points, const double* forces,
                                     std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(forces);
  if (points->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", __func__);
  const RowMatrix& rows = points->set.basis_rows;
  if (rows.rows() == 0)
    return fail(EXMAT_INVALID_ARGUMENT,
                "%s: points of exmat_points_create_all_vertices() can only be read; create those to be pushed by "
                "exmat_points_create_vertices()",
                __func__);
  EXMAT_REQUIRE_LENGTH(coordinates, rows.rows());
  const BodyFrame& frame = *body->model().frame;
  const Placement placement = frame.placement(body->state.frame);
  Eigen::VectorXd& sum = body->force;
  sum.setZero();
  Eigen::Vector3d total = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < rows.rows(); i += 3) {
    const Eigen::Vector3d force = Eigen::Map<const Eigen::Vector3d>(forces + i);
    const Eigen::Vector3d displacement = rows.middleRows<3>(i).lazyProduct(body->state.q);
    const Eigen::Vector3d now = placement.to_world(points->set.rest.row(i / 3).transpose() + displacement);
    total += force;
    torque += (now - placement.position).cross(force);
    sum += rows.middleRows<3>(i).transpose().lazyProduct(placement.rotation.transpose() * force);
  }
  // A force that is not finite makes every sum so, unless it is where nothing moves.
  if (!all_finite(forces, coordinates) || !sum.allFinite())
    return fail(EXMAT_INVALID_ARGUMENT, "%s: forces: expected finite numbers", __func__);
  body->state.applied_force += sum;
  frame.apply(total, torque, body->state.frame);
  if (!body->capacity) return EXMAT_OK;
  return guarded(__func__, [&] {
    const Eigen::Map<const VertexArray> world(forces, coordinates / 3, 3);
    add_load(points->set, world * placement.rotation, *body);
  });
}

exmat_status exmat_body_clear_forces(exmat_body* body) noexcept {
  EXMAT_REQUIRE(body);
  body->state.applied_force.setZero();
  body->model().frame->clear_forces(body->state.frame);
  body->load.setZero();
  return EXMAT_OK;
}

exmat_status exmat_body_restart_integrator(exmat_body* body) noexcept {
  EXMAT_REQUIRE(body);
  body->state.begins_anew = true;
  return EXMAT_OK;
}

exmat_status exmat_body_read_positions(exmat_body* body, const exmat_points* points, float* xyz,
                                       std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(xyz);
  if (points->source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the points are those of another model", __func__);
  EXMAT_REQUIRE_LENGTH(coordinates, 3 * points->set.positions.points());
  points->set.positions.evaluate(body->state.q, body->drawing, xyz);
  if (!body->model().frame->moves()) return EXMAT_OK;
  const Placement placement = body->model().frame->placement(body->state.frame);
  for (std::int64_t i = 0; i < coordinates; i += 3) {
    Eigen::Map<Eigen::Vector3f> point(xyz + i);
    point = placement.to_world(point.cast<double>()).cast<float>();
  }
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
  const bool finite = wanted.position.allFinite() && wanted.linear_velocity.allFinite() &&
                      wanted.angular_velocity.allFinite() && std::isfinite(length);
  if (!finite || !(length > 0))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: motion: expected finite numbers and a quaternion that is not 0", __func__);
  if (!move_body(body->model(), body->scene, wanted, body->state, body->workspace))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the body has fixed vertices", __func__);
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
  const Energies now = energies(body->model(), body->scene, body->state);
  give(exmat_energies{0, now.kinetic, now.elastic, now.potential}, result->size, result);
  return EXMAT_OK;
}

double exmat_body_time(const exmat_body* body) noexcept { return body != nullptr ? body->state.time : -1; }

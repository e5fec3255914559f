#include "exmat/exmat.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <omp.h>
#include <span>
#include <string>

#include "common/config/config.h"
#include "common/core/timer.h"
#include "common/core/version.h"
#include "runtime/api/failures.h"
#include "runtime/api/handles.h"
#include "runtime/api/settings.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// HDF5 is not made for several threads.
std::mutex& reading() {
  static std::mutex mutex;
  return mutex;
}

exmat_status null_argument(const char* function, const char* argument) {
  return fail(EXMAT_INVALID_ARGUMENT, "%s: %s is NULL", function, argument);
}

exmat_status wrong_length(const char* function, const char* argument, std::int64_t found, std::int64_t expected) {
  return fail(EXMAT_INVALID_ARGUMENT, "%s: %s = %" PRId64 ": expected %" PRId64, function, argument, found, expected);
}

// Returns from the function that it stands in.
#define EXMAT_REQUIRE(argument) \
  if ((argument) == nullptr) return null_argument(__func__, #argument)
#define EXMAT_REQUIRE_LENGTH(length, expected) \
  if ((length) != static_cast<std::int64_t>(expected)) return wrong_length(__func__, #length, length, expected)

bool all_finite(const double* numbers, std::int64_t count) {
  return std::all_of(numbers, numbers + count, [](double number) { return std::isfinite(number); });
}

exmat_model* load_model(SceneConfig config) {
  config.trajectory.reset();  // positions are read when they are asked for
  auto source = std::make_shared<Source>(Source{config.bundle, load_run(config)});
  return new exmat_model{std::move(source)};
}

exmat_points* new_points(const exmat_model& model, PointSet set) {
  return new exmat_points{model.source, std::move(set)};
}

/// Only one caller at a time may step a body.
bool acquire(exmat_body& body) noexcept { return !body.in_use.test_and_set(std::memory_order_acquire); }
void release(exmat_body& body) noexcept { body.in_use.clear(std::memory_order_release); }

void add(const StepReport& step, exmat_report& sum) noexcept {
  sum.status |= step.status;
  sum.newton_iterations += step.newton_iterations;
  sum.factorisations += step.factorisations;
  sum.line_search_evaluations += step.line_search_evaluations;
  sum.projections += step.projections;
  sum.target_iterations += step.target_iterations;
  sum.residual = step.residual;
}

void advance(exmat_body& body, std::int64_t steps) noexcept {
  const Timer timer;
  body.report = {};
  while (body.report.steps < steps) {
    const StepReport report = step(body.model(), body.scene, body.state, body.workspace);
    add(report, body.report);
    if ((report.status & kStepNonFinite) != 0) break;
    ++body.report.steps;
  }
  body.report.seconds = timer.seconds();
}

bool non_finite(const exmat_body& body) noexcept { return (body.report.status & kStepNonFinite) != 0; }

exmat_status fail_non_finite(const char* function, const char* which, const exmat_body& body) noexcept {
  return fail(EXMAT_NON_FINITE,
              "%s: %s, step %" PRId64
              " (t = %g s): NaN or infinity; the body is as it was before. Try a smaller "
              "time_step (now %g s), smaller loads or example stiffness, or EXMAT_BACKWARD_EULER",
              function, which, body.state.step + 1, body.state.time + body.scene.time_step, body.scene.time_step);
}

void put_to_rest(exmat_body& body) noexcept {
  body.state = body.start;  // vectors of the same lengths: no allocation
  body.report = {};
}

exmat_status check_size(const char* function, std::size_t size, const StructSizes& sizes) noexcept {
  if (sizes.first <= size && size <= kMostStructBytes) return EXMAT_OK;
  return fail(EXMAT_INVALID_ARGUMENT, "%s: size = %zu: expected %zu, the sizeof of the struct", function, size,
              sizes.now);
}

/// As much as a caller of another version knows.
template <typename Struct>
void give(Struct from, std::size_t size, Struct* to) noexcept {
  from.size = size;
  if (size > sizeof from) std::memset(static_cast<void*>(to), 0, size);
  std::memcpy(static_cast<void*>(to), &from, std::min(size, sizeof from));
}

}  // namespace

exmat_body::exmat_body(std::shared_ptr<const Source> its_source)
    : source(std::move(its_source)),
      scene(source->loaded.scene),
      start(source->loaded.start),
      workspace(model(), scene),
      drawing(VertexPositions::make_workspace(model().modes())),
      force(Eigen::VectorXd::Zero(model().modes())) {
  refresh_weights(model(), scene, start, workspace);
  state = start;
}

const char* exmat_last_error(void) noexcept { return last_failure(); }

const char* exmat_version(void) noexcept { return version().data(); }

// ---- models ---------------------------------------------------------------------------------------------------------

exmat_status exmat_settings_default(exmat_settings* settings, std::size_t size) noexcept {
  EXMAT_REQUIRE(settings);
  if (const exmat_status status = check_size(__func__, size, kSettingsSizes)) return status;
  give(default_settings(), size, settings);
  return EXMAT_OK;
}

exmat_status exmat_model_create(const char* bundle_path, const exmat_settings* settings, exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  EXMAT_REQUIRE(bundle_path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *model = load_model(scene_of(bundle_path, settings));
  });
}

exmat_status exmat_model_create_from_scene(const char* scene_path, exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  EXMAT_REQUIRE(scene_path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *model = load_model(load_scene(scene_path));
  });
}

void exmat_model_destroy(exmat_model* model) noexcept { delete model; }

std::int64_t exmat_model_modes(const exmat_model* model) noexcept {
  return model != nullptr ? model->model().modes() : -1;
}

std::int64_t exmat_model_vertices(const exmat_model* model) noexcept {
  return model != nullptr ? model->source->loaded.summary.vertices : -1;
}

std::int64_t exmat_model_examples(const exmat_model* model) noexcept {
  return model != nullptr ? model->model().example_count() : -1;
}

std::int64_t exmat_model_regions(const exmat_model* model) noexcept {
  return model != nullptr ? model->model().region_count() : -1;
}

std::int64_t exmat_model_region_examples(const exmat_model* model, std::int64_t region) noexcept {
  const ExampleModel* examples = model != nullptr ? model->model().region(region) : nullptr;
  return examples != nullptr ? examples->weights.examples() : -1;
}

const char* exmat_model_region_name(const exmat_model* model, std::int64_t region) noexcept {
  const ExampleModel* examples = model != nullptr ? model->model().region(region) : nullptr;
  return examples != nullptr ? examples->region.c_str() : nullptr;
}

double exmat_model_time_step(const exmat_model* model) noexcept {
  return model != nullptr ? model->source->loaded.scene.time_step : -1;
}

// ---- points ---------------------------------------------------------------------------------------------------------

exmat_status exmat_points_create_vertices(const exmat_model* model, const std::int64_t* ids, std::int64_t count,
                                          exmat_points** points) noexcept {
  EXMAT_REQUIRE(points);
  *points = nullptr;
  EXMAT_REQUIRE(model);
  EXMAT_REQUIRE(ids);
  if (count < 1) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected at least 1", __func__, count);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *points = new_points(*model, read_vertices(*model->source, {ids, static_cast<std::size_t>(count)}));
  });
}

exmat_status exmat_points_create_all_vertices(const exmat_model* model, exmat_points** points) noexcept {
  EXMAT_REQUIRE(points);
  *points = nullptr;
  EXMAT_REQUIRE(model);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *points = new_points(*model, read_all_vertices(*model->source));
  });
}

exmat_status exmat_points_create_at(const exmat_model* model, const double* xyz, std::int64_t coordinates,
                                    exmat_points** points) noexcept {
  EXMAT_REQUIRE(points);
  *points = nullptr;
  EXMAT_REQUIRE(model);
  EXMAT_REQUIRE(xyz);
  if (coordinates < 3 || coordinates % 3 != 0)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: coordinates = %" PRId64 ": expected 3 for each point", __func__,
                coordinates);
  if (!all_finite(xyz, coordinates)) return fail(EXMAT_INVALID_ARGUMENT, "%s: xyz: expected finite numbers", __func__);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *points =
        new_points(*model, read_points_at(*model->source, Eigen::Map<const VertexArray>(xyz, coordinates / 3, 3)));
  });
}

void exmat_points_destroy(exmat_points* points) noexcept { delete points; }

std::int64_t exmat_points_count(const exmat_points* points) noexcept {
  return points != nullptr ? points->set.positions.points() : -1;
}

exmat_status exmat_points_distances(const exmat_points* points, double* distances, std::int64_t count) noexcept {
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(distances);
  EXMAT_REQUIRE_LENGTH(count, points->set.distances.size());
  std::copy_n(points->set.distances.data(), count, distances);
  return EXMAT_OK;
}

// ---- bodies ---------------------------------------------------------------------------------------------------------

exmat_status exmat_body_create(const exmat_model* model, exmat_body** body) noexcept {
  EXMAT_REQUIRE(body);
  *body = nullptr;
  EXMAT_REQUIRE(model);
  return guarded(__func__, [&] { *body = std::make_unique<exmat_body>(model->source).release(); });
}

void exmat_body_destroy(exmat_body* body) noexcept { delete body; }

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
  if (!acquire(*body)) return fail(EXMAT_INVALID_ARGUMENT, "%s: another thread steps this body", __func__);
  advance(*body, steps);
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
  const auto taken = std::ranges::find_if(all, [](exmat_body* body) { return !acquire(*body); });
  if (taken != all.end()) {
    std::for_each(all.begin(), taken, [](exmat_body* body) { release(*body); });
    return fail(EXMAT_INVALID_ARGUMENT, "%s: bodies[%td] is listed twice, or another thread steps it", __func__,
                taken - all.begin());
  }
  const int wanted = threads > 0 ? threads : omp_get_num_procs();
  const int used = static_cast<int>(std::min<std::int64_t>(wanted, count));
#pragma omp parallel for schedule(dynamic) num_threads(used) if (used > 1)
  for (std::int64_t i = 0; i < count; ++i) advance(*bodies[i], steps);
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

exmat_status exmat_body_report(const exmat_body* body, exmat_report* report) noexcept {
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
  return EXMAT_OK;
}

exmat_status exmat_body_clear_forces(exmat_body* body) noexcept {
  EXMAT_REQUIRE(body);
  body->state.applied_force.setZero();
  body->model().frame->clear_forces(body->state.frame);
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
  const FrameMotion now = body->model().frame->motion(body->state.frame);
  for (int i = 0; i < 3; ++i) {
    motion->position[i] = now.position[i];
    motion->orientation[i + 1] = now.orientation.vec()[i];
    motion->linear_velocity[i] = now.linear_velocity[i];
    motion->angular_velocity[i] = now.angular_velocity[i];
  }
  motion->orientation[0] = now.orientation.w();
  return EXMAT_OK;
}

exmat_status exmat_body_set_motion(exmat_body* body, const exmat_motion* motion) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(motion);
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
  State& state = body->state;
  if (!body->model().frame->set_motion(wanted, state.q, state.v, body->workspace.frame, state.frame))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the body has fixed vertices", __func__);
  body->state.begins_anew = true;
  return EXMAT_OK;
}

exmat_status exmat_body_read_reduced(const exmat_body* body, double* q, double* v, std::int64_t modes) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE_LENGTH(modes, body->modes());
  if (q != nullptr) std::copy_n(body->state.q.data(), modes, q);
  if (v != nullptr) std::copy_n(body->state.v.data(), modes, v);
  return EXMAT_OK;
}

exmat_status exmat_body_weights(const exmat_body* body, double* weights, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE_LENGTH(count, body->model().example_count());
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(weights);
  std::copy_n(body->state.examples.front().weights.data(), count, weights);
  return EXMAT_OK;
}

exmat_status exmat_body_region_weights(const exmat_body* body, std::int64_t region, double* weights,
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

exmat_status exmat_body_energies(const exmat_body* body, exmat_energies* result) noexcept {
  EXMAT_REQUIRE(body);
  if (result == nullptr) return null_argument(__func__, "energies");
  const Energies now = energies(body->model(), body->scene, body->state);
  *result = {now.kinetic, now.elastic, now.potential};
  return EXMAT_OK;
}

double exmat_body_time(const exmat_body* body) noexcept { return body != nullptr ? body->state.time : -1; }

#include "exmat/exmat.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <string>

#include "common/core/version.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"
#include "runtime/api/loading.h"
#include "runtime/api/reading.h"
#include "runtime/api/settings.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

exmat_points* new_points(const exmat_model& model, PointSet set) {
  return new exmat_points{model.source, std::move(set)};
}

}  // namespace

namespace exmat::runtime {

exmat_model* load_model(SceneConfig config) {
  config.trajectory.reset();  // positions are read when they are asked for
  auto source = std::make_shared<Source>(Source{bundle_of(config), load_run(config)});
  return new exmat_model{std::move(source)};
}

}  // namespace exmat::runtime

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

exmat_status exmat_model_create_from_memory(const void* data, std::size_t size, const exmat_settings* settings,
                                            exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  EXMAT_REQUIRE(data);
  return guarded(__func__, [&] {
    SceneConfig config = scene_of("the pack in memory", settings);
    config.pack = std::make_shared<const std::string>(static_cast<const char*>(data), size);
    *model = load_model(std::move(config));
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

const char* exmat_model_input_sha256(const exmat_model* model) noexcept {
  return model != nullptr ? model->source->loaded.summary.input_sha256.c_str() : nullptr;
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
  if (const double* const far = find_far(xyz, coordinates))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: xyz[%td] = %g: expected finite numbers of at most %g m", __func__,
                far - xyz, *far, kFarthest);
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

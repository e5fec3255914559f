#include <cinttypes>
#include <mutex>
#include <optional>

#include "common/config/config.h"
#include "common/config/json_file.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/loading.h"
#include "runtime/api/reading.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// Makes a model or a world of a scene's text, under the lock of all reading.
template <typename Handle, typename Load>
exmat_status create_from_text(const char* function, const char* scene, const char* path, std::int32_t use_contact,
                              Handle** made, const Load& load) {
  if (scene == nullptr) return null_argument(function, "scene");
  if (path == nullptr) return null_argument(function, "path");
  if (use_contact != 0 && use_contact != 1)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: use_contact = %" PRId32 ": expected 0 or 1", function, use_contact);
  return guarded(function, [&] {
    const std::lock_guard lock(reading());
    *made = load(parse_json(scene, path));
  });
}

/// Positions are read when they are asked for.
exmat_world* load_without_trajectory(WorldConfig config) {
  set_trajectory(std::nullopt, config);
  return exmat::runtime::load_world(config).release();
}

}  // namespace

exmat_status exmat_model_create_from_scene(const char* scene_path, exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  EXMAT_REQUIRE(scene_path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *model = load_model(load_scene(scene_path));
  });
}

exmat_status exmat_model_create_from_text(const char* scene, const char* path, std::int32_t use_contact,
                                          exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  return create_from_text(__func__, scene, path, use_contact, model, [&](const nlohmann::json& json) {
    SceneConfig config = exmat::scene_of(json, path);
    config.meets_others = use_contact == 1;
    return load_model(std::move(config));
  });
}

exmat_status exmat_world_create_from_scene(const char* scene_path, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  EXMAT_REQUIRE(scene_path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *world = load_without_trajectory(exmat::load_world(scene_path));
  });
}

exmat_status exmat_world_create_from_text(const char* scene, const char* path, std::int32_t use_contact,
                                          exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  return create_from_text(__func__, scene, path, use_contact, world, [&](const nlohmann::json& json) {
    WorldConfig config = world_of(json, path);
    for (BodiesConfig& bodies : config.bodies) bodies.scene.meets_others = use_contact == 1;
    return load_without_trajectory(std::move(config));
  });
}

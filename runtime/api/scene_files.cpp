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
  EXMAT_REQUIRE(scene);
  EXMAT_REQUIRE(path);
  if (use_contact != 0 && use_contact != 1)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: use_contact = %" PRId32 ": expected 0 or 1", __func__, use_contact);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    SceneConfig config = exmat::scene_of(parse_json(scene, path), path);
    config.meets_others = use_contact == 1;
    *model = load_model(std::move(config));
  });
}

exmat_status exmat_world_create_from_scene(const char* scene_path, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  EXMAT_REQUIRE(scene_path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    WorldConfig config = exmat::load_world(scene_path);
    set_trajectory(std::nullopt, config);  // positions are read when they are asked for
    *world = exmat::runtime::load_world(config).release();
  });
}

exmat_status exmat_world_create_from_text(const char* scene, const char* path, std::int32_t use_contact,
                                          exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  EXMAT_REQUIRE(scene);
  EXMAT_REQUIRE(path);
  if (use_contact != 0 && use_contact != 1)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: use_contact = %" PRId32 ": expected 0 or 1", __func__, use_contact);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    WorldConfig config = world_of(parse_json(scene, path), path);
    for (BodiesConfig& bodies : config.bodies) bodies.scene.meets_others = use_contact == 1;
    set_trajectory(std::nullopt, config);
    *world = exmat::runtime::load_world(config).release();
  });
}

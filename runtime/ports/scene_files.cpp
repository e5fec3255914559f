#include "common/bundle/scene_places.h"
#include "common/core/error.h"
#include "common/surface_io/height_reader.h"
#include "common/surface_io/plain_surface.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/failures.h"

using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// Builds without HDF5 read packs and settings; scenes, and the meshes that they name, are files of JSON and others.

namespace exmat {
namespace {

[[noreturn]] void refuse_file(const std::filesystem::path& file) {
  throw InputError({file.string(), "", "", "", "this build reads no meshes: make a shape of arrays"});
}

}  // namespace

SurfaceFile read_plain_surface(const std::filesystem::path& file) { refuse_file(file); }

RowMatrix read_heights(const std::filesystem::path& file) { refuse_file(file); }

// Settings name no forces and no attachments.
std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config) { return config.forces; }
std::vector<std::int32_t> select_vertices(const SceneConfig&, const ObjectData&, const VertexSelection&,
                                          const std::string&) {
  return {};
}

}  // namespace exmat

namespace {

exmat_status refuse(const char* function) noexcept {
  return fail(EXMAT_FAILURE, "%s: this build reads no scenes: give settings and a pack", function);
}

}  // namespace

exmat_status exmat_model_create_from_scene(const char*, exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  return refuse(__func__);
}

exmat_status exmat_model_create_from_text(const char*, const char*, std::int32_t, exmat_model** model) noexcept {
  EXMAT_REQUIRE(model);
  *model = nullptr;
  return refuse(__func__);
}

exmat_status exmat_world_create_from_scene(const char*, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  return refuse(__func__);
}

exmat_status exmat_world_create_from_text(const char*, const char*, std::int32_t, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  return refuse(__func__);
}

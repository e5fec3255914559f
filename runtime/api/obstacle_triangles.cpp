#include <cinttypes>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/world_handle.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// Triangles of obstacles that are made of arrays.

namespace {

/// Null where the world has none of that number.
const Obstacle* obstacle_of(const exmat_world& world, std::int64_t id) noexcept {
  const std::ptrdiff_t place = place_of_obstacle(world, id);
  return place >= 0 ? world.obstacles[static_cast<std::size_t>(place)].obstacle.get() : nullptr;
}

std::int64_t count_of(const Shape& shape) noexcept {
  if (const auto* const mesh = std::get_if<MeshShape>(&shape)) return mesh->mesh->triangles();
  if (const auto* const field = std::get_if<HeightFieldShape>(&shape)) return field->field->triangles();
  return 0;
}

/// Corners of all of them, from its own axes into the obstacle's frame.
template <typename Triangles>
void write_corners(const Triangles& from, const Eigen::Vector3d& position, const Eigen::Matrix3d& rotation,
                   double* corners) noexcept {
  for (Eigen::Index triangle = 0; triangle < from.triangles(); ++triangle)
    for (const Eigen::Vector3d& corner : from.corners(triangle)) {
      Eigen::Map<Eigen::Vector3d>(corners).noalias() = position + rotation * corner;
      corners += 3;
    }
}

}  // namespace

std::int64_t exmat_world_obstacle_triangles(const exmat_world* world, std::int64_t id) noexcept {
  const Obstacle* const obstacle = world != nullptr ? obstacle_of(*world, id) : nullptr;
  return obstacle != nullptr ? count_of(obstacle->shape) : -1;
}

exmat_status exmat_world_read_obstacle_triangles(const exmat_world* world, std::int64_t id, double* corners,
                                                 std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(world);
  const Obstacle* const obstacle = obstacle_of(*world, id);
  if (obstacle == nullptr)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: id = %" PRId64 ": the world has no such obstacle", __func__, id);
  const std::int64_t count = count_of(obstacle->shape);
  EXMAT_REQUIRE_LENGTH(coordinates, 9 * count);
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(corners);
  if (const auto* const mesh = std::get_if<MeshShape>(&obstacle->shape))
    write_corners(*mesh->mesh, mesh->position, mesh->rotation, corners);
  if (const auto* const field = std::get_if<HeightFieldShape>(&obstacle->shape))
    write_corners(*field->field, field->position, field->rotation, corners);
  return EXMAT_OK;
}

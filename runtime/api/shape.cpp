#include <Eigen/Core>
#include <cinttypes>
#include <cmath>
#include <fmt/format.h>
#include <memory>

#include "common/mesh/surface_check.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

constexpr std::int64_t kMost = 2147483647;  // vertices, triangles and heights

std::shared_ptr<const RigidMesh> mesh_of(const VertexArray& vertices, TriangleArray triangles, double thickness) {
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c)
      if (triangles(t, c) < 0 || triangles(t, c) >= vertices.rows())
        throw InvalidArgument(fmt::format("triangles[{}] = {}: expected a vertex, 0 to {}", 3 * t + c, triangles(t, c),
                                          vertices.rows() - 1));
  weld(vertices, triangles);
  if (triangles.rows() == 0) throw InvalidArgument("triangles: expected some with corners at three places");
  if (const SurfaceFaults faults = surface_faults(triangles); thickness == 0 && faults.any())
    throw InvalidArgument(
        fmt::format("triangles: expected a closed mesh, each edge of two triangles that look the same "
                    "way out, found {}; close it and turn its faces outward, or give a thickness",
                    faults.words()));
  return std::make_shared<const RigidMesh>(vertices, triangles, thickness);
}

}  // namespace

exmat_status exmat_shape_create_mesh(const double* vertices, std::int64_t coordinates, const std::int32_t* triangles,
                                     std::int64_t corners, double thickness, exmat_shape** shape) noexcept {
  EXMAT_REQUIRE(shape);
  *shape = nullptr;
  EXMAT_REQUIRE(vertices);
  EXMAT_REQUIRE(triangles);
  if (coordinates < 3 || coordinates % 3 != 0 || coordinates / 3 > kMost)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: coordinates = %" PRId64 ": expected 3 for each vertex", __func__,
                coordinates);
  if (corners < 3 || corners % 3 != 0 || corners / 3 > kMost)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: corners = %" PRId64 ": expected 3 for each triangle", __func__, corners);
  if (const double* const far = find_far(vertices, coordinates))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: vertices[%td] = %g: expected finite numbers of at most %g m", __func__,
                far - vertices, *far, kFarthest);
  if (!(thickness >= 0 && thickness <= kFarthest))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: thickness = %g: expected a number >= 0, of at most %g m", __func__,
                thickness, kFarthest);
  return guarded(__func__, [&] {
    const Eigen::Map<const VertexArray> places(vertices, coordinates / 3, 3);
    const Eigen::Map<const TriangleArray> faces(triangles, corners / 3, 3);
    *shape = new exmat_shape{mesh_of(places, faces, thickness), nullptr};
  });
}

exmat_status exmat_shape_create_height_field(const double* heights, std::int64_t rows, std::int64_t columns,
                                             const double* spacing, exmat_shape** shape) noexcept {
  EXMAT_REQUIRE(shape);
  *shape = nullptr;
  EXMAT_REQUIRE(heights);
  EXMAT_REQUIRE(spacing);
  if (rows < 2 || columns < 2 || rows > kMost / columns)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: %" PRId64 " rows, %" PRId64 " columns: expected 2 or more of each",
                __func__, rows, columns);
  if (const double* const far = find_far(heights, rows * columns))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: heights[%td] = %g: expected finite numbers of at most %g m", __func__,
                far - heights, *far, kFarthest);
  if (find_far(spacing, 2) != nullptr || !(spacing[0] > 0 && spacing[1] > 0))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: spacing: expected two numbers above 0, of at most %g m", __func__,
                kFarthest);
  return guarded(__func__, [&] {
    *shape =
        new exmat_shape{nullptr, std::make_shared<const HeightField>(
                                     Eigen::Map<const RowMatrix>(heights, rows, columns), Eigen::Vector2d(spacing))};
  });
}

void exmat_shape_destroy(exmat_shape* shape) noexcept { delete shape; }

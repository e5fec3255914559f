#include <Eigen/Geometry>
#include <algorithm>
#include <cinttypes>
#include <fmt/format.h>
#include <vector>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"
#include "runtime/api/reading.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// Basis rows of points on triangles of a surface.
PointSet points_on_surface(const exmat_surface& surface, const std::int64_t* triangles,
                           const Eigen::Map<const RowMatrix>& shares) {
  const PointSet& points = surface.points.set;
  const TriangleArray& corners = surface.drawn.triangles;
  PointSet result;
  result.basis_rows.setZero(3 * shares.rows(), points.basis_rows.cols());
  result.rest.setZero(shares.rows(), 3);
  const Eigen::Index each = points.corners.cols();
  result.corners.resize(shares.rows(), 3 * each);
  result.shares.resize(shares.rows(), 3 * each);
  for (Eigen::Index i = 0; i < shares.rows(); ++i) {
    if (triangles[i] < 0 || triangles[i] >= corners.rows())
      throw InvalidArgument(fmt::format("triangles[{}] = {}: expected 0 to {}", i, triangles[i], corners.rows() - 1));
    for (int c = 0; c < 3; ++c) {
      const std::int32_t corner = corners(triangles[i], c);
      result.basis_rows.middleRows<3>(3 * i) +=
          shares(i, c) * points.basis_rows.middleRows<3>(3 * static_cast<Eigen::Index>(corner));
      result.rest.row(i) += shares(i, c) * points.rest.row(corner);
      result.corners.block(i, c * each, 1, each) = points.corners.row(corner);
      result.shares.block(i, c * each, 1, each) = shares(i, c) * points.shares.row(corner);
    }
  }
  result.positions = VertexPositions(result.rest, result.basis_rows);
  result.distances = Eigen::VectorXd::Zero(shares.rows());
  return result;
}

}  // namespace

exmat_status exmat_surface_create(const exmat_model* model, std::int32_t kind, exmat_surface** surface) noexcept {
  EXMAT_REQUIRE(surface);
  *surface = nullptr;
  EXMAT_REQUIRE(model);
  if (kind < EXMAT_SURFACE_AUTO || kind > EXMAT_SURFACE_RENDER)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: kind = %" PRId32 ": expected 0 to 2", __func__, kind);
  return guarded(__func__, [&] {
    const bool has_render = model->source->loaded.summary.render_vertices > 0;
    if (kind == EXMAT_SURFACE_RENDER && !has_render) throw InvalidArgument("the bundle has no render mesh");
    const std::lock_guard lock(reading());
    ReadSurface read = read_surface(*model->source, has_render && kind != EXMAT_SURFACE_OBJECT);
    const DeformedBox box(read.points);
    *surface = new exmat_surface{{model->source, std::move(read.points)}, std::move(read.drawn), box};
  });
}

void exmat_surface_destroy(exmat_surface* surface) noexcept { delete surface; }

std::int32_t exmat_surface_kind(const exmat_surface* surface) noexcept {
  if (surface == nullptr) return -1;
  return surface->drawn.render ? EXMAT_SURFACE_RENDER : EXMAT_SURFACE_OBJECT;
}

std::int64_t exmat_surface_triangles(const exmat_surface* surface) noexcept {
  return surface != nullptr ? surface->drawn.triangles.rows() : -1;
}

exmat_status exmat_surface_read_triangles(const exmat_surface* surface, std::int32_t* triangles,
                                          std::int64_t count) noexcept {
  EXMAT_REQUIRE(surface);
  EXMAT_REQUIRE(triangles);
  EXMAT_REQUIRE_LENGTH(count, surface->drawn.triangles.size());
  std::copy_n(surface->drawn.triangles.data(), count, triangles);
  return EXMAT_OK;
}

const exmat_points* exmat_surface_points(const exmat_surface* surface) noexcept {
  return surface != nullptr ? &surface->points : nullptr;
}

exmat_status exmat_surface_read_vertices(const exmat_surface* surface, std::int64_t* vertices,
                                         std::int64_t count) noexcept {
  EXMAT_REQUIRE(surface);
  EXMAT_REQUIRE(vertices);
  EXMAT_REQUIRE_LENGTH(count, surface->drawn.vertices.size());
  std::copy_n(surface->drawn.vertices.data(), count, vertices);
  return EXMAT_OK;
}

exmat_status exmat_surface_read_normals(const exmat_surface* surface, const float* xyz, float* normals,
                                        std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(surface);
  EXMAT_REQUIRE(xyz);
  EXMAT_REQUIRE(normals);
  const Eigen::Index points = surface->points.set.positions.points();
  EXMAT_REQUIRE_LENGTH(coordinates, 3 * points);
  const auto length = static_cast<std::size_t>(coordinates);
  surface->drawn.normals.read({xyz, length}, {normals, length});
  return EXMAT_OK;
}

exmat_status exmat_points_create_on_surface(const exmat_surface* surface, const std::int64_t* triangles,
                                            const double* shares, std::int64_t count, exmat_points** points) noexcept {
  EXMAT_REQUIRE(points);
  *points = nullptr;
  EXMAT_REQUIRE(surface);
  EXMAT_REQUIRE(triangles);
  EXMAT_REQUIRE(shares);
  if (count < 1) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected at least 1", __func__, count);
  constexpr double kSumTolerance = 1e-6;
  const Eigen::Map<const RowMatrix> given(shares, count, 3);
  if (!(given.array() >= -kSumTolerance).all() || !((given.rowwise().sum().array() - 1).abs() <= kSumTolerance).all())
    return fail(EXMAT_INVALID_ARGUMENT, "%s: shares: expected numbers from 0 on, three of each point with sum 1",
                __func__);
  return guarded(__func__, [&] {
    *points = new exmat_points{surface->points.source, points_on_surface(*surface, triangles, given)};
  });
}

exmat_status exmat_points_create_elements(const exmat_model* model, exmat_points** points) noexcept {
  EXMAT_REQUIRE(points);
  *points = nullptr;
  EXMAT_REQUIRE(model);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *points = new exmat_points{model->source, read_elements(*model->source)};
  });
}

exmat_status exmat_points_read_rest(const exmat_points* points, double* rest, std::int64_t coordinates) noexcept {
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(rest);
  if (const exmat_status status = require_rows(__func__, points->set)) return status;
  EXMAT_REQUIRE_LENGTH(coordinates, points->set.rest.size());
  std::copy_n(points->set.rest.data(), coordinates, rest);
  return EXMAT_OK;
}

exmat_status exmat_points_read_basis(const exmat_points* points, float* rows, std::int64_t count) noexcept {
  EXMAT_REQUIRE(points);
  EXMAT_REQUIRE(rows);
  if (const exmat_status status = require_rows(__func__, points->set)) return status;
  const RowMatrix& basis = points->set.basis_rows;
  EXMAT_REQUIRE_LENGTH(count, basis.size());
  std::transform(basis.data(), basis.data() + count, rows, [](double entry) { return static_cast<float>(entry); });
  return EXMAT_OK;
}

exmat_status exmat_body_read_placement(const exmat_body* body, double* placement) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(placement);
  const Placement now = body->model().frame->placement(body->state.frame);
  Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> rows(placement);
  rows.leftCols<3>() = now.rotation;
  rows.col(3) = now.to_world(Eigen::Vector3d::Zero());
  return EXMAT_OK;
}

exmat_status exmat_body_read_energy_density(const exmat_body* body, exmat_surface* surface, float* density,
                                            std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(surface);
  EXMAT_REQUIRE(density);
  if (surface->points.source != body->source)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the surface is that of another model", __func__);
  EXMAT_REQUIRE_LENGTH(count, surface->drawn.density.points());
  const Placement placement = body->model().frame->placement(body->state.frame);
  surface->drawn.density.evaluate(body->state, body->full(), placement, density);
  return EXMAT_OK;
}

#include "runtime/api/point_set.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/bundle/bundle.h"
#include "common/mesh/elements.h"
#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"
#include "runtime/api/failures.h"

namespace exmat::runtime {
namespace {

using Ids = std::vector<std::int64_t>;

/// Rows of single vertices are read one by one up to this share of all.
constexpr std::size_t kWholeBasisAbove = 8;

/// Distances below this share of the diagonal of the bounding box are 0.
constexpr double kRelativeRounding = 1e-12;

RowMatrix rows_of(const Source& source, const Ids& ids) {
  if (ids.size() * kWholeBasisAbove < static_cast<std::size_t>(source.loaded.summary.vertices))
    return read_basis_rows(source.bundle, ids);
  const RowMatrix basis = read_rest(source, /*basis=*/true).modal->basis;
  RowMatrix rows(3 * std::ssize(ids), basis.cols());
  for (std::size_t i = 0; i < ids.size(); ++i)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = basis.middleRows<3>(3 * ids[i]);
  return rows;
}

}  // namespace

exmat_status require_rows(const char* function, const PointSet& points) noexcept {
  if (points.basis_rows.rows() > 0) return EXMAT_OK;
  return fail(EXMAT_INVALID_ARGUMENT,
              "%s: points that were made as all vertices can only be read, in single precision; make points of "
              "vertices by their ids, which can be pushed",
              function);
}

void require_same_bundle(const Source& source, const ReducedModel& data) {
  const BundleSummary& summary = source.loaded.summary;
  if (data.input_sha256 != summary.input_sha256 || data.object->mesh.vertex_count() != summary.vertices)
    throw InputError({source.bundle.file().string(), "/", "the bundle that the model was created from", "another one",
                      "create the model again"});
}

ReducedModel read_rest(const Source& source, bool basis) {
  const std::string reason = "points are asked for";
  const std::vector<LedgerEntry> groups{{"object", true, 0, reason}, {"modal", basis, 0, reason}};
  ReducedModel data = read_bundle(source.bundle, {.groups = groups, .step_only = true, .positions = true});
  require_same_bundle(source, data);
  return data;
}

ReducedModel read_groups(const Source& source, const std::vector<std::string>& groups) {
  std::vector<LedgerEntry> wanted;
  for (const std::string& group : groups) wanted.push_back({group, true, 0, "a host program asks for it"});
  ReducedModel data = read_bundle(source.bundle, {.groups = wanted});
  require_same_bundle(source, data);
  return data;
}

PointSet embedded_points(const RowMatrix& basis, const VertexArray& rest, const Eigen::Ref<const IndexMatrix>& corners,
                         const Eigen::Ref<const RowMatrix>& shares) {
  PointSet points;
  points.basis_rows.setZero(3 * rest.rows(), basis.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    for (Eigen::Index c = 0; c < corners.cols(); ++c)
      points.basis_rows.middleRows<3>(3 * i) += shares(i, c) * basis.middleRows<3>(3 * corners(i, c));
  points.positions = VertexPositions(rest, points.basis_rows);
  points.rest = rest;
  points.corners = corners;
  points.shares = shares;
  points.distances = Eigen::VectorXd::Zero(rest.rows());
  return points;
}

PointSet read_elements(const Source& source) {
  const ReducedModel data = read_groups(source, {"object", "modal", "cubature"});
  const TetMesh& mesh = data.object->mesh;
  const bool rings = data.object->materials.formulation == Formulation::kSmoothed;
  const IndexVector centres = rings ? elements_of(mesh, data.object->materials).centres : IndexVector();
  const IndexVector& elements = data.cubature->elements;
  // A ring is at its vertex, a tet at its centroid.
  const Eigen::Index k = rings ? 1 : 4;
  IndexMatrix corners(elements.size(), k);
  VertexArray rest = VertexArray::Zero(elements.size(), 3);
  for (Eigen::Index j = 0; j < elements.size(); ++j) {
    if (rings)
      corners(j, 0) = centres[elements[j]];
    else
      corners.row(j) = mesh.tets.row(elements[j]);
    for (Eigen::Index c = 0; c < k; ++c) rest.row(j) += mesh.vertices.row(corners(j, c)) / static_cast<double>(k);
  }
  return embedded_points(data.modal->basis, rest, corners,
                         RowMatrix::Constant(elements.size(), k, 1 / static_cast<double>(k)));
}

PointSet read_vertices(const Source& source, std::span<const std::int64_t> ids) {
  const ReducedModel data = read_rest(source, /*basis=*/false);
  const VertexArray& vertices = data.object->mesh.vertices;
  VertexArray rest(std::ssize(ids), 3);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] < 0 || ids[i] >= vertices.rows())
      throw InvalidArgument(
          fmt::format("ids[{}] = {}: expected vertices of the object, 0 to {}", i, ids[i], vertices.rows() - 1));
    rest.row(static_cast<Eigen::Index>(i)) = vertices.row(ids[i]);
  }
  PointSet points;
  points.basis_rows = rows_of(source, Ids(ids.begin(), ids.end()));
  points.positions = VertexPositions(rest, points.basis_rows);
  points.rest = rest;
  points.corners = Eigen::Map<const Eigen::Matrix<std::int64_t, Eigen::Dynamic, 1>>(ids.data(), std::ssize(ids))
                       .cast<IndexMatrix::Scalar>();
  points.shares = RowMatrix::Ones(rest.rows(), 1);
  points.distances = Eigen::VectorXd::Zero(rest.rows());
  return points;
}

PointSet read_all_vertices(const Source& source) {
  const ReducedModel data = read_rest(source, /*basis=*/true);
  PointSet points;
  points.positions = VertexPositions(data.object->mesh.vertices, data.modal->basis);
  points.basis_rows.resize(0, data.modal->basis.cols());
  points.rest = data.object->mesh.vertices;
  points.corners = IndexVector::LinSpaced(points.rest.rows(), 0, static_cast<std::int32_t>(points.rest.rows() - 1));
  points.shares = RowMatrix::Ones(points.rest.rows(), 1);
  points.distances = Eigen::VectorXd::Zero(data.object->mesh.vertex_count());
  return points;
}

PointSet read_points_at(const Source& source, const VertexArray& rest) {
  const ReducedModel data = read_rest(source, /*basis=*/false);
  const TetMesh& mesh = data.object->mesh;
  const NearestPointSearch search(mesh);
  const double rounding = kRelativeRounding * bounding_box_diagonal(mesh.vertices);
  PointSet points;
  points.distances.resize(rest.rows());
  Eigen::Matrix<std::int64_t, Eigen::Dynamic, 4> corners(rest.rows(), 4);
  Eigen::Matrix<double, Eigen::Dynamic, 4> shares(rest.rows(), 4);
  for (Eigen::Index i = 0; i < rest.rows(); ++i) {
    const NearestPoint hit = search.nearest(rest.row(i));
    points.distances[i] = hit.distance < rounding ? 0 : hit.distance;
    corners.row(i) = mesh.tets.row(hit.tet).cast<std::int64_t>();
    shares.row(i) = barycentric(tet_positions(mesh, hit.tet), rest.row(i));
  }
  Ids ids(corners.data(), corners.data() + corners.size());
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  const RowMatrix rows = rows_of(source, ids);
  points.basis_rows.setZero(3 * rest.rows(), rows.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    for (int corner = 0; corner < 4; ++corner) {
      const auto row = std::ranges::lower_bound(ids, corners(i, corner)) - ids.begin();
      points.basis_rows.middleRows<3>(3 * i) += shares(i, corner) * rows.middleRows<3>(3 * row);
    }
  points.positions = VertexPositions(rest, points.basis_rows);
  points.rest = rest;
  points.corners = corners.cast<IndexMatrix::Scalar>();
  points.shares = shares;
  return points;
}

}  // namespace exmat::runtime

#include "precompute/render/embedding.h"

#include <fmt/format.h>

#include "common/core/log.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {

Embedding embed_points(const TetMesh& mesh, const VertexArray& points, const std::string& name) {
  Embedding embedding{nearest_points(mesh, points)};
  auto& [tets, weights, distances] = embedding.points;
  for (Eigen::Index k = 0; k < points.rows(); ++k)
    weights.row(k) = barycentric(tet_positions(mesh, tets[k]), points.row(k).transpose());
  if (points.rows() == 0) return embedding;
  const double diagonal = bounding_box_diagonal(mesh.vertices);
  embedding.outside = (distances.array() > kOnSurface * diagonal).count();
  embedding.farthest = distances.maxCoeff();
  if (embedding.outside > 0)
    log::info(fmt::format(
        "{}: {} of {} points are outside the body, by up to {:.3g} m ({:.3g} % of the diagonal of its bounding box); "
        "they move with the nearest tet",
        name, embedding.outside, points.rows(), embedding.farthest, 100 * embedding.farthest / diagonal));
  return embedding;
}

}  // namespace exmat::precompute

#include "runtime/api/drawn_surface.h"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"

namespace exmat::runtime {
namespace {

/// The vertices that triangles name, ascending.
IndexVector vertices_of(const TriangleArray& triangles) {
  std::vector<std::int32_t> ids(triangles.data(), triangles.data() + triangles.size());
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return Eigen::Map<const IndexVector>(ids.data(), std::ssize(ids));
}

std::int32_t place_in(const IndexVector& ascending, std::int32_t id) {
  return static_cast<std::int32_t>(std::lower_bound(ascending.begin(), ascending.end(), id) - ascending.begin());
}

/// Shares of the tets of each vertex, by volume.
DensityField::Shares shares_by_volume(const TetMesh& mesh, const IndexVector& vertices) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  DensityField::Shares shares(static_cast<std::size_t>(vertices.size()));
  for (std::int32_t tet = 0; tet < mesh.tet_count(); ++tet)
    for (const std::int32_t corner : mesh.tets.row(tet)) {
      const std::int32_t place = place_in(vertices, corner);
      if (place < vertices.size() && vertices[place] == corner)
        shares[static_cast<std::size_t>(place)].emplace_back(tet, volumes[tet]);
    }
  for (auto& of_vertex : shares) {
    double sum = 0;
    for (const auto& [tet, share] : of_vertex) sum += share;
    for (auto& [tet, share] : of_vertex) share /= sum;
  }
  return shares;
}

/// Nearest vertex of the boundary to each point: among the corners of its tet, else on all of the boundary.
IndexVector nearest_vertices(const ObjectData& object, const RenderData& render) {
  const IndexVector boundary = vertices_of(object.surface);
  IndexVector nearest(render.vertices.rows());
  for (Eigen::Index i = 0; i < nearest.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    const auto consider = [&](std::int32_t vertex) {
      const double distance = (object.mesh.vertices.row(vertex) - render.vertices.row(i)).squaredNorm();
      if (distance < least) std::tie(least, nearest[i]) = std::pair(distance, vertex);
    };
    for (const std::int32_t corner : object.mesh.tets.row(render.tets[i]))
      if (boundary[std::min<Eigen::Index>(place_in(boundary, corner), boundary.size() - 1)] == corner) consider(corner);
    if (least < std::numeric_limits<double>::infinity()) continue;
    for (const std::int32_t vertex : boundary) consider(vertex);
  }
  return nearest;
}

ReadSurface surface_of_object(const ReducedModel& data) {
  const ObjectData& object = *data.object;
  const RowMatrix& basis = data.modal->basis;
  ReadSurface surface;
  ModelSurface& drawn = surface.drawn;
  drawn.vertices = vertices_of(object.surface);
  drawn.triangles = object.surface.unaryExpr([&](std::int32_t id) { return place_in(drawn.vertices, id); });
  VertexArray rest(drawn.vertices.size(), 3);
  for (Eigen::Index i = 0; i < rest.rows(); ++i) rest.row(i) = object.mesh.vertices.row(drawn.vertices[i]);
  surface.points = embedded_points(basis, rest, drawn.vertices, RowMatrix::Ones(rest.rows(), 1));
  drawn.density = DensityField(object, basis, shares_by_volume(object.mesh, drawn.vertices));
  drawn.normals = VertexNormals(rest, drawn.triangles);
  return surface;
}

ReadSurface surface_of_render_mesh(const ReducedModel& data) {
  const ObjectData& object = *data.object;
  const RenderData& render = *data.render;
  const RowMatrix& basis = data.modal->basis;
  ReadSurface surface;
  surface.drawn.render = true;
  surface.drawn.triangles = render.triangles;
  surface.drawn.vertices = nearest_vertices(object, render);
  IndexMatrix corners(render.tets.size(), 4);
  DensityField::Shares shares;
  for (Eigen::Index i = 0; i < corners.rows(); ++i) {
    corners.row(i) = object.mesh.tets.row(render.tets[i]);
    shares.push_back({{render.tets[i], 1.0}});
  }
  // The tets place the points, since the vertices of the file are rounded.
  VertexArray rest = VertexArray::Zero(corners.rows(), 3);
  for (Eigen::Index i = 0; i < corners.rows(); ++i)
    for (int c = 0; c < 4; ++c) rest.row(i) += render.barycentric(i, c) * object.mesh.vertices.row(corners(i, c));
  surface.points = embedded_points(basis, rest, corners, render.barycentric);
  surface.drawn.density = DensityField(object, basis, shares);
  surface.drawn.normals = VertexNormals(render.vertices, render.triangles);
  return surface;
}

}  // namespace

DensityField::DensityField(const ObjectData& object, const RowMatrix& basis, const Shares& shares)
    : material_(object.materials.model), workspace_(VertexPositions::make_workspace(basis.cols())) {
  std::map<std::int32_t, std::int32_t> numbers, corners;  // of tets and vertices of the object: those kept here
  for (const auto& of_point : shares)
    for (const auto& [tet, share] : of_point) {
      if (!numbers.contains(tet)) {
        Tet& kept = tets_.emplace_back();
        numbers.emplace(tet, static_cast<std::int32_t>(tets_.size()) - 1);
        kept.gradients = shape_gradients(tet_positions(object.mesh, tet));
        kept.lame = lame_parameters(object.materials.youngs_modulus[tet], object.materials.poisson_ratio[tet]);
        for (std::size_t c = 0; c < 4; ++c)
          kept.corners[c] = corners
                                .emplace(object.mesh.tets(tet, static_cast<Eigen::Index>(c)),
                                         static_cast<std::int32_t>(corners.size()))
                                .first->second;
      }
      members_.emplace_back(numbers[tet], static_cast<float>(share));
    }
  for (const auto& of_point : shares) begins_.push_back(begins_.back() + static_cast<std::int32_t>(of_point.size()));
  RowMatrix rows(3 * std::ssize(corners), basis.cols());
  vertices_.resize(corners.size());
  for (const auto& [vertex, place] : corners) vertices_[static_cast<std::size_t>(place)] = vertex;
  for (const auto& [vertex, place] : corners)
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(place)) =
        basis.middleRows<3>(3 * static_cast<Eigen::Index>(vertex));
  displacements_ = VertexPositions(VertexArray::Zero(std::ssize(corners), 3), rows);
  moved_.resize(3 * corners.size());
  densities_.resize(tets_.size());
}

/// Sets the displacements of the corners: U q, or those in the world less that of the first, which strain as much.
void DensityField::set_displacements(const State& state, const FullModel* full, const Placement& frame) noexcept {
  if (!state.full) return displacements_.evaluate(state.q, workspace_, moved_.data());
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const Eigen::Vector3d own = full_displacement(*full, frame, *state.full, vertices_[i]);
    if (i == 0) first = own;
    Eigen::Map<Eigen::Vector3f>(moved_.data() + 3 * i) = (own - first).cast<float>();
  }
}

void DensityField::evaluate(const State& state, const FullModel* full, const Placement& frame,
                            float* density) noexcept {
  set_displacements(state, full, frame);
  with_material(material_, [&](auto material) {
    for (std::size_t t = 0; t < tets_.size(); ++t) {
      Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
      for (std::size_t c = 0; c < 4; ++c)
        gradient += Eigen::Map<const Eigen::Vector3f>(moved_.data() + 3 * tets_[t].corners[c]).cast<double>() *
                    tets_[t].gradients.row(static_cast<Eigen::Index>(c));
      densities_[t] = static_cast<float>(decltype(material)::energy(gradient, tets_[t].lame));
    }
  });
  for (std::size_t i = 0; i + 1 < begins_.size(); ++i) {
    density[i] = 0;
    for (std::int32_t member = begins_[i]; member < begins_[i + 1]; ++member) {
      const auto& [tet, share] = members_[static_cast<std::size_t>(member)];
      density[i] += share * densities_[static_cast<std::size_t>(tet)];
    }
  }
}

ReadSurface read_surface(const Source& source, bool render) {
  const std::string reason = "a surface is asked for";
  std::vector<LedgerEntry> groups{{"object", true, 0, reason}, {"modal", true, 0, reason}, {"render", true, 0, reason}};
  if (!render) groups.pop_back();
  const ReducedModel data = read_bundle(source.bundle, {.groups = groups});
  require_same_bundle(source, data);
  return render ? surface_of_render_mesh(data) : surface_of_object(data);
}

}  // namespace exmat::runtime

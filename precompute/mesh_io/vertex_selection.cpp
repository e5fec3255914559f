#include "precompute/mesh_io/vertex_selection.h"

#include <Eigen/Core>
#include <algorithm>
#include <fmt/format.h>

#include "common/config/vertex_ids.h"
#include "common/core/error.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

std::string to_text(const Eigen::RowVector3d& point) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", point[0], point[1], point[2]);
}

std::string bounding_box(const VertexArray& points) {
  if (points.rows() == 0) return "the mesh is empty";
  return fmt::format("the mesh lies in {} to {}", to_text(points.colwise().minCoeff()),
                     to_text(points.colwise().maxCoeff()));
}

std::string names_of(const TetSets& sets) {
  std::string names;
  for (const auto& [name, tets] : sets) names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", name);
  return names.empty() ? "none" : names;
}

template <typename Predicate>
std::vector<std::int32_t> points_where(const VertexArray& points, Predicate is_inside) {
  std::vector<std::int32_t> ids;
  for (Eigen::Index v = 0; v < points.rows(); ++v)
    if (is_inside(Eigen::RowVector3d(points.row(v)))) ids.push_back(static_cast<std::int32_t>(v));
  return ids;
}

// Of points, which are the vertices or stand for the tets; `noun` says which.
class Selector {
 public:
  Selector(const VertexArray& points, std::string_view noun, const std::string& asset_file,
           const TetSets* sets = nullptr)
      : points_(points), noun_(noun), asset_file_(asset_file), sets_(sets) {}

  std::vector<std::int32_t> operator()(const BoxSelection& box) const {
    const Eigen::RowVector3d min(box.min.data()), max(box.max.data());
    auto ids = points_where(points_, [&](const Eigen::RowVector3d& x) {
      return (x.array() >= min.array()).all() && (x.array() <= max.array()).all();
    });
    return require_some(std::move(ids), asset_file_, fmt::format("the box {} to {}", to_text(min), to_text(max)));
  }

  std::vector<std::int32_t> operator()(const SphereSelection& sphere) const {
    const Eigen::RowVector3d centre(sphere.centre.data());
    auto ids = points_where(points_, [&](const Eigen::RowVector3d& x) { return (x - centre).norm() <= sphere.radius; });
    const auto place = fmt::format("the sphere about {} of radius {:.6g}", to_text(centre), sphere.radius);
    return require_some(std::move(ids), asset_file_, place);
  }

  std::vector<std::int32_t> operator()(const IdSelection& selection) const {
    std::vector<std::int32_t> ids;
    for (const std::int64_t id : selection.ids) {
      if (id < 0 || id >= points_.rows())
        throw InputError({asset_file_, "ids", fmt::format("0-based {} ids below {}", noun_, points_.rows()),
                          std::to_string(id), ""});
      ids.push_back(static_cast<std::int32_t>(id));
    }
    return require_some(std::move(ids), asset_file_, "ids");
  }

  std::vector<std::int32_t> operator()(const FileSelection& selection) const {
    std::vector<std::int32_t> ids;
    for (const std::int64_t id : read_vertex_ids(selection.file, points_.rows(), noun_))
      ids.push_back(static_cast<std::int32_t>(id));
    return require_some(std::move(ids), selection.file.string(), "");
  }

  // Those that a surface has are ids by now (precompute/inputs/object_surface).
  std::vector<std::int32_t> operator()(const PartSelection& selection) const {
    refuse_without_surface("part", fmt::format("\"{}\"", selection.name));
  }
  std::vector<std::int32_t> operator()(const ColourSelection&) const { refuse_without_surface("color", "a color"); }

  std::vector<std::int32_t> operator()(const SetSelection& selection) const {
    const auto found = sets_->find(selection.name);
    if (found == sets_->end())
      throw InputError({asset_file_, "set", "a set of the mesh file", fmt::format("\"{}\"", selection.name),
                        "the file has " + names_of(*sets_)});
    return require_some(found->second, asset_file_, "set");
  }

 private:
  [[noreturn]] void refuse_without_surface(const char* place, const std::string& found) const {
    throw InputError({asset_file_, place, "parts and colors of an object that is given as object.surface", found,
                      "choose a box, a sphere or ids"});
  }

  std::vector<std::int32_t> require_some(std::vector<std::int32_t> ids, const std::string& file,
                                         const std::string& place) const {
    if (ids.empty())
      throw InputError({file, place, fmt::format("at least one {} of the mesh", noun_), "none", bounding_box(points_)});
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return ids;
  }

  const VertexArray& points_;
  std::string_view noun_;
  const std::string& asset_file_;
  const TetSets* sets_;
};

}  // namespace

std::vector<std::int32_t> select_vertices(const VertexArray& vertices, const VertexSelection& selection,
                                          const std::string& asset_file) {
  return std::visit(Selector(vertices, "vertex", asset_file), selection);
}

std::vector<std::int32_t> select_tets(const TetMesh& mesh, const TetSets& sets, const TetSelection& selection,
                                      const std::string& asset_file) {
  VertexArray centroids(mesh.tet_count(), 3);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) centroids.row(t) = tet_positions(mesh, t).colwise().mean();
  return std::visit(Selector(centroids, "tet", asset_file, &sets), selection);
}

}  // namespace exmat::precompute

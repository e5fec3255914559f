#include "precompute/inputs/object_surface.h"

#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

Cage cached_cage(const SurfaceMesh& surface, const AssetConfig& asset, const std::string& name, StageCache& cache) {
  const CageSettings settings{asset.cells, asset.cell_size};
  return cache.get(
      "cage", [&] { return make_cage(surface, settings, name); }, surface.vertices, surface.triangles, asset.cells,
      asset.cell_size, mesher_version());
}

template <typename Named>
std::string list_of(const Named& named, const char* none) {
  std::string names;
  for (const auto& entry : named) {
    if constexpr (requires { entry.name; })
      names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", entry.name);
    else
      names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", entry.first);
  }
  return names.empty() ? none : "it has " + names;
}

}  // namespace

SurfaceFile read_recorded_surface(const std::filesystem::path& path, const AssetConfig& asset, InputFiles& files) {
  SurfaceFile file = read_surface_file(path);
  file.mesh.vertices *= asset.length_unit;
  for (MorphTarget& morph : file.morphs) morph.positions *= asset.length_unit;
  if (file.skeleton) {
    file.skeleton->bind.col(3) *= asset.length_unit;
    file.skeleton->poses.leftCols<3>() *= asset.length_unit;
  }
  files.insert(files.end(), file.files.begin(), file.files.end());
  log_notes(file, path);
  return file;
}

ObjectSurface::ObjectSurface(const AssetConfig& asset, InputFiles& files, StageCache& cache)
    : asset_(asset),
      file_(read_recorded_surface(*asset.object_surface, asset, files)),
      cage_(cached_cage(file_.mesh, asset, asset.object_surface->string(), cache)),
      embedding_(embed_points(cage_.mesh, file_.mesh.vertices, asset.object_surface->string())),
      tree_(file_.mesh.vertices, file_.mesh.triangles) {
  warn_of_flat_body(file_.mesh, *asset.object_surface);
  warn_of_thin_surface(file_.mesh, cage_, asset.object_surface->string());
}

VertexMarks ObjectSurface::marks_at(const VertexArray& points) const {
  VertexMarks marks;
  for (const auto& [name, flags] : file_.parts)
    if (name.find('\0') == std::string::npos) marks.parts[name] = FlagVector::Zero(points.rows());
  if (file_.colours.rows() > 0) marks.colours.resize(points.rows(), 3);
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    const SurfacePoint point = tree_.nearest(points.row(k).transpose());
    const auto corners = file_.mesh.triangles.row(point.triangle);
    for (auto& [name, flags] : marks.parts) {
      const FlagVector& of_surface = file_.parts.at(name);
      double weight = 0;
      for (int corner = 0; corner < 3; ++corner) weight += point.weights[corner] * of_surface[corners[corner]];
      flags[k] = weight >= 0.5 ? 1 : 0;
    }
    Eigen::Index nearest = 0;
    point.weights.maxCoeff(&nearest);
    if (marks.colours.rows() > 0) marks.colours.row(k) = file_.colours.row(corners[nearest]);
  }
  return marks;
}

IdSelection ObjectSurface::ids_of(const VertexSelection& selection, const VertexArray& points) const {
  const VertexMarks marks = marks_at(points);
  const auto numbers = select_points(
      {.points = points, .marks = &marks, .file = asset_.file.string(), .surface = asset_.object_surface->string()},
      selection);
  return {{numbers.begin(), numbers.end()}};
}

std::optional<VertexArray> ObjectSurface::posed(const ExampleConfig& example, InputFiles& files) const {
  if (example.frame) {
    files.push_back(*example.surface);
    VertexArray posed = read_point_cache_frame(*example.surface, *example.frame, file_.mesh.vertices.rows());
    posed *= asset_.length_unit;
    settle_loose_vertices(file_.mesh.triangles, posed);
    return posed;
  }
  if (!example.surface) return morph_target(file_, *example.morph, *asset_.object_surface);
  const SurfaceFile other = read_recorded_surface(*example.surface, asset_, files);
  if (other.mesh.vertices.rows() != file_.mesh.vertices.rows() || other.mesh.triangles != file_.mesh.triangles)
    return std::nullopt;
  return example.morph ? morph_target(other, *example.morph, *example.surface) : other.mesh.vertices;
}

SurfacePose ObjectSurface::pose(const VertexArray& posed, std::span<const KnownPose> known, const std::string& name,
                                StageCache& cache) const {
  const VertexArray near = nearest_cage(known, posed);
  return cache.get(
      "pose of surface", [&] { return pose_by_surface(cage_.mesh, file_.mesh, embedding_, posed, near, name); },
      cage_.mesh.vertices, cage_.mesh.tets, file_.mesh.vertices, file_.mesh.triangles, posed, near);
}

TetMesh cage_of(const SurfaceMesh& surface, const AssetConfig& asset, const std::string& name, StageCache& cache) {
  return cached_cage(surface, asset, name, cache).mesh;
}

const VertexArray& morph_target(const SurfaceFile& surface, const std::string& name,
                                const std::filesystem::path& file) {
  for (const MorphTarget& morph : surface.morphs)
    if (morph.name == name) return morph.positions;
  throw InputError({file.string(), "", fmt::format("a morph target \"{}\"", name), "none of that name",
                    list_of(surface.morphs, "it has none")});
}

}  // namespace exmat::precompute

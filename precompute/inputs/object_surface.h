#pragma once

#include <memory>
#include <optional>
#include <string>

#include "common/config/asset_config.h"
#include "precompute/alignment/surface_tree.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/inputs/inputs.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/meshing/cage.h"
#include "precompute/posing/surface_pose.h"
#include "precompute/render/embedding.h"

namespace exmat::precompute {

/// A surface in place of tets: its cage, what is nearest to which of its parts, and its poses.
class ObjectSurface {
 public:
  /// Reads the surface that the asset names and fills it.
  ObjectSurface(const AssetConfig& asset, InputFiles& files, StageCache& cache);

  const SurfaceFile& file() const { return file_; }
  const Cage& cage() const { return cage_; }
  const Embedding& embedding() const { return embedding_; }
  const SurfaceTree& tree() const { return tree_; }

  /// The ids of the points [k x 3] that a part or a colour of the surface is nearest to; other selections as they are.
  template <typename Selection>
  Selection resolved(const Selection& selection, const VertexArray& points) const {
    if (const auto* part = std::get_if<PartSelection>(&selection)) return ids_of(*part, points);
    if (const auto* colour = std::get_if<ColourSelection>(&selection)) return ids_of(*colour, points);
    return selection;
  }

  /// Parts and colours of the place of the surface that each of the points [k x 3] is nearest to: of the corners of its
  /// triangle those of at least half of the weight, and the nearest one's.
  VertexMarks marks_at(const VertexArray& points) const;

  /// The surface's vertices in the pose that an example names, or nothing where that has other vertices.
  std::optional<VertexArray> posed(const ExampleConfig& example, InputFiles& files) const;

  /// The surface and its cage at rest.
  KnownPose rest() const { return {file_.mesh.vertices, cage_.mesh.vertices}; }

  /// The cage in a pose of its surface; `known` are others, that at rest among them.
  SurfacePose pose(const VertexArray& posed, std::span<const KnownPose> known, const std::string& name,
                   StageCache& cache) const;

 private:
  IdSelection ids_of(const VertexSelection& selection, const VertexArray& points) const;

  AssetConfig asset_;
  SurfaceFile file_;
  Cage cage_;
  Embedding embedding_;
  SurfaceTree tree_;
};

/// Tets that fill a surface of other vertices than the object's, with what settings the asset has for its own.
TetMesh cage_of(const SurfaceMesh& surface, const AssetConfig& asset, const std::string& name, StageCache& cache);

/// The vertices of a morph target of a surface. Throws InputError that names those that it has.
const VertexArray& morph_target(const SurfaceFile& surface, const std::string& name, const std::filesystem::path& file);

/// Reads a surface that the asset names, its lengths in metres; adds its files to `files` and logs its notes.
SurfaceFile read_recorded_surface(const std::filesystem::path& path, const AssetConfig& asset, InputFiles& files);

}  // namespace exmat::precompute

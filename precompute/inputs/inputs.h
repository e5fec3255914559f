#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/mesh/tet_mesh.h"
#include "common/model/reduced_model.h"
#include "common/model/vertex_marks.h"

namespace exmat::precompute {

class ObjectSurface;
class StageCache;

/// The object, read, checked and resolved.
struct ObjectInput {
  TetMesh mesh;
  TetMaterials materials;
  FlagVector fixed;    ///< n
  FlagVector contact;  ///< n, 1 where the asset lets the surface touch
  std::vector<std::int32_t>
      file_tets;  ///< corner indices as in the file, 4 n_t of it: what "same connectivity" compares
  std::vector<std::int32_t> kept_vertices, kept_tets;  ///< new index -> index in the file
  VertexArray file_positions;                          ///< positions of all vertices in the file
  std::vector<std::vector<std::int64_t>> pushed;       ///< vertices of each of the forces of basis.loads
  std::optional<SkeletonData> skeleton{};              ///< bones that it hangs on, for the vertices of the mesh
  std::vector<std::string> warnings{};                 ///< warnings of its bones
  std::shared_ptr<const ObjectSurface> surface{};      ///< that the mesh fills; none where tets were given
  VertexMarks marks{};                                 ///< marks of that surface at the vertices
};

/// Misfit of a pose by the object's surface.
struct SurfaceMiss {
  double rms = 0, farthest = 0;  ///< over the diagonal of the surface's bounding box
  int iterations = 0;            ///< iterations of Newton's method
};

/// One posed example, on the mesh of the rest example or another.
struct PoseInput {
  std::string name;
  std::filesystem::path file;
  TetMesh mesh;
  bool same_connectivity = true;  ///< `mesh` has the tets of the rest example
  double inverted_fraction = 0;   ///< share of the volume in tets that the pose turns inside out
  IndexVector
      on_object{};  ///< dense map: for each vertex of the object one of `mesh`, or -1; empty where none is given
  bool in_whole_body = true;         ///< no region has it
  Eigen::Index column = 0;           ///< in ExampleInput::landmarks
  std::vector<IndexVector> parts{};  ///< for each of ExampleInput::parts its vertices of `mesh`; none where not given
  std::optional<SurfaceMiss> surface{};  ///< present for a pose of the object's surface
  std::string fault{};                   ///< why no elastic body takes it, though it was read
};

/// A region of the asset, and the poses that act there.
struct RegionInput {
  std::string name;
  FlagVector inside;          ///< n, of the object
  FlagVector inside_example;  ///< flags of the rest example's vertices; empty: all
  std::vector<std::string> examples;
};

/// The asset's examples: one rest mesh, and poses.
struct ExampleInput {
  bool object_is_rest = true;  ///< no rest example was named: `rest` is the object's own mesh
  PoseInput rest;              ///< column -1 where the object is the rest example
  std::vector<PoseInput> poses;
  std::vector<RegionInput> regions;
  bool whole_body = true;          ///< there are poses for it, or no regions
  IndexMatrix landmarks;           ///< l x (1 + examples), vertices of the object and the examples as read, -1 for none
  std::vector<IndexVector> parts;  ///< corresponding regions: their vertices of the object
};

/// Every file that was read, in order, for the hash and for build dependencies.
using InputFiles = std::vector<std::filesystem::path>;

/// Throws InputError with the file, the place, what was expected and found.
/// Cages and poses of surfaces come from the cache where it has them; without one they are computed.
ObjectInput read_object(const AssetConfig& asset, InputFiles& files, StageCache& cache);
ObjectInput read_object(const AssetConfig& asset, InputFiles& files);
ExampleInput read_examples(const AssetConfig& asset, const ObjectInput& object, InputFiles& files, StageCache& cache);
ExampleInput read_examples(const AssetConfig& asset, const ObjectInput& object, InputFiles& files);

/// The asset's render mesh, embedded in the object. Warns (in the log and in `warnings`) where a vertex is farther
/// outside than kFarOutside. The asset must name one.
RenderData read_render_mesh(const AssetConfig& asset, const ObjectInput& object, InputFiles& files,
                            std::vector<std::string>& warnings);

/// Share of the object's bounding box's diagonal.
constexpr double kFarOutside = 0.1;

/// SHA-256 over the contents and lengths of the files, in order, and `salt`, as 64 hexadecimal digits.
std::string hash_inputs(const InputFiles& files, const std::string& salt);

}  // namespace exmat::precompute

#pragma once

#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// The object, read, checked and resolved.
struct ObjectInput {
  TetMesh mesh;
  TetMaterials materials;
  FlagVector fixed;    ///< n
  FlagVector contact;  ///< n, 1 where the asset lets the surface touch
  std::vector<std::int32_t>
      file_tets;  ///< corner indices as in the file, 4 n_t of it: what "same connectivity" compares
  std::vector<std::int32_t> kept_vertices, kept_tets;  ///< new index -> index in the file
};

/// One posed example on the vertices of the rest example.
struct PoseInput {
  std::string name;
  VertexArray vertices;
  double inverted_fraction = 0;  ///< share of the volume in tets that the pose turns inside out
};

/// The asset's examples: one rest mesh, and poses of it.
struct ExampleInput {
  bool object_is_rest = true;  ///< no rest example was named: `rest` is the object's own mesh
  std::string rest_name;
  TetMesh rest;
  std::vector<PoseInput> poses;
};

/// Every file that was read, in order, for the hash and for build dependencies.
using InputFiles = std::vector<std::filesystem::path>;

/// Throws InputError with the file, the place, what was expected and found.
ObjectInput read_object(const AssetConfig& asset, InputFiles& files);
ExampleInput read_examples(const AssetConfig& asset, const ObjectInput& object, InputFiles& files);

/// SHA-256 over the contents of the files, in order, and `salt`, as 64 hexadecimal digits.
std::string hash_inputs(const InputFiles& files, const std::string& salt);

}  // namespace exmat::precompute

#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// A surface as a file draws it: to be moved with a body, not to be computed with.
struct SurfaceMesh {
  VertexArray vertices;     ///< n x 3, all of the file's, in its order
  TriangleArray triangles;  ///< n_f x 3, indices into vertices
};

/// A shape of a surface that its file gives by name.
struct MorphTarget {
  std::string name;
  VertexArray positions;  ///< n x 3, all vertices where the target's weight is 1 and the others' 0
};

/// All that is read of a surface's file.
struct SurfaceFile {
  SurfaceMesh mesh;                          ///< all primitives, meshes and nodes as one, the nodes' transforms applied
  std::vector<MorphTarget> morphs;           ///< in the file's order; those of a name that several meshes have are one
  std::map<std::string, FlagVector> parts;   ///< n flags each: the vertices of what the file names
  VertexArray colours;                       ///< n x 3 in 0 to 1: red, green, blue; no rows where there are none
  std::vector<std::filesystem::path> files;  ///< every file that was read, the named one first
  std::vector<std::string> remarks;          ///< what a user should know of how the file was read, a sentence each
};

/// Reads by extension: .glb and .gltf (glTF 2.0), .obj (Wavefront), .ply (text and binary), .stl (text and binary).
/// Polygons become fans of triangles about their first corner. Parts are the vertices of a glTF file's materials,
/// meshes, nodes and custom attributes, of an .obj's `o`, `g` and `usemtl`, and of a text .stl's solids; those of one
/// name are one. Throws InputError with file, place (line, byte or JSON pointer), expected and found.
SurfaceFile read_surface_file(const std::filesystem::path& file);

/// The mesh of read_surface_file.
SurfaceMesh read_surface(const std::filesystem::path& file);

/// One frame, 0-based, of a point cache (.pc2): `vertices` x 3. Throws InputError that names the frames and vertices
/// that the file has, where it has no such frame or another number of vertices.
VertexArray read_point_cache_frame(const std::filesystem::path& file, std::int64_t frame, Eigen::Index vertices);

/// Appends the triangles of a polygon of at least three corners.
void add_fan(const std::vector<std::int32_t>& polygon, std::vector<std::array<std::int32_t, 3>>& triangles);

}  // namespace exmat::precompute

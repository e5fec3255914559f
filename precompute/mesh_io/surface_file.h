#pragma once

#include <cstdint>
#include <filesystem>

#include "common/surface_io/surface.h"

namespace exmat::precompute {

/// True if the extension is one that read_surface_file() reads.
bool is_surface_file(const std::filesystem::path& file);

/// Reads by extension: .glb and .gltf (glTF 2.0), .obj (Wavefront), .ply (text and binary), .stl (text and binary).
/// Polygons become triangles (common/surface_io/polygon_faces.h). Vertices of no triangle are settled. Parts are the
/// vertices of a glTF file's materials, meshes, nodes and custom attributes, of an .obj's `o`, `g` and `usemtl`, and of
/// a text .stl's solids; those of one name are one. Throws InputError with file, place (line, byte or JSON pointer),
/// expected and found.
SurfaceFile read_surface_file(const std::filesystem::path& file);

/// Logs what reading the surface remarked on and warned of; `file` is for the messages.
void log_notes(const SurfaceFile& surface, const std::filesystem::path& file);

/// Warns where all vertices of an object's surface lie in a plane.
void warn_of_flat_body(const SurfaceMesh& surface, const std::filesystem::path& file);

/// One frame, 0-based, of a point cache (.pc2): `vertices` x 3. Throws InputError that names the frames and vertices
/// that the file has, where it has no such frame or another number of vertices.
VertexArray read_point_cache_frame(const std::filesystem::path& file, std::int64_t frame, Eigen::Index vertices);

/// Moves every vertex that no triangle has onto the first triangle's first corner, so that it counts in no size and in
/// no distance. Returns how many there are.
Eigen::Index settle_loose_vertices(const TriangleArray& triangles, VertexArray& vertices);

}  // namespace exmat::precompute

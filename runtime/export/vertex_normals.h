#pragma once

#include <vector>

#include "common/core/arrays.h"

namespace exmat::runtime {

/// Unit normals at the vertices of a triangle mesh that moves: sums of the triangles' vector areas about each. Vertices
/// that stand at one place at rest, as along the seams of a texture, share their sum unless their own differ by more
/// than 60 degrees there, as at hard edges, or, where normals are given to them, unless these differ. One of no
/// triangle, or of flat ones alone, has that of another at its place, or else the z axis.
class VertexNormals {
 public:
  /// `vertices` [v x 3] at rest; `given` [v x 3] unit normals of an artist, 0 where there is none, or no rows.
  VertexNormals(const VertexArray& vertices, TriangleArray triangles, const VertexArray& given = {});

  /// [v x 3] of the mesh with these positions.
  VertexArray at(const VertexArray& positions) const;
  /// [3v x columns] derivatives of at() by displacements [3v x columns] of the vertices from `positions`.
  RowMatrix derivatives(const VertexArray& positions, const RowMatrix& displacements) const;

 private:
  VertexArray area_sums(const VertexArray& positions) const;
  void share(VertexArray& sums) const;

  TriangleArray triangles_;
  std::vector<std::vector<Eigen::Index>> groups_;  ///< vertices that share their sums, two at least in each
};

}  // namespace exmat::runtime

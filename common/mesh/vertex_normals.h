#pragma once

#include <span>
#include <vector>

#include "common/core/arrays.h"

namespace exmat {

/// Unit normals at the vertices of a triangle mesh that moves: sums of the triangles' vector areas about each. Vertices
/// that stand at one place at rest, as along the seams of a texture, share their sum unless their own differ by more
/// than 60 degrees there, as at hard edges, or, where normals are given to them, unless these differ. One of no
/// triangle, or of flat ones alone, has that of another at its place, or else the z axis.
class VertexNormals {
 public:
  VertexNormals() = default;
  /// `vertices` [v x 3] at rest; `given` [v x 3] unit normals of an artist, 0 where there is none, or no rows.
  VertexNormals(const VertexArray& vertices, TriangleArray triangles, const VertexArray& given = {});

  /// [v x 3] of the mesh with these positions.
  VertexArray at(const VertexArray& positions) const;
  /// The same in single precision, each [3v], without allocation.
  void read(std::span<const float> positions, std::span<float> normals) const noexcept;
  /// [3v x columns] derivatives of at() by displacements [3v x columns] of the vertices from `positions`.
  RowMatrix derivatives(const VertexArray& positions, const RowMatrix& displacements) const;

 private:
  template <class Positions, class Sums>
  void set_area_sums(const Positions& positions, Sums& sums) const;
  VertexArray area_sums(const VertexArray& positions) const;
  template <class Sums>
  void share(Sums& sums) const;

  TriangleArray triangles_;
  std::vector<std::vector<Eigen::Index>> groups_;  ///< vertices that share their sums, two at least in each
};

}  // namespace exmat

#pragma once

#include "common/mesh/assembly.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Share of the length of a surface's edges that are right angles inward, of all its edges that are no part of a flat.
/// A body cut out of a grid of cubes has a third and more, a box with parts added a few percent. 0 where other angles
/// are common.
double staircase_share(const VertexArray& vertices, const TriangleArray& triangles);

/// A body cut out of a grid of cubes.
bool is_staircase(const VertexArray& vertices, const TriangleArray& triangles);

/// [n x n] smoothing of a surface over a cell or two that keeps the body's size (Taubin 1995), linear in the positions
/// of its vertices: of a staircase, where steps say nothing of where the body is or which way it
/// faces. The identity of any other surface, and at vertices inside.
SparseMatrix surface_smoothing(const VertexArray& vertices, const TriangleArray& triangles);

}  // namespace exmat::precompute

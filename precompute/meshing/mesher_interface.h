#pragma once

#include <string>

#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Request to the mesher. Lengths in the unit of the vertices.
struct MesherRequest {
  VertexArray vertices;     ///< n x 3, of any triangles: with holes, crossing each other, in any orientation
  TriangleArray triangles;  ///< n_f x 3
  double alpha = 0;         ///< gaps and hollows narrower than this are bridged
  double offset = 0;        ///< distance from the triangles of the wrap that tets fill
  double deviation = 0;     ///< distance of the tets' surface from that wrap, at most
  double cell_size = 0;     ///< radius of the sphere about a tet, at most
  unsigned seed = 0;        ///< seed of all random numbers
  bool improve = true;      ///< moves vertices and flips tets until none is flat; else a first mesh, which counts tets
};

/// Fills a mesh with what a wrap about the triangles encloses, or with nothing where that is thinner than the tets may
/// deviate; same request, same mesh. Returns what is wrong, empty where nothing is. The function that the module of the
/// mesher exports under kMesherSymbol.
using MesherFunction = void (*)(const MesherRequest& request, TetMesh& mesh, std::string& failure);
/// "CGAL 5.5.1": what the module is made with; under kMesherVersionSymbol.
using MesherVersionFunction = const char* (*)();

constexpr const char* kMesherSymbol = "exmat_make_tets";
constexpr const char* kMesherVersionSymbol = "exmat_mesher_version";

}  // namespace exmat::precompute

#pragma once

#include <optional>
#include <string>

#include "common/mesh/tet_mesh.h"
#include "precompute/mesh_io/surface_file.h"

namespace exmat::precompute {

/// Fineness of a cage: by one of the two, else kDefaultCells.
struct CageSettings {
  std::optional<int> cells;         ///< about so many tets
  std::optional<double> cell_size;  ///< radius of the sphere about a tet, at most [m]
};

/// Tets that 30 modes need, as a rule: docs/surfaces.md.
constexpr int kDefaultCells = 2000;

/// Tets that fill a surface and follow it from without and within.
struct Cage {
  TetMesh mesh;                               ///< one component, sound (common/mesh/checks.h)
  double cell_size = 0;                       ///< [m]
  double least_angle = 0, largest_angle = 0;  ///< dihedral [degree]
  double volume = 0;                          ///< [m^3]
  std::optional<double> volume_ratio;         ///< over the surface's, where that is closed
  double farthest = 0;  ///< [m] distance of the cage's surface from the triangles, largest over its vertices
  std::string mesher;   ///< "CGAL 5.5.1"
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, Cage& cage) {
  pass_all(archive, cage.mesh.vertices, cage.mesh.tets, cage.cell_size, cage.least_angle, cage.largest_angle,
           cage.volume, cage.volume_ratio, cage.farthest, cage.mesher);
}

/// Smallest dihedral angle that a cage may have [degree].
constexpr double kLeastDihedralAngle = 10;

/// Fills a surface with tets, whatever holes, crossings, doubled or flipped triangles it has: 3D alpha wrapping
/// (Portaner et al. 2022), Delaunay refinement (Jamin et al. 2015), perturbing and exuding. The same surface gives the
/// same cage. Where the surface is no thinner than a cell, the cage has its volume; vertices of triangles are outside
/// by 3/4 of the cell size at most. `name` of the surface is for messages. Throws InputError where the surface has no
/// extent or falls apart in several bodies, or there is no mesher; WorkError where none of several trials gives a sound
/// cage.
Cage make_cage(const SurfaceMesh& surface, const CageSettings& settings, const std::string& name);

/// About how many cells follow a closed surface that is thinner than those of its cage, which then stands off and has
/// more than 1.15 times the surface's volume; none where it has not.
std::optional<Eigen::Index> cells_that_follow(const SurfaceMesh& surface, const Cage& cage);

/// Warns of such a surface; `name` is for the message.
void warn_of_thin_surface(const SurfaceMesh& surface, const Cage& cage, const std::string& name);

/// "CGAL 5.5.1", or "none" where the module with the mesher is not there.
std::string mesher_version();

}  // namespace exmat::precompute

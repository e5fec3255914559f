#pragma once

#include <span>
#include <string>

#include "common/mesh/tet_mesh.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/render/embedding.h"

namespace exmat::precompute {

/// A cage in the pose of its surface.
struct SurfacePose {
  VertexArray positions;   ///< n x 3, of the cage's vertices [m]
  double rms = 0;          ///< distance of the posed surface from the one that the cage carries, over the diagonal of
                           ///< the bounding box of the surface at rest: root of the mean square over its area
  double farthest = 0;     ///< largest over its vertices, likewise
  double energy = 0;       ///< elastic, of a material with Young's modulus 1 and Poisson ratio kPosePoisson [m^3]
  double stiffness = 0;    ///< stiffness of the last springs over Young's modulus, at diagonal 1
  int iterations = 0;      ///< iterations of Newton's method, all stages
  Eigen::Index worst = 0;  ///< the vertex of the surface that is farthest off
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, SurfacePose& pose) {
  pass_all(archive, pose.positions, pose.rms, pose.farthest, pose.energy, pose.stiffness, pose.iterations, pose.worst);
}

/// A pose that was found: places of the vertices of a surface and of its cage [m].
struct KnownPose {
  VertexArray surface, cage;
};

/// The cage of that known pose, of one at least, whose surface is nearest to `posed`, moved onto it rigidly: frames of
/// an animation are near each other.
VertexArray nearest_cage(std::span<const KnownPose> known, const VertexArray& posed);

/// Poisson ratio of the material that fills a pose: poses may change volume, so a low one.
constexpr double kPosePoisson = 0.3;

/// The pose of a cage that carries its surface to `posed`: the least elastic energy (stable neo-Hookean) plus that of
/// springs, per area of the surface at rest, from each of its vertices to its place in the pose. Springs become stiffer
/// until that brings the surface no nearer, which is what the cage cannot hold. No tet is turned inside out:
/// VolumeGuard is a third energy. It begins where each vertex of the cage goes with the rigid motion of the surface
/// about it (moving least squares, Schaefer et al. 2006). Where that leaves tets inside out it begins at `near` [n x
/// 3], a pose of the cage without such tets, and where that misses the surface from rest, by springs that are soft
/// first. `surface` at rest lies in the cage by `embedding`; `posed` [v x 3] are its vertices in the pose. `name` is
/// for messages. Throws InputError where the pose has no finite positions.
SurfacePose pose_by_surface(const TetMesh& cage, const SurfaceMesh& surface, const Embedding& embedding,
                            const VertexArray& posed, const VertexArray& near, const std::string& name);

}  // namespace exmat::precompute

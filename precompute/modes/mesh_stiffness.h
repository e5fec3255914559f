#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "common/core/arrays.h"
#include "common/mesh/tet_mesh.h"

namespace exmat::precompute {

/// Stiffness of the elements of a mesh over quadratic tets on the same mesh (quadratic_tets).
/// docs/method.md, "Elements".
struct MeshStiffness {
  double vibration = 0;        ///< geometric mean over the lowest modes, six of them at most, of squared frequencies
  double worst = 0;            ///< largest of these, and of the sags under the weight along each axis of a clamped body
  double thin = 0;             ///< share of the volume where the mesh is one tet thick
  double variance_factor = 0;  ///< beta by which the geometric mean is 1, of smoothed elements
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, MeshStiffness& value) {
  pass_all(archive, value.vibration, value.worst, value.thin, value.variance_factor);
}

/// Meshes of more tets are not compared: quadratic ones have eight times their unknowns.
inline constexpr Eigen::Index kMostComparedTets = 12'000;

/// Compares a mesh with quadratic tets, with beta fitted where its elements are smoothed. None where the mesh has too
/// many tets or too few, or where one of the systems cannot be solved; `name` is for messages.
std::optional<MeshStiffness> mesh_stiffness(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed,
                                            const std::string& name);

/// "1.08 times as stiff as its material, 1.5 times at worst; ...", a sentence for logs and reports.
std::string to_string(const MeshStiffness& stiffness);

/// A mesh that is stiffer at worst is worth a warning.
inline constexpr double kTooStiff = 1.15;

}  // namespace exmat::precompute

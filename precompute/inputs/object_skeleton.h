#pragma once

#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"
#include "common/model/reduced_model.h"
#include "precompute/inputs/object_surface.h"

namespace exmat::precompute {

/// The skeleton of the object's surface for the cage about it: weights of its bones at the vertices [n x b], rows of
/// sum 1. They minimise the Dirichlet energy of each bone's field where the surface holds it, as heat would spread
/// (Baran and Popovic 2007). Weights below kLeastWeight are left out, unless all of a vertex are.
SkeletonData skeleton_of_cage(const ObjectSurface& surface);
inline constexpr double kLeastWeight = 0.01;

/// Fills the rows of the weights [n x b] that are 0, with fields that are harmonic between the other rows, as those of
/// a cage. At least one row is not 0; such rows add up to 1, and stay. Throws WorkError where a part of the mesh is not
/// connected to any of these.
void fill_weights(const TetMesh& mesh, RowMatrix& weights);

/// 1 for the vertices [n x 3] that bones hold by themselves: those that hang on one bone with at least kOwnWeight and
/// lie nearer to its axis than to the surface, in the proportion kDepth. If these are fewer than four or lie on a line,
/// the bone holds the next deepest, too. They get that bone's weight alone. Warns of bones that hold none.
FlagVector pin_to_bones(const VertexArray& vertices, const SurfaceTree& surface, SkeletonData& skeleton,
                        std::vector<std::string>& warnings);
inline constexpr double kOwnWeight = 0.8, kDepth = 0.35;

/// One bone, "clamp", that holds all of the mesh, with its joint in the middle of the fixed vertices.
SkeletonData clamp_bone(const TetMesh& mesh, const FlagVector& fixed);

}  // namespace exmat::precompute

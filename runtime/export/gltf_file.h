#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "runtime/export/body_motion.h"
#include "runtime/export/drawn_surface.h"
#include "runtime/export/morph_targets.h"

namespace exmat::runtime {

/// Which axis of the object points up.
enum class UpAxis { kY, kZ };

/// Drawing of all bodies of one bundle: one mesh.
struct DrawnKind {
  DrawnSurface surface;
  VertexArray normals;   ///< v x 3, at rest
  MorphTargets targets;  ///< their weights are those of the bodies, one body after the other
};

/// A body: a node with that mesh.
struct DrawnBody {
  std::string name;
  std::size_t kind = 0;
  RowMatrix weights;                 ///< F x N; none without a motion
  std::optional<BodyMotion> motion;  ///< at the same times as the others
};

/// Origin that bodies are placed from, since animations are in single precision: origin_near() of where the first one
/// begins.
Eigen::Vector3d origin_of(const std::vector<DrawnKind>& kinds, const std::vector<DrawnBody>& bodies);

/// Writes surfaces with morph targets as binary glTF 2.0, in single precision: a mesh for each kind, a node for each
/// body; the bones of a skin are nodes below its body's, and its meshes stand beside. With motions an animation of the
/// nodes, bones and weights, linear between frames. Z up becomes glTF's y up
/// by a node above all, and a node "origin" holds origin_of() where that is not 0. Returns the bytes written. Throws
/// InputError (frames too close for single precision or at other times than those of the other bodies, more than the
/// format holds) and WorkError; `target` is then as it was.
std::int64_t write_gltf(const std::filesystem::path& target, const std::vector<DrawnKind>& kinds,
                        const std::vector<DrawnBody>& bodies, UpAxis up);

}  // namespace exmat::runtime

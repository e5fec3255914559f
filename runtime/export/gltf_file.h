#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "runtime/export/body_motion.h"
#include "runtime/export/drawn_surface.h"
#include "runtime/export/morph_targets.h"

namespace exmat::runtime {

/// Which axis of the object points up.
enum class UpAxis { kY, kZ };

/// Writes a surface with morph targets as binary glTF 2.0, in single precision: one mesh, on one node. With a `motion`
/// an animation of the node and of the weights, linear between its frames. Z up becomes glTF's y up by a node above it.
/// Returns the bytes written. Throws InputError (frames too close for single precision, more than the format holds) and
/// WorkError; `target` is then as it was.
std::int64_t write_gltf(const std::filesystem::path& target, const DrawnSurface& surface, const VertexArray& normals,
                        const MorphTargets& targets, const std::optional<BodyMotion>& motion, UpAxis up);

}  // namespace exmat::runtime

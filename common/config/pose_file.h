#pragma once

#include <filesystem>
#include <vector>

#include "common/config/scene_config.h"

namespace exmat {

/// Places of bodies, a line each: x y z [m], or x y z and a unit quaternion, w first. Empty lines and those that begin
/// with # are left out. Throws InputError with the line where it is anything else, and where there is none.
std::vector<BodyPlace> read_poses(const std::filesystem::path& file);

}  // namespace exmat

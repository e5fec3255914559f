#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "common/config/json_values.h"
#include "common/config/scene_config.h"

namespace exmat {

/// Bodies of one kind of a scene.
struct NamedBodies {
  std::string name;  ///< empty: they have none
  std::size_t count = 1;
};

/// The "attachments" of a scene, those of each kind of its bodies. Throws InputError: no such body (the nearest name is
/// suggested), no such obstacle, a motion of an obstacle's, settings of springs on what is none.
std::vector<std::vector<AttachmentConfig>> read_attachments(const Json& scene, const std::filesystem::path& file,
                                                            const std::vector<NamedBodies>& bodies);

}  // namespace exmat

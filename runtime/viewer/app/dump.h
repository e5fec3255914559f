#pragma once

#include <filesystem>

#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

/// Writes what a picture shows in numbers: where the camera is, the states of the bodies, the hands. Throws WorkError.
void dump(const Snapshot& snapshot, const Studio& studio, const PictureSize& picture,
          const std::filesystem::path& file);

}  // namespace exmat::viewer

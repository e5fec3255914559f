#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace exmat {

struct FullSpaceCommandOptions {
  std::string scene, trajectory;
  std::optional<std::int64_t> steps, every;  ///< > 0; absent: the scene's
};

/// Steps a scene in full space, writes its trajectory and prints what it was like.
void full_space_command(const FullSpaceCommandOptions& options);

}  // namespace exmat

#pragma once

#include <string>

namespace exmat {

struct NewCommandOptions {
  std::string surface, folder;  ///< file, and where to write; empty: a folder of the surface's name
};

/// Writes asset.json and scene.json to begin with for a surface, and prints what to run next. Throws InputError where
/// the folder has files of these names.
void new_command(const NewCommandOptions& options);

}  // namespace exmat

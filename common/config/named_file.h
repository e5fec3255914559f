#pragma once

#include <filesystem>
#include <string>

namespace exmat {

/// A file that a scene or an asset names, the place that names it, and what it is.
struct NamedFile {
  std::filesystem::path file;
  std::string place;
  const char* kind;
};

}  // namespace exmat

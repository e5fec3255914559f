#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace exmat::precompute {

/// "TARGET: FILE FILE ...", what Make and Ninja read as the files that a target was made of, each file once. Blanks,
/// '#', '$', ':' and backslashes before them are escaped as compilers do. Throws InputError for a path with a line end.
std::string depfile_text(const std::filesystem::path& target, const std::vector<std::filesystem::path>& files);

}  // namespace exmat::precompute

#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string_view>
#include <vector>

namespace exmat {

constexpr std::int64_t kLargestVertexId = std::numeric_limits<std::int32_t>::max();

/// 0-based vertex ids of a text file of 1-based ids as in .bou files: separated by commas, blanks or lines; '#' starts
/// a comment. In file order. Throws InputError with the line: no such file, not an integer in 1 to `largest` (the
/// number of vertices, where it is known), an id repeated, no ids at all. `noun` is what has the ids, for messages.
std::vector<std::int64_t> read_vertex_ids(const std::filesystem::path& file, std::int64_t largest = kLargestVertexId,
                                          std::string_view noun = "vertex");

}  // namespace exmat

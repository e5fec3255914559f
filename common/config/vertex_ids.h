#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace exmat {

/// 0-based vertex ids of a text file of 1-based ids as in .bou files: separated by commas, blanks or lines; '#' starts
/// a comment. In file order. Throws InputError with the line: no such file, not an integer >= 1, an id repeated, no ids
/// at all.
std::vector<std::int64_t> read_vertex_ids(const std::filesystem::path& file);

}  // namespace exmat

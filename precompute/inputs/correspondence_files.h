#pragma once

#include <filesystem>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// Landmarks of a text file: a line each, a vertex of the object and then one of each of `examples` examples, or '-';
/// 1-based, '#' starts a comment. [l x (1 + examples)] 0-based, -1 for '-'. `sizes` (1 + examples) bounds the numbers
/// of each column. Throws InputError with the line.
IndexMatrix read_landmarks(const std::filesystem::path& file, const std::vector<Eigen::Index>& sizes);

/// Dense map of a text file: for each of `object_size` vertices of the object a line with the example's vertex, 1 to
/// `example_size`, or '-'. 0-based, -1 for '-'. Throws InputError with the line.
IndexVector read_vertex_map(const std::filesystem::path& file, Eigen::Index object_size, Eigen::Index example_size);

}  // namespace exmat::precompute

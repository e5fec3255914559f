#pragma once

#include <filesystem>

#include "common/core/arrays.h"

namespace exmat {

/// Reads heights [rows x columns] [m] from a text file: a line for each row, numbers between blanks or commas, comments
/// after #, as spreadsheets and numpy.savetxt write them. At least 2 x 2. Throws InputError with file, line, expected
/// and found.
RowMatrix read_heights(const std::filesystem::path& file);

}  // namespace exmat

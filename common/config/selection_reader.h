#pragma once

#include <filesystem>
#include <string>

#include "common/config/json_values.h"
#include "common/config/vertex_selection.h"

namespace exmat {

/// Reads a selection that check_against_schema has passed. Throws InputError where a box is turned inside out or an id
/// is repeated.
VertexSelection read_selection(const Json& json, const std::filesystem::path& file, const std::string& place);

}  // namespace exmat

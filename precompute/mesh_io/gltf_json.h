#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace exmat::precompute {

/// Parses the JSON of a glTF file, not too deep, names that are no UTF-8 mended. Throws InputError.
nlohmann::json parse_gltf(const std::string& file, std::string_view text);

/// Keeps what shapes are made of, checked: members of the right kinds, integers not negative and below 2^31, arrays of
/// numbers of their lengths, no more than one buffer without a URI (in a .glb, the first), none that is named twice.
/// Refuses compressed meshes and required extensions that change shapes. Throws InputError with file, JSON pointer,
/// expected, found and what to do.
nlohmann::json shapes_of_gltf(const std::string& file, const nlohmann::json& root, bool is_binary);

}  // namespace exmat::precompute

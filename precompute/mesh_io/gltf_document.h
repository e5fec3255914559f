#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <tiny_gltf.h>
#include <vector>

namespace exmat::precompute {

/// The parts of a glTF file that shapes are made of. Its JSON has been checked: integers are not negative and fit into
/// 31 bits, and nothing is compressed. Indices and sizes are still those of the file.
struct GltfDocument {
  tinygltf::Model model;
  nlohmann::json json;                       ///< content of the file, with all that has not been checked
  std::vector<std::filesystem::path> files;  ///< every file that was read, the named one first
  std::size_t bytes = 0;                     ///< size of the file and its buffers
};

/// Reads a .glb or .gltf file (glTF 2.0) with its buffers, from the folder of the file or below it, each once. Looks,
/// images, animations and cameras are left out. Throws InputError with file, place (byte or JSON pointer), expected and
/// found, and for compressed files what to do.
GltfDocument read_gltf_document(const std::filesystem::path& file);

/// The InputError of one place of a glTF file.
[[noreturn]] void fail_in_gltf(const std::string& file, const std::string& place, const std::string& expected,
                               const std::string& found, const std::string& advice = "");

}  // namespace exmat::precompute

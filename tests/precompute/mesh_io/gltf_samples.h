#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace exmat::precompute::test {

/// Component types of glTF 2.0.
enum GltfType { kByte = 5120, kUnsignedByte, kShort, kUnsignedShort, kUnsignedInt = 5125, kFloat };

/// A glTF file in the making: its JSON, to be changed at will, and its buffer.
class GltfWriter {
 public:
  GltfWriter();

  nlohmann::json json;

  /// Adds bytes to the buffer and a view of them.
  int view(std::string_view bytes, int stride = 0);
  /// Adds a view and an accessor of these numbers, a row after the other.
  int accessor(GltfType type, const std::string& shape, const std::vector<double>& numbers, bool normalized = false);
  int positions(const std::vector<double>& numbers) { return accessor(kFloat, "VEC3", numbers); }
  /// Adds a mesh of one primitive and a node with it.
  nlohmann::json& mesh_in_node(const std::string& name, const nlohmann::json& primitive);

  const std::string& buffer() const { return buffer_; }
  std::string glb() const;
  /// The buffer within the text.
  std::string gltf() const;
  /// The buffer in a file.
  std::string gltf(const std::string& uri) const;

 private:
  std::string buffer_;
};

/// Little-endian bytes of numbers of a type.
std::string gltf_bytes(GltfType type, const std::vector<double>& numbers);

}  // namespace exmat::precompute::test

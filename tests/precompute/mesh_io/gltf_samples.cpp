#include "tests/precompute/mesh_io/gltf_samples.h"

#include <bit>
#include <cstdint>

namespace exmat::precompute::test {
namespace {

using Json = nlohmann::json;

void append(std::string& bytes, std::uint32_t value, int count = 4) {
  for (int k = 0; k < count; ++k) bytes += static_cast<char>((value >> (8 * k)) & 0xffU);
}

void pad(std::string& bytes, char padding) {
  while (bytes.size() % 4 != 0) bytes += padding;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j)
      group = group << 8 | (k + j < bytes.size() ? static_cast<unsigned char>(bytes[k + j]) : 0U);
    for (std::size_t j = 0; j < 4; ++j) text += k + j > bytes.size() ? '=' : kDigits[group >> (18 - 6 * j) & 63U];
  }
  return text;
}

}  // namespace

std::string gltf_bytes(GltfType type, const std::vector<double>& numbers) {
  std::string bytes;
  for (const double number : numbers) {
    if (type == kFloat)
      append(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(number)));
    else
      append(bytes, static_cast<std::uint32_t>(static_cast<std::int64_t>(number)),
             type == kUnsignedInt                       ? 4
             : type == kShort || type == kUnsignedShort ? 2
                                                        : 1);
  }
  return bytes;
}

GltfWriter::GltfWriter()
    : json({{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", Json::array()}}}}}) {}

int GltfWriter::view(std::string_view bytes, int stride) {
  Json view = {{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}};
  if (stride > 0) view["byteStride"] = stride;
  buffer_ += bytes;
  pad(buffer_, '\0');
  json["buffers"] = {{{"byteLength", buffer_.size()}}};
  json["bufferViews"].push_back(std::move(view));
  return static_cast<int>(json["bufferViews"].size()) - 1;
}

int GltfWriter::accessor(GltfType type, const std::string& shape, const std::vector<double>& numbers, bool normalized) {
  const std::size_t components = shape == "SCALAR" ? 1
                                 : shape == "MAT4" ? 16
                                                   : static_cast<std::size_t>(shape.back() - '0');
  Json accessor = {{"bufferView", view(gltf_bytes(type, numbers))},
                   {"componentType", static_cast<int>(type)},
                   {"count", numbers.size() / components},
                   {"type", shape}};
  if (normalized) accessor["normalized"] = true;
  json["accessors"].push_back(std::move(accessor));
  return static_cast<int>(json["accessors"].size()) - 1;
}

Json& GltfWriter::mesh_in_node(const std::string& name, const Json& primitive) {
  json["meshes"].push_back({{"name", name}, {"primitives", {primitive}}});
  json["scenes"][0]["nodes"].push_back(json["nodes"].size());
  json["nodes"].push_back({{"mesh", json["meshes"].size() - 1}});
  return json["nodes"].back();
}

std::string GltfWriter::glb() const {
  std::string text = json.dump(), glb("glTF\2\0\0\0", 8);
  pad(text, ' ');
  append(glb, static_cast<std::uint32_t>(28 + text.size() + buffer_.size()));
  append(glb, static_cast<std::uint32_t>(text.size()));
  glb += "JSON" + text;
  append(glb, static_cast<std::uint32_t>(buffer_.size()));
  return glb + std::string("BIN\0", 4) + buffer_;
}

std::string GltfWriter::gltf() const { return gltf("data:application/octet-stream;base64," + base64(buffer_)); }

std::string GltfWriter::gltf(const std::string& uri) const {
  Json copy = json;
  copy["buffers"][0]["uri"] = uri;
  return copy.dump();
}

}  // namespace exmat::precompute::test

#include "precompute/mesh_io/gltf_document.h"

#include <bit>
#include <fmt/format.h>
#include <fstream>  // of the glTF library, which does not include it without a file system
#include <optional>
#include <string_view>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/surface_io/text_input.h"
#include "common/surface_io/value_cursor.h"
#include "precompute/mesh_io/gltf_json.h"

#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>

namespace exmat::precompute {
namespace {

constexpr std::string_view kMagic = "glTF";
constexpr std::uint32_t kVersion = 2, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;
constexpr std::size_t kHeaderBytes = 12, kLargestFile = 2147483647;

struct Parts {
  std::string_view json;
  std::optional<std::string_view> buffer;  // of a .glb
};

// The chunks of a .glb; those of other kinds are left out.
Parts parts_of_glb(const std::string& file, std::string_view bytes) {
  ValueCursor cursor(file, bytes, ValueCursor::Layout::kAnywhere);
  cursor.set_binary(std::endian::native != std::endian::little);
  cursor.read_bytes(kMagic.size(), "'glTF'");
  if (const auto version = cursor.read_binary<std::uint32_t>("the version"); version != kVersion)
    cursor.fail("version 2", std::to_string(version), "export as glTF 2.0");
  const auto length = cursor.read_binary<std::uint32_t>("the length of the file");
  if (length > bytes.size())
    cursor.fail(fmt::format("a file of {} bytes", length), std::to_string(bytes.size()), "is the file cut off?");
  Parts parts;
  for (std::size_t end = kHeaderBytes; end + 8 <= length;) {
    const auto size = cursor.read_binary<std::uint32_t>("the length of a chunk");
    const auto kind = cursor.read_binary<std::uint32_t>("the kind of a chunk");
    if (parts.json.empty() && kind != kJsonChunk) cursor.fail("a chunk of JSON first", fmt::format("{:#x}", kind));
    const auto chunk = cursor.read_bytes(size, fmt::format("a chunk of {} bytes", size));
    if (kind == kJsonChunk && parts.json.empty()) parts.json = chunk;
    if (kind == kBinaryChunk && !parts.buffer) parts.buffer = chunk;
    end += 8 + std::size_t{size};
    if (parts.json.empty()) cursor.fail("JSON", "an empty chunk");
  }
  if (parts.json.empty()) cursor.fail("a chunk of JSON", "the end of the file");
  return parts;
}

void append_chunk(std::string& glb, std::uint32_t kind, std::string_view bytes, char padding) {
  const auto append = [&](std::uint32_t value) {
    for (int shift = 0; shift < 32; shift += 8) glb += static_cast<char>((value >> shift) & 0xffU);
  };
  const std::size_t padded = (bytes.size() + 3) / 4 * 4;
  append(static_cast<std::uint32_t>(padded));
  append(kind);
  glb += bytes;
  glb.append(padded - bytes.size(), padding);
}

std::string to_glb(std::string_view json, std::string_view buffer) {
  std::string glb("glTF\2\0\0\0\0\0\0\0", kHeaderBytes);
  glb.reserve(kHeaderBytes + json.size() + buffer.size() + 24);
  append_chunk(glb, kJsonChunk, json, ' ');
  append_chunk(glb, kBinaryChunk, buffer, '\0');
  for (std::size_t k = 0; k < 4; ++k) glb[8 + k] = static_cast<char>((glb.size() >> (8 * k)) & 0xffU);
  return glb;
}

// What tinygltf may see of the file system: the folder of the file and those below it.
struct Folder {
  std::filesystem::path path;
  std::vector<std::filesystem::path> files;

  bool holds(const std::string& name) const {
    const auto relative = std::filesystem::path(name).lexically_normal().lexically_relative(path.lexically_normal());
    return !relative.empty() && *relative.begin() != "..";
  }
};

tinygltf::FsCallbacks callbacks(Folder& folder) {
  tinygltf::FsCallbacks result{};
  result.FileExists = [](const std::string& name, void* data) {
    std::error_code ignored;
    return static_cast<Folder*>(data)->holds(name) && std::filesystem::is_regular_file(name, ignored);
  };
  result.ExpandFilePath = [](const std::string& name, void*) { return name; };
  result.ReadWholeFile = [](std::vector<unsigned char>* out, std::string*, const std::string& name, void* data) {
    const std::string bytes = read_whole_file(name, "a buffer of a glTF file");
    out->assign(bytes.begin(), bytes.end());
    static_cast<Folder*>(data)->files.emplace_back(name);
    return true;
  };
  result.user_data = &folder;
  return result;
}

tinygltf::Model load(const std::string& file, const std::string& json, std::string_view buffer, Folder& folder) {
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(callbacks(folder));
  tinygltf::Model model;
  std::string error, warning;
  bool loaded = false;
  if (buffer.empty()) {
    loaded = loader.LoadASCIIFromString(&model, &error, &warning, json.data(), static_cast<unsigned>(json.size()),
                                        folder.path.string());
  } else {
    const std::string glb = to_glb(json, buffer);
    loaded = loader.LoadBinaryFromMemory(&model, &error, &warning, reinterpret_cast<const unsigned char*>(glb.data()),
                                         static_cast<unsigned>(glb.size()), folder.path.string());
  }
  if (!loaded)
    throw InputError({file, "", "a glTF file whose buffers are in it, in its folder or below that",
                      quote(trimmed(error)), "export as .glb, which holds all buffers"});
  return model;
}

}  // namespace

GltfDocument read_gltf_document(const std::filesystem::path& file) {
  const std::string bytes = read_whole_file(file, "a glTF file"), name = file.string();
  if (bytes.size() > kLargestFile)
    throw InputError({name, "", fmt::format("at most {} bytes", kLargestFile), std::to_string(bytes.size()),
                      "export a coarser mesh"});
  const bool is_binary = bytes.starts_with(kMagic);
  const Parts parts = is_binary ? parts_of_glb(name, bytes) : Parts{bytes, {}};
  const auto buffer = parts.buffer.value_or(std::string_view{});
  const std::string json = shapes_of_gltf(name, parts.json, !buffer.empty()).dump();
  Folder folder{file.parent_path().empty() ? "." : file.parent_path(), {file}};
  GltfDocument document;
  document.model = load(name, json, buffer, folder);
  document.files = std::move(folder.files);
  document.bytes = bytes.size();
  for (const tinygltf::Buffer& one : document.model.buffers) document.bytes += one.data.size();
  return document;
}

void fail_in_gltf(const std::string& file, const std::string& place, const std::string& expected,
                  const std::string& found, const std::string& advice) {
  throw InputError({file, place, expected, found, advice});
}

}  // namespace exmat::precompute

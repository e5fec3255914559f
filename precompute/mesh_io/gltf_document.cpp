#include "precompute/mesh_io/gltf_document.h"

#include <fmt/format.h>
#include <fstream>  // of the glTF library, which does not include it without a file system
#include <string_view>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/surface_io/glb.h"
#include "common/surface_io/text_input.h"
#include "precompute/mesh_io/gltf_json.h"

#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>

namespace exmat::precompute {
namespace {

constexpr std::size_t kLargestFile = 2147483647;

// The part of the file system that tinygltf may see: the folder of the file and those below it.
struct Folder {
  std::filesystem::path path;
  std::vector<std::filesystem::path> files;

  bool holds(const std::string& name) const {
    const auto relative = std::filesystem::path(name).lexically_normal().lexically_relative(path.lexically_normal());
    return !relative.empty() && *relative.begin() != "..";
  }
};

constexpr const char* kBuffersInside = "a glTF file whose buffers are in it, in its folder or below that";
constexpr const char* kExportGlb = "export as .glb, which holds all buffers";

void require_inside(const std::string& file, const nlohmann::json& buffers, const Folder& folder) {
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    const std::string uri = buffers[i].value("uri", "");
    if (uri.empty() || uri.starts_with("data:") ||
        folder.holds((folder.path / tinygltf::dlib::urldecode(uri)).string()))
      continue;
    throw InputError({file, fmt::format("/buffers/{}/uri", i), kBuffersInside, quote(uri),
                      std::string("files outside the folder of the model are not read: ") + kExportGlb});
  }
}

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
    throw InputError(
        {file, "", kBuffersInside, quote(trimmed(error)), buffer.empty() ? kExportGlb : "export it again"});
  return model;
}

}  // namespace

GltfDocument read_gltf_document(const std::filesystem::path& file) {
  const std::string bytes = read_whole_file(file, "a glTF file"), name = file.string();
  if (bytes.size() > kLargestFile)
    throw InputError({name, "", fmt::format("at most {} bytes", kLargestFile), std::to_string(bytes.size()),
                      "export a coarser mesh"});
  const GlbParts parts = is_glb(bytes) ? parts_of_glb(name, bytes) : GlbParts{bytes, {}};
  const auto buffer = parts.buffer.value_or(std::string_view{});
  GltfDocument document;
  document.json = parse_gltf(name, parts.json);
  const nlohmann::json shapes = shapes_of_gltf(name, document.json, !buffer.empty());
  Folder folder{file.parent_path().empty() ? "." : file.parent_path(), {file}};
  require_inside(name, shapes.value("buffers", nlohmann::json::array()), folder);
  document.model = load(name, shapes.dump(), buffer, folder);
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

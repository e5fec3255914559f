#include "precompute/mesh_io/gltf_look.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/surface_io/glb.h"
#include "precompute/mesh_io/gltf_accessor.h"
#include "precompute/mesh_io/gltf_nodes.h"
#include "precompute/mesh_io/gltf_reader.h"

namespace exmat::precompute {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostBytes = 2147483647;
constexpr const char* kVariants = "KHR_materials_variants";

/// An image's type by its first bytes, as glTF and its extensions name it; empty where it is none of theirs.
std::string type_of_image(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG")) return "image/png";
  if (bytes.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
  if (bytes.starts_with("RIFF") && bytes.substr(0, 12).ends_with("WEBP")) return "image/webp";
  if (bytes.starts_with("\xABKTX 20")) return "image/ktx2";
  return "";
}

/// A URI's characters, those that are written as %XX too.
std::string decoded(const std::string& uri) {
  std::string text;
  for (std::size_t k = 0; k < uri.size(); ++k) {
    const auto is_digit = [&](std::size_t at) {
      return at < uri.size() && std::isxdigit(static_cast<unsigned char>(uri[at]));
    };
    if (uri[k] == '%' && is_digit(k + 1) && is_digit(k + 2)) {
      text += static_cast<char>(std::stoi(uri.substr(k + 1, 2), nullptr, 16));
      k += 2;
    } else {
      text += uri[k];
    }
  }
  return text;
}

/// The member, where it is an array of objects; else an empty one.
Json objects(const Json& root, const char* name) {
  const auto found = root.find(name);
  const auto is_object = [](const Json& element) { return element.is_object(); };
  if (found == root.end() || !found->is_array() || !std::ranges::all_of(*found, is_object)) return Json::array();
  return *found;
}

/// The object within objects that is reached by these names; else an empty one.
Json object_at(const Json& root, std::initializer_list<const char*> names) {
  const Json* at = &root;
  for (const char* name : names) {
    const auto found = at->find(name);
    if (found == at->end() || !found->is_object()) return Json::object();
    at = &*found;
  }
  return *at;
}

/// Copies members that are there and of that type.
void keep(const Json& from, Json& to, std::initializer_list<const char*> names, Json::value_t type) {
  for (const char* name : names)
    if (const auto found = from.find(name); found != from.end() && found->type() == type) to[name] = *found;
}

bool is_index(const Json& value) { return value.is_number_unsigned() && value.get<std::uint64_t>() < kMostBytes; }

bool stays(const std::string& attribute) {
  return attribute == "POSITION" || attribute == "NORMAL" || attribute.starts_with("TEXCOORD_") ||
         attribute.starts_with("COLOR_") || attribute.starts_with('_');
}

/// Adds the names of all extensions that are used anywhere in a value.
void add_extensions(const Json& value, std::set<std::string>& names) {
  if (value.is_object())
    for (const auto& [name, member] : value.items())
      if (name == "extensions" && member.is_object())
        for (const auto& [extension, _] : member.items()) names.insert(extension);
  if (value.is_structured())
    for (const Json& member : value) add_extensions(member, names);
}

class LookWriter {
 public:
  LookWriter(const std::filesystem::path& file, double unit, const GltfShapes& shapes)
      : path_(file),
        file_(file.string()),
        unit_(unit),
        shapes_(shapes),
        source_(shapes.document.json),
        accessors_(file_, shapes.document) {}

  std::optional<SurfaceLook> write();

 private:
  bool has_look() const;
  void add_primitives();
  Json primitive_of(const Json& from, std::size_t count);
  Json variants_of(const Json& from) const;
  void add_nodes();
  void add_materials();
  void add_image(Json& image);
  void add_extension_lists();
  int add_accessor(int accessor);
  int add_view(int view);
  int add_bytes(std::string_view bytes);

  const std::filesystem::path path_;
  const std::string file_;
  const double unit_;
  const GltfShapes& shapes_;
  const Json& source_;
  const GltfAccessors accessors_;
  Json look_;
  std::string buffer_;
  std::map<int, int> kept_accessors_, kept_views_;
  std::map<int, std::size_t> mesh_of_node_;
  std::set<std::string> unsound_;
  SurfaceLook result_;
};

bool LookWriter::has_look() const {
  std::set<int> nodes;
  for (const DrawnPrimitive& drawn : shapes_.primitives) {
    nodes.insert(drawn.node);
    const auto mesh = source_["nodes"][static_cast<std::size_t>(drawn.node)]["mesh"].get<std::size_t>();
    const Json& primitive = source_["meshes"][mesh]["primitives"][drawn.primitive];
    if (primitive.contains("material")) return true;
    for (const auto& [name, _] : primitive["attributes"].items())
      if (name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")) return true;
  }
  return nodes.size() > 1;
}

std::optional<SurfaceLook> LookWriter::write() {
  if (!has_look()) return std::nullopt;
  for (const DrawnPrimitive& drawn : shapes_.primitives)
    if (!(std::abs(drawn.to_scene.determinant()) > 0)) return std::nullopt;
  look_["asset"] = {{"version", "2.0"}};
  if (const auto asset = source_.find("asset"); asset != source_.end() && asset->is_object())
    keep(*asset, look_["asset"], {"copyright"}, Json::value_t::string);
  add_primitives();
  add_nodes();
  add_materials();
  add_extension_lists();
  for (const std::string& name : unsound_)
    result_.remarks.push_back(fmt::format("the attribute {} is not sound and left out of what is drawn", name));
  if (!buffer_.empty()) look_["buffers"] = {{{"byteLength", buffer_.size()}}};
  result_.glb = to_glb(look_.dump(-1, ' ', false, Json::error_handler_t::replace), buffer_);
  return std::move(result_);
}

void LookWriter::add_primitives() {
  const auto count = static_cast<Eigen::Index>(shapes_.primitives.size());
  result_.vertices.resize(count);
  result_.frames.resize(3 * count, 3);
  Json& meshes = look_["meshes"] = Json::array();
  for (Eigen::Index k = 0; k < count; ++k) {
    const DrawnPrimitive& drawn = shapes_.primitives[static_cast<std::size_t>(k)];
    const auto index = source_["nodes"][static_cast<std::size_t>(drawn.node)]["mesh"].get<std::size_t>();
    const Json& from = source_["meshes"][index];
    if (mesh_of_node_.try_emplace(drawn.node, meshes.size()).second) {
      Json& mesh = meshes.emplace_back(Json::object());
      keep(from, mesh, {"name"}, Json::value_t::string);
      keep(from, mesh, {"extras"}, Json::value_t::object);
      if (mesh.contains("extras")) mesh["extras"].erase("targetNames");
      if (mesh.contains("extras") && mesh["extras"].empty()) mesh.erase("extras");
    }
    const Json& primitive = from["primitives"][drawn.primitive];
    const auto positions = primitive["attributes"]["POSITION"].get<int>();
    meshes.back()["primitives"].push_back(primitive_of(primitive, accessors_.count(positions)));
    result_.vertices[k] = static_cast<std::int32_t>(drawn.first);
    result_.frames.middleRows(3 * k, 3) = unit_ * drawn.to_scene;
  }
}

Json LookWriter::primitive_of(const Json& from, std::size_t count) {
  Json to = Json::object();
  for (const auto& [name, accessor] : from["attributes"].items()) {
    if (!stays(name)) continue;
    try {
      if (!is_index(accessor)) fail_in_gltf(file_, name, "an accessor", "another value");
      accessors_.check(accessor.get<int>(), count);
      to["attributes"][name] = add_accessor(accessor.get<int>());
    } catch (const InputError&) {
      if (name == "POSITION") throw;
      unsound_.insert(name);
    }
  }
  if (from.contains("indices")) to["indices"] = add_accessor(from["indices"].get<int>());
  keep(from, to, {"material", "mode"}, Json::value_t::number_unsigned);
  keep(from, to, {"extras"}, Json::value_t::object);
  if (Json variants = variants_of(from); !variants.empty())
    to["extensions"][kVariants]["mappings"] = std::move(variants);
  return to;
}

/// The materials that a primitive has in variants, as far as they are sound.
Json LookWriter::variants_of(const Json& from) const {
  const Json extension = object_at(from, {"extensions", kVariants});
  Json kept = Json::array();
  const std::size_t materials = objects(source_, "materials").size();
  for (const Json& mapping : objects(extension, "mappings")) {
    const Json variants = mapping.value("variants", Json::array());
    const Json material = mapping.value("material", Json());
    if (is_index(material) && material.get<std::size_t>() < materials && variants.is_array() &&
        std::ranges::all_of(variants, is_index))
      kept.push_back({{"material", material}, {"variants", variants}});
  }
  return kept;
}

/// The nodes that have primitives or are above such, in the order of the file.
void LookWriter::add_nodes() {
  const Json& nodes = source_["nodes"];
  std::vector<int> parents = node_tree(file_, shapes_.document.model).parents, place(nodes.size(), -1);
  std::set<int> kept;
  // The node of a mesh with a skin counts for nothing: it becomes a root where the bones were bound.
  std::map<int, Eigen::Matrix4d> bound;
  for (const DrawnPrimitive& drawn : shapes_.primitives)
    if (drawn.bound) bound[drawn.node] = drawn.bound->matrix();
  for (const auto& [node, mesh] : mesh_of_node_) {
    if (bound.contains(node)) parents[static_cast<std::size_t>(node)] = -1;
    for (int at = node; at >= 0 && kept.insert(at).second;) at = parents[static_cast<std::size_t>(at)];
  }
  int next = 0;
  for (const int node : kept) place[static_cast<std::size_t>(node)] = next++;
  Json roots = Json::array();
  Json& list = look_["nodes"] = Json::array();
  for (const int node : kept) {
    const Json& from = nodes[static_cast<std::size_t>(node)];
    Json& to = list.emplace_back(Json::object());
    keep(from, to, {"name"}, Json::value_t::string);
    keep(from, to, {"extras"}, Json::value_t::object);
    if (const auto matrix = bound.find(node); matrix != bound.end())
      to["matrix"] = std::vector<double>(matrix->second.data(), matrix->second.data() + matrix->second.size());
    else
      keep(from, to, {"matrix", "translation", "rotation", "scale"}, Json::value_t::array);
    for (const int child : shapes_.document.model.nodes[static_cast<std::size_t>(node)].children)
      if (kept.contains(child) && parents[static_cast<std::size_t>(child)] == node)
        to["children"].push_back(place[static_cast<std::size_t>(child)]);
    if (const auto mesh = mesh_of_node_.find(node); mesh != mesh_of_node_.end()) to["mesh"] = mesh->second;
    if (parents[static_cast<std::size_t>(node)] < 0) roots.push_back(place[static_cast<std::size_t>(node)]);
  }
  if (unit_ != 1) {
    list.push_back({{"name", "unit"}, {"scale", {unit_, unit_, unit_}}, {"children", roots}});
    roots = {list.size() - 1};
  }
  look_["scene"] = 0;
  look_["scenes"] = {{{"nodes", roots}}};
}

void LookWriter::add_materials() {
  for (const char* name : {"materials", "textures", "samplers", "images"})
    if (Json list = objects(source_, name); !list.empty()) look_[name] = std::move(list);
  if (!look_.contains("images")) return;
  for (Json& image : look_["images"]) add_image(image);
}

/// Puts the bytes of an image into the buffer.
void LookWriter::add_image(Json& image) {
  if (const auto view = image.find("bufferView"); view != image.end()) {
    if (!is_index(*view) || view->get<std::size_t>() >= shapes_.document.model.bufferViews.size())
      fail_in_gltf(file_, "/images", "views of buffers that there are", view->dump());
    *view = add_view(view->get<int>());
    return;
  }
  const Json uri = image.value("uri", Json());
  if (!uri.is_string()) return;
  std::string bytes;
  const std::string name = decoded(uri.get<std::string>());
  if (tinygltf::IsDataURI(name)) {
    std::vector<unsigned char> data;
    std::string type;
    if (!tinygltf::DecodeDataURI(&data, type, uri.get<std::string>(), 0, false)) return;
    bytes.assign(data.begin(), data.end());
  } else {
    const std::filesystem::path folder = path_.parent_path().empty() ? "." : path_.parent_path();
    const std::filesystem::path source = (folder / name).lexically_normal();
    const auto relative = source.lexically_relative(folder.lexically_normal());
    std::error_code ignored;
    if (relative.empty() || *relative.begin() == ".." || !std::filesystem::is_regular_file(source, ignored)) {
      result_.remarks.push_back(fmt::format("the image {} is not in its folder: what is exported names it", name));
      return;
    }
    bytes = read_whole_file(source, "an image of a glTF file");
    result_.images.push_back(source);
    if (!image.contains("name")) image["name"] = source.stem().string();
  }
  const std::string type = type_of_image(bytes);
  if (!type.empty()) image["mimeType"] = type;
  if (!image.contains("mimeType")) return;  // a file by itself has to say what it is
  image.erase("uri");
  image["bufferView"] = add_bytes(bytes);
}

void LookWriter::add_extension_lists() {
  std::set<std::string> used;
  for (const char* name : {"materials", "textures", "samplers", "images", "meshes"})
    if (look_.contains(name)) add_extensions(look_[name], used);
  if (used.contains(kVariants))
    look_["extensions"][kVariants]["variants"] = objects(object_at(source_, {"extensions", kVariants}), "variants");
  used.insert("KHR_mesh_quantization");
  for (const char* list : {"extensionsUsed", "extensionsRequired"})
    for (const Json& name : source_.value(list, Json::array()))
      if (name.is_string() && used.contains(name.get<std::string>())) look_[list].push_back(name);
}

int LookWriter::add_accessor(int accessor) {
  const auto [known, is_new] = kept_accessors_.try_emplace(accessor, static_cast<int>(kept_accessors_.size()));
  if (!is_new) return known->second;
  const int place = known->second;
  const Json& from = source_["accessors"][static_cast<std::size_t>(accessor)];
  Json to = Json::object();
  keep(from, to, {"byteOffset", "componentType", "count"}, Json::value_t::number_unsigned);
  keep(from, to, {"type", "name"}, Json::value_t::string);
  keep(from, to, {"normalized"}, Json::value_t::boolean);
  keep(from, to, {"min", "max"}, Json::value_t::array);
  if (from.contains("bufferView")) to["bufferView"] = add_view(from["bufferView"].get<int>());
  if (from.contains("sparse")) {
    to["sparse"] = from["sparse"];
    for (const char* part : {"indices", "values"})
      to["sparse"][part]["bufferView"] = add_view(from["sparse"][part]["bufferView"].get<int>());
  }
  look_["accessors"][static_cast<std::size_t>(place)] = std::move(to);
  return place;
}

int LookWriter::add_view(int view) {
  const auto known = kept_views_.find(view);
  if (known != kept_views_.end()) return known->second;
  const tinygltf::BufferView& from = shapes_.document.model.bufferViews[static_cast<std::size_t>(view)];
  if (from.buffer < 0 || static_cast<std::size_t>(from.buffer) >= shapes_.document.model.buffers.size())
    fail_in_gltf(file_, fmt::format("/bufferViews/{}/buffer", view), "a buffer that there is",
                 std::to_string(from.buffer));
  const auto& bytes = shapes_.document.model.buffers[static_cast<std::size_t>(from.buffer)].data;
  if (from.byteOffset > bytes.size() || from.byteLength > bytes.size() - from.byteOffset)
    fail_in_gltf(file_, fmt::format("/bufferViews/{}", view), "bytes of its buffer", "others");
  const int place = add_bytes({reinterpret_cast<const char*>(bytes.data()) + from.byteOffset, from.byteLength});
  const Json& source = source_["bufferViews"][static_cast<std::size_t>(view)];
  keep(source, look_["bufferViews"][static_cast<std::size_t>(place)], {"byteStride", "target"},
       Json::value_t::number_unsigned);
  keep(source, look_["bufferViews"][static_cast<std::size_t>(place)], {"name"}, Json::value_t::string);
  kept_views_[view] = place;
  return place;
}

int LookWriter::add_bytes(std::string_view bytes) {
  if (bytes.size() + buffer_.size() > kMostBytes)
    throw InputError({file_, "", "meshes and images of at most 2 GiB", "more", "take smaller images"});
  Json& views = look_["bufferViews"];
  views.push_back({{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}});
  buffer_ += bytes;
  buffer_.append((4 - buffer_.size() % 4) % 4, '\0');
  return static_cast<int>(views.size()) - 1;
}

}  // namespace

std::optional<SurfaceLook> read_gltf_look(const std::filesystem::path& file, double unit) {
  const GltfShapes shapes = read_gltf_shapes(file);
  return LookWriter(file, unit, shapes).write();
}

}  // namespace exmat::precompute

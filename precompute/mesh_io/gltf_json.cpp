#include "precompute/mesh_io/gltf_json.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <set>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/surface_io/text_input.h"

namespace exmat::precompute {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 256;
constexpr std::uint64_t kLargest = 2147483647;
constexpr std::array<std::string_view, 3> kCompressions{"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                                        "KHR_meshopt_compression"};
// Beginnings of the names of extensions that change looks alone; quantisation is read.
constexpr std::array<std::string_view, 5> kHarmless{"KHR_mesh_quantization", "KHR_materials_", "KHR_texture_",
                                                    "EXT_texture_", "KHR_lights_"};
constexpr auto kCompressionAdvice = "export without compression";

// A member of the file: its value and JSON pointer.
struct Member {
  const Json* value;
  std::string place;
};

class ShapeReader {
 public:
  ShapeReader(const std::string& file, bool is_binary) : file_(file), is_binary_(is_binary) {}
  Json read(const Json& root);

 private:
  [[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found,
                         const std::string& advice = "") const {
    throw InputError({file_, place.empty() ? "/" : place, expected, found, advice});
  }
  // Null where the object has no such member.
  Member member(const Member& object, const std::string& name) const;
  Member checked(const Member& object, const std::string& name, Json::value_t type, const std::string& expected) const;
  std::vector<Member> elements(const Member& object, const std::string& name) const;
  void require_object(const Member& member) const;
  void check_integer(const Member& member) const;
  void keep_integers(const Member& from, Json& to, std::initializer_list<const char*> names,
                     bool required = false) const;
  void keep_string(const Member& from, Json& to, const std::string& name) const;
  void keep_index_list(const Member& from, Json& to, const std::string& name) const;
  void keep_numbers(const Member& from, Json& to, const std::string& name, std::size_t length) const;
  Json kept_attributes(const Member& attributes, bool of_target) const;

  void check_version(const Member& root) const;
  void check_extensions(const Member& root) const;
  Json buffer(const Member& from, bool is_first);
  Json buffer_view(const Member& from) const;
  Json accessor(const Member& from) const;
  Json primitive(const Member& from, const Json& accessors) const;
  Json mesh(const Member& from, const Json& accessors) const;
  Json node(const Member& from) const;
  Json skin(const Member& from) const;
  Json animation(const Member& from) const;

  const std::string& file_;
  bool is_binary_;
  std::set<std::string> uris_;
};

Member ShapeReader::member(const Member& object, const std::string& name) const {
  const auto found = object.value->find(name);
  return {found == object.value->end() ? nullptr : &*found, object.place + "/" + name};
}

Member ShapeReader::checked(const Member& object, const std::string& name, Json::value_t type,
                            const std::string& expected) const {
  Member found = member(object, name);
  if (found.value && found.value->type() != type) fail(found.place, expected, found.value->type_name());
  return found;
}

std::vector<Member> ShapeReader::elements(const Member& object, const std::string& name) const {
  const Member list = checked(object, name, Json::value_t::array, "an array");
  std::vector<Member> found;
  if (list.value)
    for (const Json& element : *list.value) found.push_back({&element, fmt::format("{}/{}", list.place, found.size())});
  return found;
}

void ShapeReader::require_object(const Member& member) const {
  if (!member.value->is_object()) fail(member.place, "an object", member.value->type_name());
}

void ShapeReader::check_integer(const Member& member) const {
  if (!member.value->is_number_unsigned() || member.value->get<std::uint64_t>() > kLargest)
    fail(member.place, fmt::format("an integer from 0 to {}", kLargest),
         quote(member.value->dump(-1, ' ', true).substr(0, 40)));
}

void ShapeReader::keep_integers(const Member& from, Json& to, std::initializer_list<const char*> names,
                                bool required) const {
  for (const char* name : names) {
    const Member found = member(from, name);
    if (!found.value && required) fail(found.place, fmt::format("an integer from 0 to {}", kLargest), "none");
    if (!found.value) continue;
    check_integer(found);
    to[name] = *found.value;
  }
}

void ShapeReader::keep_string(const Member& from, Json& to, const std::string& name) const {
  const Member found = checked(from, name, Json::value_t::string, "a string");
  if (found.value) to[name] = *found.value;
}

void ShapeReader::keep_index_list(const Member& from, Json& to, const std::string& name) const {
  const auto list = elements(from, name);
  for (const Member& element : list) check_integer(element);
  if (!list.empty()) to[name] = from.value->at(name);
}

void ShapeReader::keep_numbers(const Member& from, Json& to, const std::string& name, std::size_t length) const {
  const Member list = member(from, name);
  if (!list.value) return;
  const auto is_number = [](const Json& value) { return value.is_number(); };
  if (!list.value->is_array() || list.value->size() != length || !std::ranges::all_of(*list.value, is_number))
    fail(list.place, fmt::format("an array of {} numbers", length), "another value");
  to[name] = *list.value;
}

void ShapeReader::check_version(const Member& root) const {
  const Member asset = checked(root, "asset", Json::value_t::object, "an object");
  if (!asset.value) fail(asset.place, "the version of glTF", "none", "is this a glTF file?");
  const Member version = checked(asset, "version", Json::value_t::string, "a string");
  const std::string found = version.value ? version.value->get<std::string>() : "none";
  if (!found.starts_with("2.")) fail(version.place, "version 2.0 of glTF", quote(found), "export as glTF 2.0");
}

void ShapeReader::check_extensions(const Member& root) const {
  for (const Member& extension : elements(root, "extensionsRequired")) {
    const std::string name = extension.value->is_string() ? extension.value->get<std::string>() : "another value";
    if (std::ranges::count(kCompressions, name) > 0)
      fail(extension.place, "meshes without compression", quote(name), kCompressionAdvice);
    if (std::ranges::none_of(kHarmless, [&](std::string_view known) { return name.starts_with(known); }))
      fail(extension.place, "no extension but KHR_mesh_quantization and those of looks", quote(name),
           "export without this extension");
  }
}

Json ShapeReader::buffer(const Member& from, bool is_first) {
  Json to = Json::object();
  keep_integers(from, to, {"byteLength"}, true);
  if (to["byteLength"] == 0) fail(from.place + "/byteLength", "at least 1 byte", "0");
  keep_string(from, to, "uri");
  const std::string uri = to.value("uri", "");
  if (uri.empty() && !(is_binary_ && is_first))
    fail(from.place + "/uri", is_binary_ ? "a URI of every buffer but the first" : "a URI of the buffer", "none",
         "export without compression, or as .glb");
  if (!uri.starts_with("data:") && !uris_.insert(uri).second)
    fail(from.place + "/uri", "a file of its own", quote(uri));
  return to;
}

Json ShapeReader::buffer_view(const Member& from) const {
  const Member extensions = checked(from, "extensions", Json::value_t::object, "an object");
  if (extensions.value)
    for (const std::string_view name : kCompressions)
      if (extensions.value->contains(std::string(name)))
        fail(extensions.place, "meshes without compression", quote(name), kCompressionAdvice);
  Json to = Json::object();
  keep_integers(from, to, {"buffer", "byteLength"}, true);
  keep_integers(from, to, {"byteOffset", "byteStride"});
  return to;
}

Json ShapeReader::accessor(const Member& from) const {
  Json to = Json::object();
  keep_integers(from, to, {"componentType", "count"}, true);
  keep_integers(from, to, {"bufferView", "byteOffset"});
  keep_string(from, to, "type");
  const Member normalized = checked(from, "normalized", Json::value_t::boolean, "true or false");
  if (normalized.value) to["normalized"] = *normalized.value;
  const Member sparse = checked(from, "sparse", Json::value_t::object, "an object");
  if (!sparse.value) return to;
  keep_integers(sparse, to["sparse"], {"count"}, true);
  for (const char* name : {"indices", "values"}) {
    const Member part = checked(sparse, name, Json::value_t::object, "an object");
    if (!part.value) fail(part.place, "an object", "none");
    Json& kept = to["sparse"][name];
    keep_integers(part, kept, {"bufferView"}, true);
    keep_integers(part, kept, {"byteOffset"});
    if (std::string_view(name) == "indices") keep_integers(part, kept, {"componentType"}, true);
  }
  return to;
}

Json ShapeReader::kept_attributes(const Member& attributes, bool of_target) const {
  require_object(attributes);
  Json to = Json::object();
  for (const auto& [name, value] : attributes.value->items()) {
    if (name != "POSITION" && (of_target || (name != "COLOR_0" && !name.starts_with('_') &&
                                             !name.starts_with("JOINTS_") && !name.starts_with("WEIGHTS_"))))
      continue;
    check_integer({&value, attributes.place + "/" + name});
    to[name] = value;
  }
  return to;
}

Json ShapeReader::primitive(const Member& from, const Json& accessors) const {
  Json to = Json::object();
  keep_integers(from, to, {"indices", "material", "mode"});
  const Member attributes = member(from, "attributes");
  if (!attributes.value) fail(attributes.place, "the attributes of a primitive", "none");
  to["attributes"] = kept_attributes(attributes, false);
  for (const Member& target : elements(from, "targets")) to["targets"].push_back(kept_attributes(target, true));
  const Member extensions = checked(from, "extensions", Json::value_t::object, "an object");
  if (!extensions.value || !extensions.value->contains(std::string(kCompressions[0]))) return to;
  // The extension is harmless where the mesh is there without it, too.
  const std::uint64_t positions = to["attributes"].value("POSITION", kLargest);
  if (positions >= accessors.size() || !accessors[positions].contains("bufferView"))
    fail(extensions.place, "meshes without compression", quote(kCompressions[0]), kCompressionAdvice);
  return to;
}

Json ShapeReader::mesh(const Member& from, const Json& accessors) const {
  Json to = {{"primitives", Json::array()}};
  keep_string(from, to, "name");
  for (const Member& part : elements(from, "primitives")) {
    require_object(part);
    to["primitives"].push_back(primitive(part, accessors));
  }
  const Member extras = member(from, "extras");
  if (!extras.value || !extras.value->is_object()) return to;
  const Member names = member(extras, "targetNames");
  if (names.value && names.value->is_array() &&
      std::ranges::all_of(*names.value, [](const Json& name) { return name.is_string(); }))
    to["extras"]["targetNames"] = *names.value;
  return to;
}

Json ShapeReader::node(const Member& from) const {
  Json to = Json::object();
  keep_string(from, to, "name");
  keep_integers(from, to, {"mesh", "skin"});
  keep_index_list(from, to, "children");
  keep_numbers(from, to, "matrix", 16);
  keep_numbers(from, to, "translation", 3);
  keep_numbers(from, to, "rotation", 4);
  keep_numbers(from, to, "scale", 3);
  return to;
}

Json ShapeReader::skin(const Member& from) const {
  Json to = {{"joints", Json::array()}};
  keep_string(from, to, "name");
  keep_integers(from, to, {"inverseBindMatrices"});
  keep_index_list(from, to, "joints");
  return to;
}

Json ShapeReader::animation(const Member& from) const {
  Json to = {{"channels", Json::array()}, {"samplers", Json::array()}};
  keep_string(from, to, "name");
  for (const Member& channel : elements(from, "channels")) {
    require_object(channel);
    Json kept = Json::object();
    keep_integers(channel, kept, {"sampler"}, true);
    const Member target = checked(channel, "target", Json::value_t::object, "an object");
    if (!target.value) fail(target.place, "an object", "none");
    kept["target"] = Json::object();
    keep_integers(target, kept["target"], {"node"});
    keep_string(target, kept["target"], "path");
    if (!kept["target"].contains("path")) fail(target.place + "/path", "a string", "none");
    to["channels"].push_back(kept);
  }
  for (const Member& sampler : elements(from, "samplers")) {
    require_object(sampler);
    Json kept = {{"interpolation", "LINEAR"}};
    keep_integers(sampler, kept, {"input", "output"}, true);
    keep_string(sampler, kept, "interpolation");
    to["samplers"].push_back(kept);
  }
  return to;
}

Json ShapeReader::read(const Json& value) {
  const Member root{&value, ""};
  require_object(root);
  check_version(root);
  check_extensions(root);
  Json shapes = {{"asset", {{"version", "2.0"}}}};
  const auto keep_all = [&](const char* name, const auto& kept) {
    Json& list = shapes[name] = Json::array();
    for (const Member& element : elements(root, name)) {
      require_object(element);
      list.push_back(kept(element));
    }
  };
  keep_all("buffers", [&](const Member& from) { return buffer(from, shapes["buffers"].empty()); });
  keep_all("bufferViews", [&](const Member& from) { return buffer_view(from); });
  keep_all("accessors", [&](const Member& from) { return accessor(from); });
  keep_all("meshes", [&](const Member& from) { return mesh(from, shapes["accessors"]); });
  keep_all("nodes", [&](const Member& from) { return node(from); });
  keep_all("scenes", [&](const Member& from) {
    Json to = Json::object();
    keep_index_list(from, to, "nodes");
    return to;
  });
  keep_all("materials", [&](const Member& from) {
    Json to = Json::object();
    keep_string(from, to, "name");
    return to;
  });
  keep_all("skins", [&](const Member& from) { return skin(from); });
  // Morph weights and extensions move no bones.
  keep_all("animations", [&](const Member& from) { return animation(from); });
  keep_integers(root, shapes, {"scene"});
  return shapes;
}

// Deeply nested values, which no glTF file needs, could exhaust the stack of whoever walks them.
bool is_too_deep(std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char letter = text[k];
    if (in_string && letter == '\\') ++k;
    if (letter == '"') in_string = !in_string;
    if (in_string) continue;
    if (letter == '[' || letter == '{') ++depth;
    if (letter == ']' || letter == '}') --depth;
    if (depth > kDeepest) return true;
  }
  return false;
}

// Throws Json::exception. Programs cut long names inside a character: what is no UTF-8 becomes U+FFFD.
Json parse_with_cut_names(const std::string& file, std::string_view text) {
  const std::string quoted = Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
  Json root = Json::parse(Json::parse(quoted).get<std::string>());
  log::info(fmt::format("{}: names that are no UTF-8, such as cut ones, are read with U+FFFD in that place", file));
  return root;
}

}  // namespace

Json parse_gltf(const std::string& file, std::string_view text) {
  text = text.substr(0, text.find_last_not_of(std::string_view(" \0", 2)) + 1);  // some programs pad by zeros
  // nlohmann would end the text there and leave the rest unread.
  if (const auto nul = text.find('\0'); nul != std::string_view::npos)
    throw InputError(
        {file, "", "JSON", fmt::format("character U+0000 after {} bytes of it", nul), "is the file damaged?"});
  if (is_too_deep(text)) throw InputError({file, "", fmt::format("JSON of at most {} levels", kDeepest), "more", ""});
  try {
    return Json::parse(text);
  } catch (const Json::exception& error) {
    try {
      return parse_with_cut_names(file, text);
    } catch (const Json::exception&) {
      throw InputError({file, "", "JSON", error.what(), "is this a whole glTF file?"});
    }
  }
}

Json shapes_of_gltf(const std::string& file, const Json& root, bool is_binary) {
  return ShapeReader(file, is_binary).read(root);
}

}  // namespace exmat::precompute

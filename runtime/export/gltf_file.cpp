#include "runtime/export/gltf_file.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/version.h"
#include "common/mesh/geometry.h"
#include "common/surface_io/glb.h"
#include "runtime/export/drawn_skin.h"
#include "runtime/export/surface_look.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little, "a buffer of glTF is little-endian");

using FloatMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr Eigen::Index kShortIndices = 65535;  // vertices that 16 bits count, the last number being reserved
constexpr std::size_t kMostBytes = std::numeric_limits<std::int32_t>::max();
constexpr const char* kVariants = "KHR_materials_variants";

/// Column k of a matrix, [3v x N], as v rows.
FloatMatrix vectors_of(const RowMatrix& matrix, Eigen::Index column) {
  FloatMatrix vectors(matrix.rows() / 3, 3);
  vectors.reshaped<Eigen::RowMajor>() = matrix.col(column).cast<float>();
  return vectors;
}

/// F x 3, where the origin of a body's mesh is in the world [m].
RowMatrix places_of(const DrawnSurface& surface, const BodyMotion& motion) {
  RowMatrix places = motion.positions.rowwise() + surface.origin.transpose();
  if (surface.free) return places;
  for (Eigen::Index frame = 0; frame < motion.frames(); ++frame) {
    const auto turn = motion.orientations.row(frame);
    places.row(frame) = motion.positions.row(frame) +
                        (Eigen::Quaterniond(turn[0], turn[1], turn[2], turn[3]) * surface.origin).transpose();
  }
  return places;
}

/// Numbers of glTF for the types of accessors and the use of views.
enum ComponentType { kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126 };
enum ViewUse { kOther = 0, kVertices = 34962, kIndices = 34963 };
constexpr int kTriangles = 4;

Json json_of(const Eigen::VectorXd& vector) { return std::vector<double>(vector.begin(), vector.end()); }

/// Adds a number to an index of a document, where it has one.
void shift(Json& object, const char* member, std::size_t by) {
  if (const auto found = object.find(member); found != object.end()) *found = found->get<std::size_t>() + by;
}

/// Adds a number to the indices of textures in a material or an extension of one: members whose names end so.
void shift_textures(Json& value, std::size_t by) {
  if (!value.is_structured()) return;
  for (auto member = value.begin(); member != value.end(); ++member) {
    if (value.is_object() && std::string_view(member.key()).ends_with("Texture") && member->is_object())
      shift(*member, "index", by);
    shift_textures(*member, by);
  }
}

/// Calls use(element) of a member's elements, of none where there is no such member.
template <typename Object, typename Use>
void for_each(Object& object, const char* member, const Use& use) {
  if (const auto found = object.find(member); found != object.end())
    for (auto& element : *found) use(element);
}

/// A node's transform to what is above it.
Eigen::Affine3d transform_of(const Json& node) {
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  const auto numbers = [&](const char* member) { return node.at(member).get<std::vector<double>>(); };
  if (node.contains("matrix")) {
    for (std::size_t k = 0; k < 16; ++k)
      transform.matrix()(static_cast<Eigen::Index>(k % 4), static_cast<Eigen::Index>(k / 4)) = numbers("matrix").at(k);
    return transform;
  }
  const auto vector = [&](const char* member) {
    const std::vector<double> all = numbers(member);
    return Eigen::Vector3d(all.at(0), all.at(1), all.at(2));
  };
  if (node.contains("translation")) transform.translate(vector("translation"));
  if (node.contains("rotation"))
    transform.rotate(Eigen::Quaterniond(numbers("rotation").at(3), vector("rotation")[0], vector("rotation")[1],
                                        vector("rotation")[2])
                         .normalized());
  if (node.contains("scale")) transform.scale(vector("scale"));
  return transform;
}

class GltfWriter {
 public:
  explicit GltfWriter(std::string file) : file_(std::move(file)) {
    root_ = {{"asset", {{"version", "2.0"}, {"generator", fmt::format("exmat-runtime {}", version())}}}, {"scene", 0}};
    for (const char* list : {"accessors", "bufferViews", "meshes", "nodes"}) root_[list] = Json::array();
  }

  /// `has_weights`: the mesh, not its nodes.
  void add_mesh(const DrawnKind& kind, bool has_weights) {
    Kind& added = kinds_.emplace_back();
    if (!kind.surface.look) return add_plain_mesh(kind, has_weights, added);
    try {
      add_look(*kind.surface.look, added);
      move_look(kind, has_weights, added);
    } catch (const Json::exception& error) {
      throw InputError({file_, "", fmt::format("a sound look of {}", kind.surface.name), error.what(),
                        "precompute the bundle again"});
    }
  }

  void add_nodes(const std::vector<DrawnKind>& kinds, const std::vector<DrawnBody>& bodies, UpAxis up) {
    Json& nodes = root_["nodes"];
    if (up == UpAxis::kZ) nodes.push_back({{"name", "y up"}, {"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}});
    origin_ = origin_of(kinds, bodies);
    Json skinned = Json::array();  // meshes with a skin stand by themselves, for nodes above them count for nothing
    const std::size_t above = nodes.size();
    if (!origin_.isZero(0)) nodes.push_back({{"name", "origin"}, {"translation", json_of(origin_)}});
    Json list = Json::array();
    for (const DrawnBody& drawn : bodies) {
      const DrawnSurface& surface = kinds[drawn.kind].surface;
      Body& body = bodies_.emplace_back();
      body.node = nodes.size();
      list.push_back(body.node);
      nodes.push_back({{"name", drawn.name}, {"translation", json_of(surface.origin - origin_)}});
      if (surface.skin)
        add_skinned_nodes(kinds_[drawn.kind], surface, body, skinned);
      else
        add_drawn_nodes(kinds_[drawn.kind], surface.origin, body);
      if (bodies.size() == 1 || drawn.weights.rows() == 0) continue;
      for (const std::size_t node : body.meshes) nodes[node]["weights"] = first_of(drawn.weights);
    }
    if (!origin_.isZero(0)) nodes[above]["children"] = std::exchange(list, Json::array({above}));
    if (up == UpAxis::kZ) nodes.front()["children"] = std::exchange(list, Json::array({0}));
    for (Json& node : skinned) list.push_back(std::move(node));
    root_["scenes"] = {{{"nodes", list}}};
  }

  void add_animations(const std::vector<DrawnKind>& kinds, const std::vector<DrawnBody>& bodies) {
    const Eigen::VectorXd& times = bodies.front().motion->times;
    add_times(times);
    Json animation = {{"name", "motion"}, {"samplers", Json::array()}, {"channels", Json::array()}};
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (bodies[i].motion->times != times)
        throw InputError({file_, "", "frames of all bodies at the same times",
                          fmt::format("others of {}", bodies[i].name), "is this a trajectory of one run?"});
      add_channels(kinds[bodies[i].kind].surface, bodies[i], bodies_[i], animation);
    }
    root_["animations"] = {std::move(animation)};
  }

  std::int64_t write(const std::filesystem::path& target) {
    root_["buffers"] = {{{"byteLength", buffer_.size()}}};
    const std::string glb = to_glb(root_.dump(-1, ' ', false, Json::error_handler_t::replace), buffer_);
    AtomicFile output(target);
    std::ofstream stream(output.temporary(), std::ios::binary | std::ios::trunc);
    stream.write(glb.data(), static_cast<std::streamsize>(glb.size()));
    stream.close();
    if (!stream) throw WorkError("cannot write " + target.string() + ": " + std::generic_category().message(errno));
    output.commit();
    return std::ssize(glb);
  }

 private:
  /// Nodes of a kind of body: those of its look, their meshes and children as numbered here and there; or one mesh.
  struct Kind {
    Json nodes = Json::array(), roots = Json::array();
    std::size_t first_mesh = 0;
  };
  struct Body {
    std::size_t node = 0;
    std::vector<std::size_t> meshes;  ///< nodes with one
    std::size_t first_bone = 0;       ///< node of the first of its bones, which the others follow
  };

  std::size_t size_of(const char* list) const { return root_.contains(list) ? root_[list].size() : 0; }

  /// Weights in the first frame.
  static Json first_of(const RowMatrix& weights) { return json_of(weights.row(0).transpose()); }

  static Json names_of(const MorphTargets& targets) { return {{"targetNames", targets.names}}; }

  /// Weights that a mesh has by itself: those of the first frame, where there is one.
  static Json weights_of(const MorphTargets& targets) {
    if (targets.weights.rows() > 0) return first_of(targets.weights);
    return std::vector<double>(static_cast<std::size_t>(targets.displacements.cols()), 0.0);
  }

  void add_plain_mesh(const DrawnKind& kind, bool has_weights, Kind& added) {
    const auto& [surface, normals, targets] = kind;
    Json primitive = {{"mode", kTriangles}, {"material", plain_material()}};
    primitive["indices"] = add_indices(surface.triangles, surface.vertex_count());
    primitive["attributes"]["POSITION"] = add_floats(surface.vertices.cast<float>(), "VEC3", kVertices, true);
    primitive["attributes"]["NORMAL"] = add_floats(normals.cast<float>(), "VEC3", kVertices);
    if (surface.skin) add_influences(*surface.skin, 0, surface.vertex_count(), primitive);
    for (Eigen::Index k = 0; k < targets.displacements.cols(); ++k)
      primitive["targets"].push_back(
          {{"POSITION", add_floats(vectors_of(targets.displacements, k), "VEC3", kVertices, true)},
           {"NORMAL", add_floats(vectors_of(targets.normals, k), "VEC3", kVertices)}});
    Json mesh = {{"name", surface.name}, {"primitives", {std::move(primitive)}}, {"extras", names_of(targets)}};
    if (has_weights) mesh["weights"] = weights_of(targets);
    added.first_mesh = size_of("meshes");
    root_["meshes"].push_back(std::move(mesh));
  }

  /// The material of surfaces without a look.
  std::size_t plain_material() {
    if (!plain_material_) {
      plain_material_ = size_of("materials");
      root_["materials"].push_back({{"name", "material"},
                                    {"doubleSided", true},
                                    {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.6}}}});
    }
    return *plain_material_;
  }

  /// A document becomes part of this one: its indices go on from those that are there.
  void add_look(const SurfaceLook& look, Kind& added) {
    Json document = look.document;
    buffer_.append((4 - buffer_.size() % 4) % 4, '\0');
    const std::size_t views = size_of("bufferViews"), accessors = size_of("accessors"), images = size_of("images"),
                      samplers = size_of("samplers"), textures = size_of("textures"), materials = size_of("materials");
    require_room(look.buffer.size());
    for_each(document, "bufferViews", [&](Json& view) {
      view["buffer"] = 0;
      view["byteOffset"] = view.value("byteOffset", std::size_t{0}) + buffer_.size();
    });
    buffer_ += look.buffer;
    for_each(document, "accessors", [&](Json& accessor) {
      shift(accessor, "bufferView", views);
      if (!accessor.contains("sparse")) return;
      shift(accessor["sparse"]["indices"], "bufferView", views);
      shift(accessor["sparse"]["values"], "bufferView", views);
    });
    for_each(document, "images", [&](Json& image) { shift(image, "bufferView", views); });
    for_each(document, "textures", [&](Json& texture) {
      shift(texture, "sampler", samplers);
      shift(texture, "source", images);
      for_each(texture, "extensions", [&](Json& extension) {
        if (extension.is_object()) shift(extension, "source", images);
      });
    });
    for_each(document, "materials", [&](Json& material) { shift_textures(material, textures); });
    for (Json& mesh : document.at("meshes"))
      for (Json& primitive : mesh.at("primitives")) {
        for (Json& attribute : primitive.at("attributes")) attribute = attribute.get<std::size_t>() + accessors;
        shift(primitive, "indices", accessors);
        shift(primitive, "material", materials);
        shift_variants(primitive, materials);
      }
    append_variants(document);
    added.first_mesh = size_of("meshes");
    added.nodes = document.at("nodes");
    added.roots = document.at("scenes").at(0).at("nodes");
    for (const char* name : {"accessors", "bufferViews", "images", "samplers", "textures", "materials", "meshes"})
      for_each(document, name, [&](Json& element) { root_[name].push_back(std::move(element)); });
    for (const char* name : {"extensionsUsed", "extensionsRequired"})
      for_each(document, name, [&](const Json& extension) {
        Json& known = root_[name];
        if (std::ranges::find(known, extension) == known.end()) known.push_back(extension);
      });
    add_copyright(document.at("asset"));
  }

  void shift_variants(Json& primitive, std::size_t materials) const {
    if (!primitive.contains("extensions") || !primitive["extensions"].contains(kVariants)) return;
    for (Json& mapping : primitive["extensions"][kVariants].at("mappings")) {
      shift(mapping, "material", materials);
      for (Json& variant : mapping.at("variants")) variant = variant.get<std::size_t>() + variants_;
    }
  }

  void append_variants(const Json& document) {
    if (!document.contains("extensions") || !document["extensions"].contains(kVariants)) return;
    for (const Json& variant : document["extensions"][kVariants].at("variants"))
      root_["extensions"][kVariants]["variants"].push_back(variant);
    variants_ = root_["extensions"][kVariants]["variants"].size();
  }

  void add_copyright(const Json& asset) {
    if (!asset.contains("copyright")) return;
    const auto added = asset["copyright"].get<std::string>();
    std::string known = root_["asset"].value("copyright", "");
    if (known.find(added) != std::string::npos) return;
    root_["asset"]["copyright"] = known.empty() ? added : known + "; " + added;
  }

  /// Morph targets of the meshes of a look, which was added last, and normals where they have none.
  void move_look(const DrawnKind& kind, bool has_weights, const Kind& added) {
    const MorphTargets& targets = kind.targets;
    std::size_t index = 0;
    for (std::size_t m = added.first_mesh; m < size_of("meshes"); ++m) {
      Json mesh = std::move(root_["meshes"][m]);
      for (Json& primitive : mesh.at("primitives"))
        move_primitive(kind, kind.surface.look->primitives.at(index++), primitive);
      mesh["extras"].update(names_of(targets));
      if (has_weights) mesh["weights"] = weights_of(targets);
      root_["meshes"][m] = std::move(mesh);
    }
  }

  void move_primitive(const DrawnKind& kind, const LookPrimitive& place, Json& primitive) {
    const auto& [surface, normals, targets] = kind;
    const Eigen::Matrix3d to_mesh = place.frame.inverse(), turn = place.frame.transpose();
    const RowMatrix rest = normals.middleRows(place.first, place.count) * turn.transpose();
    const Eigen::VectorXd scale = rest.rowwise().norm().cwiseInverse();
    const auto in_mesh = [&](const RowMatrix& columns, Eigen::Index k, const Eigen::Matrix3d& matrix) {
      const RowMatrix vectors =
          columns.col(k).segment(3 * place.first, 3 * place.count).reshaped<Eigen::RowMajor>(place.count, 3);
      return RowMatrix(vectors * matrix.transpose());
    };
    if (!primitive["attributes"].contains("NORMAL"))
      primitive["attributes"]["NORMAL"] = add_floats((scale.asDiagonal() * rest).cast<float>(), "VEC3", kVertices);
    if (surface.skin) add_influences(*surface.skin, place.first, place.count, primitive);
    primitive["targets"] = Json::array();
    for (Eigen::Index k = 0; k < targets.displacements.cols(); ++k) {
      const FloatMatrix moved = in_mesh(targets.displacements, k, to_mesh).cast<float>();
      const FloatMatrix turned = (scale.asDiagonal() * in_mesh(targets.normals, k, turn)).cast<float>();
      primitive["targets"].push_back({{"POSITION", add_floats(moved, "VEC3", kVertices, true)},
                                      {"NORMAL", add_floats(turned, "VEC3", kVertices)}});
    }
  }

  /// Adds the nodes below a body's node: a mesh, or the nodes of its look, which stand where the surface is at rest.
  void add_drawn_nodes(const Kind& kind, const Eigen::Vector3d& origin, Body& body) {
    Json& nodes = root_["nodes"];
    if (kind.nodes.empty()) {
      nodes[body.node]["mesh"] = kind.first_mesh;
      body.meshes = {body.node};
      return;
    }
    std::size_t above = body.node;
    if (!origin.isZero(0)) {
      above = nodes.size();
      nodes[body.node]["children"] = {above};
      nodes.push_back({{"name", "rest"}, {"translation", json_of(-origin)}});
    }
    const std::size_t first = nodes.size();
    for (Json node : kind.nodes) {
      for_each(node, "children", [&](Json& child) { child = child.get<std::size_t>() + first; });
      shift(node, "mesh", kind.first_mesh);
      if (node.contains("mesh")) body.meshes.push_back(nodes.size());
      nodes.push_back(std::move(node));
    }
    for (const Json& root : kind.roots) nodes[above]["children"].push_back(root.get<std::size_t>() + first);
  }

  /// Adds the bones of a body below its node, and its meshes as nodes of the scene.
  void add_skinned_nodes(const Kind& kind, const DrawnSurface& surface, Body& body, Json& scene) {
    Json& nodes = root_["nodes"];
    const DrawnSkin& skin = *surface.skin;
    body.first_bone = nodes.size();
    Json joints = Json::array();
    for (std::size_t b = 0; b < skin.names.size(); ++b) {
      const Eigen::Isometry3d place = below_parent(surface, skin.bind, b);
      const int parent = skin.parents[static_cast<Eigen::Index>(b)];
      const std::size_t above = parent < 0 ? body.node : body.first_bone + static_cast<std::size_t>(parent);
      joints.push_back(nodes.size());
      nodes[above]["children"].push_back(nodes.size());
      nodes.push_back({{"name", skin.names[b]},
                       {"translation", json_of(place.translation())},
                       {"rotation", json_of(Eigen::Quaterniond(place.linear()).coeffs())}});
    }
    const auto add = [&](Json node, const Eigen::Affine3d& mesh_to_rest) {
      FloatMatrix matrices(std::ssize(skin.bind), 16);
      for (std::size_t b = 0; b < skin.bind.size(); ++b) {
        const Eigen::Matrix4d matrix = (skin.bind[b].inverse() * mesh_to_rest).matrix();
        matrices.row(static_cast<Eigen::Index>(b)) = matrix.reshaped().cast<float>();
      }
      node["skin"] = size_of("skins");
      root_["skins"].push_back({{"joints", joints}, {"inverseBindMatrices", add_floats(matrices, "MAT4", kOther)}});
      body.meshes.push_back(nodes.size());
      scene.push_back(nodes.size());
      nodes.push_back(std::move(node));
    };
    if (kind.nodes.empty())
      return add({{"name", surface.name}, {"mesh", kind.first_mesh}},
                 Eigen::Affine3d(Eigen::Translation3d(surface.origin)));
    const auto visit = [&](const auto& self, const Json& node, const Eigen::Affine3d& above) -> void {
      const Eigen::Affine3d place = above * transform_of(node);
      if (node.contains("mesh")) {
        Json drawn = {{"mesh", node["mesh"].get<std::size_t>() + kind.first_mesh}};
        for (const char* member : {"name", "extras"})
          if (node.contains(member)) drawn[member] = node[member];
        add(std::move(drawn), place);
      }
      for_each(node, "children",
               [&](const Json& child) { self(self, kind.nodes.at(child.get<std::size_t>()), place); });
    };
    for (const Json& root : kind.roots)
      visit(visit, kind.nodes.at(root.get<std::size_t>()), Eigen::Affine3d::Identity());
  }

  /// From a bone to its parent or, of a root, to its body's node, with bones where they are in the world.
  static Eigen::Isometry3d below_parent(const DrawnSurface& surface, const std::vector<Eigen::Isometry3d>& bones,
                                        std::size_t bone) {
    const int parent = surface.skin->parents[static_cast<Eigen::Index>(bone)];
    if (parent >= 0) return bones[static_cast<std::size_t>(parent)].inverse() * bones[bone];
    return Eigen::Translation3d(-surface.origin) * bones[bone];
  }

  void add_bone_channels(const DrawnSurface& surface, const BodyMotion& motion, const Body& body, Json& animation) {
    const std::size_t bones = surface.skin->names.size();
    std::vector<FloatMatrix> joints(bones, FloatMatrix(motion.frames(), 3)),
        turns(bones, FloatMatrix(motion.frames(), 4));
    std::vector<Eigen::Quaterniond> last(bones, Eigen::Quaterniond::Identity());
    for (Eigen::Index frame = 0; frame < motion.frames(); ++frame) {
      const std::vector<Eigen::Isometry3d> all = placed(*surface.skin, motion.bones.row(frame));
      for (std::size_t b = 0; b < bones; ++b) {
        const Eigen::Isometry3d place = below_parent(surface, all, b);
        Eigen::Quaterniond turn(place.linear());
        if (turn.dot(last[b]) < 0) turn.coeffs() *= -1;
        last[b] = turn;
        joints[b].row(frame) = place.translation().cast<float>();
        turns[b].row(frame) = turn.coeffs().cast<float>();
      }
    }
    for (std::size_t b = 0; b < bones; ++b) {
      add_channels(animation, {body.first_bone + b}, "translation", add_floats(joints[b], "VEC3", kOther));
      add_channels(animation, {body.first_bone + b}, "rotation", add_floats(turns[b], "VEC4", kOther));
    }
  }

  void add_times(const Eigen::VectorXd& seconds) {
    const FloatMatrix times = seconds.cast<float>();
    for (Eigen::Index frame = 1; frame < times.size(); ++frame)
      if (!(times(frame) > times(frame - 1)))
        throw InputError({file_, "", "frames at different times in single precision, as glTF has them",
                          fmt::format("frames {} and {} at {:.9g} s", frame - 1, frame, seconds[frame]),
                          "write fewer frames (output.every of the scene)"});
    input_ = add_floats(times, "SCALAR", kOther, true);
  }

  void add_channels(const DrawnSurface& surface, const DrawnBody& drawn, const Body& body, Json& animation) {
    const BodyMotion& motion = *drawn.motion;
    const FloatMatrix weights = drawn.weights.cast<float>().reshaped<Eigen::RowMajor>();
    add_channels(animation, body.meshes, "weights", add_floats(weights, "SCALAR", kOther));
    if (surface.skin) return add_bone_channels(surface, motion, body, animation);
    const RowMatrix places = places_of(surface, motion).rowwise() - origin_.transpose();
    const RowMatrix& turns = motion.orientations;
    if (!(places.rowwise() - places.row(0)).isZero(0) || !motion.positions.row(0).isZero(0))
      add_channels(animation, {body.node}, "translation", add_floats(places.cast<float>(), "VEC3", kOther));
    if (!turns.rightCols(3).isZero(0)) {
      FloatMatrix quaternions(turns.rows(), 4);
      quaternions << turns.rightCols(3).cast<float>(), turns.leftCols(1).cast<float>();
      add_channels(animation, {body.node}, "rotation", add_floats(quaternions, "VEC4", kOther));
    }
  }

  /// One sampler, and a channel for each of the nodes.
  void add_channels(Json& animation, const std::vector<std::size_t>& nodes, const char* path,
                    std::size_t output) const {
    for (const std::size_t node : nodes)
      animation["channels"].push_back(
          {{"sampler", animation["samplers"].size()}, {"target", {{"node", node}, {"path", path}}}});
    animation["samplers"].push_back({{"input", input_}, {"output", output}, {"interpolation", "LINEAR"}});
  }

  void require_room(std::size_t bytes) const {
    if (buffer_.size() + bytes > kMostBytes)
      throw InputError({file_, "", "at most 2 GiB", "more",
                        "take fewer morph targets (--targets) or write fewer frames (output.every of the scene)"});
  }

  template <typename Array>
  Json& add_array(const Array& array, ViewUse use, ComponentType component, const char* type) {
    const std::size_t bytes = static_cast<std::size_t>(array.size()) * sizeof(array(0));
    require_room(bytes + 3);
    Json view = {{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes}};
    if (use != kOther) view["target"] = use;
    buffer_.append(reinterpret_cast<const char*>(array.data()), bytes);
    buffer_.append((4 - buffer_.size() % 4) % 4, '\0');
    root_["bufferViews"].push_back(std::move(view));
    root_["accessors"].push_back(
        {{"bufferView", size_of("bufferViews") - 1}, {"componentType", component}, {"type", type}});
    return root_["accessors"].back();
  }

  std::size_t add_floats(const FloatMatrix& rows, const char* type, ViewUse use, bool bounded = false) {
    if (!rows.allFinite())
      throw InputError({file_, "", "positions that single precision holds, as glTF has them", "larger ones",
                        "the motion has left every scale; look at its energies"});
    Json& accessor = add_array(rows, use, kFloat, type);
    accessor["count"] = rows.rows();
    if (bounded)
      for (const auto column : rows.colwise()) {
        accessor["min"].push_back(column.minCoeff());
        accessor["max"].push_back(column.maxCoeff());
      }
    return size_of("accessors") - 1;
  }

  /// The bones of some of the surface's vertices.
  void add_influences(const DrawnSkin& skin, Eigen::Index first, Eigen::Index count, Json& primitive) {
    using Shorts = Eigen::Matrix<std::uint16_t, Eigen::Dynamic, 4, Eigen::RowMajor>;
    Shorts bones = Shorts::Zero(count, 4);
    bones.leftCols(skin.bones.cols()) = skin.bones.middleRows(first, count).cast<std::uint16_t>();
    FloatMatrix weights = FloatMatrix::Zero(count, 4);
    weights.leftCols(skin.weights.cols()) = skin.weights.middleRows(first, count).cast<float>();
    add_array(bones, kVertices, kUnsignedShort, "VEC4")["count"] = count;
    primitive["attributes"]["JOINTS_0"] = size_of("accessors") - 1;
    primitive["attributes"]["WEIGHTS_0"] = add_floats(weights, "VEC4", kVertices);
  }

  std::size_t add_indices(const TriangleArray& triangles, Eigen::Index vertices) {
    const bool is_short = vertices < kShortIndices;
    using Short = Eigen::Matrix<std::uint16_t, Eigen::Dynamic, 3, Eigen::RowMajor>;
    Json& accessor = is_short ? add_array(Short(triangles.cast<std::uint16_t>()), kIndices, kUnsignedShort, "SCALAR")
                              : add_array(triangles, kIndices, kUnsignedInt, "SCALAR");
    accessor["count"] = triangles.size();
    return size_of("accessors") - 1;
  }

  std::string file_;
  Json root_;
  std::string buffer_;
  std::vector<Kind> kinds_;
  std::vector<Body> bodies_;
  std::optional<std::size_t> plain_material_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::size_t input_ = 0;     // accessor of the times
  std::size_t variants_ = 0;  // of materials, of the looks so far
};

}  // namespace

Eigen::Vector3d origin_of(const std::vector<DrawnKind>& kinds, const std::vector<DrawnBody>& bodies) {
  const DrawnBody& first = bodies.front();
  const DrawnSurface& surface = kinds[first.kind].surface;
  Eigen::Vector3d place = surface.origin;
  if (first.motion) place = places_of(surface, *first.motion).row(0).transpose();
  return origin_near(place, bounding_box_diagonal(surface.vertices));
}

std::int64_t write_gltf(const std::filesystem::path& target, const std::vector<DrawnKind>& kinds,
                        const std::vector<DrawnBody>& bodies, UpAxis up) {
  GltfWriter writer(target.string());
  for (const DrawnKind& kind : kinds) writer.add_mesh(kind, bodies.size() == 1);
  writer.add_nodes(kinds, bodies, up);
  if (bodies.front().motion) writer.add_animations(kinds, bodies);
  return writer.write(target);
}

}  // namespace exmat::runtime

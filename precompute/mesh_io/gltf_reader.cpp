#include "precompute/mesh_io/gltf_reader.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <map>
#include <set>

#include "common/mesh/geometry.h"
#include "common/surface_io/mesh_arrays.h"
#include "common/surface_io/surface_parts.h"
#include "precompute/mesh_io/gltf_accessor.h"
#include "precompute/mesh_io/gltf_document.h"
#include "precompute/mesh_io/gltf_nodes.h"
#include "precompute/mesh_io/gltf_skeleton.h"

namespace exmat::precompute {
namespace {

// Positions, flags and triangles for each byte of the file, and for small files in any case: instances and targets of
// few bytes can be many.
constexpr std::size_t kRowsPerByte = 4, kRows = 4'000'000;

using Triangle = std::array<std::int32_t, 3>;

// Corners of triangles, each below the number of vertices.
std::vector<Triangle> triangles_of(const std::vector<std::uint32_t>& corners, int mode) {
  std::vector<Triangle> triangles;
  const bool is_list = mode == TINYGLTF_MODE_TRIANGLES;
  const auto at = [&](std::size_t k) { return static_cast<std::int32_t>(corners[k]); };
  for (std::size_t k = 0; k + 2 < corners.size(); k += is_list ? 3 : 1) {
    if (is_list)
      triangles.push_back({at(k), at(k + 1), at(k + 2)});
    else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP)
      triangles.push_back({at(k), at(k + 1 + k % 2), at(k + 2 - k % 2)});
    else
      triangles.push_back({at(k + 1), at(k + 2), at(0)});
  }
  return triangles;
}

class GltfReader {
 public:
  explicit GltfReader(const std::filesystem::path& file)
      : file_(file.string()),
        document_(read_gltf_document(file)),
        accessors_(file_, document_),
        skeleton_(file_, document_, accessors_) {}

  GltfShapes read();

 private:
  // Positions of a target, where they are not those of the mesh.
  struct Block {
    std::size_t morph;
    Eigen::Index first;
    VertexArray positions;
  };
  // A mesh in a node.
  struct Instance {
    const tinygltf::Mesh& mesh;
    std::string place;
    const Eigen::Affine3d& to_scene;
    int node = 0;
    int skin;                           // -1: all hangs on `bone`
    std::size_t bone;                   // of the node
    std::vector<std::size_t> morphs{};  // of its targets
    std::map<std::vector<std::pair<std::string, int>>, std::size_t>
        first{};  // vertex of the primitives with these attributes
  };

  void begin_node(int node, const Eigen::Affine3d& to_scene);
  void end_node(int node);
  void name_targets(Instance& instance);
  void add_primitive(Instance& instance, std::size_t index, const std::string& place);
  std::size_t add_vertices(Instance& instance, const tinygltf::Primitive& primitive, const std::string& place);
  void add_bones(const Instance& instance, const tinygltf::Primitive& primitive, std::size_t count,
                 const std::string& place);
  void add_attributes(const tinygltf::Primitive& primitive, std::size_t first, std::size_t count);
  void add_target(const Instance& instance, std::size_t target, const tinygltf::Primitive& primitive,
                  const VertexArray& base, std::size_t first, const std::string& place);
  VertexArray to_scene(const VertexArray& positions, const Instance& instance) const;
  int matching(int accessor, std::size_t count) const;
  void spend(std::size_t rows, std::size_t times, const std::string& place);
  SurfaceFile finish();
  void add_morphs(SurfaceFile& surface);
  void add_remarks(SurfaceFile& surface) const;

  const std::string file_;
  GltfDocument document_;
  const GltfAccessors accessors_;
  const GltfSkeleton skeleton_;
  std::vector<std::array<double, 3>> vertices_, colours_;
  bool has_colours_ = false;
  std::vector<std::map<std::size_t, double>> bones_;  // weights of each vertex
  std::vector<Triangle> triangles_;
  std::vector<std::string> morph_names_;
  std::map<std::string, std::size_t> morph_of_name_;
  std::vector<Block> blocks_;
  SurfaceParts parts_;
  std::vector<DrawnPrimitive> primitives_;
  std::vector<std::size_t> first_of_node_;
  std::set<int> meshes_;
  std::set<std::string> no_scalars_;
  std::vector<std::string> flattened_;  // warnings of nodes
  std::size_t nodes_with_meshes_ = 0, left_out_ = 0, rows_ = 0;
};

GltfShapes GltfReader::read() {
  first_of_node_.resize(document_.model.nodes.size());
  visit_nodes(file_, document_.model,
              {[&](int node, const Eigen::Affine3d& to_scene) { begin_node(node, to_scene); },
               [&](int node) { end_node(node); }});
  if (triangles_.empty())
    fail_in_gltf(file_, "", "triangles in the nodes of the scene", left_out_ > 0 ? "points or lines alone" : "none");
  SurfaceFile surface = finish();
  return {std::move(surface), std::move(document_), std::move(primitives_)};
}

void GltfReader::begin_node(int index, const Eigen::Affine3d& to_scene) {
  const tinygltf::Node& node = document_.model.nodes[static_cast<std::size_t>(index)];
  first_of_node_[static_cast<std::size_t>(index)] = triangles_.size();
  if (node.mesh < 0) return;
  const std::string place = fmt::format("/nodes/{}", index);
  if (node.skin >= static_cast<int>(document_.model.skins.size()))
    fail_in_gltf(file_, place + "/skin", fmt::format("a skin below {}", document_.model.skins.size()),
                 std::to_string(node.skin));
  if (static_cast<std::size_t>(node.mesh) >= document_.model.meshes.size())
    fail_in_gltf(file_, place + "/mesh", fmt::format("a mesh below {}", document_.model.meshes.size()),
                 std::to_string(node.mesh));
  Instance instance{document_.model.meshes[static_cast<std::size_t>(node.mesh)],
                    fmt::format("/meshes/{}", node.mesh),
                    node.skin >= 0 ? skeleton_.to_scene(node.skin) : to_scene,
                    index,
                    node.skin,
                    skeleton_.bone_above(index)};
  ++nodes_with_meshes_;
  meshes_.insert(node.mesh);
  name_targets(instance);
  if (instance.to_scene.linear().determinant() == 0)
    flattened_.push_back(fmt::format(
        "{} \"{}\" is scaled by 0, which flattens its mesh; leave it out, or mend its scale", place, node.name));
  const std::size_t first = triangles_.size();
  for (std::size_t k = 0; k < instance.mesh.primitives.size(); ++k)
    add_primitive(instance, k, fmt::format("{}/primitives/{}", instance.place, k));
  parts_.add_triangles(instance.mesh.name, first, triangles_.size());
}

void GltfReader::end_node(int node) {
  const auto index = static_cast<std::size_t>(node);
  parts_.add_triangles(document_.model.nodes[index].name, first_of_node_[index], triangles_.size());
}

void GltfReader::name_targets(Instance& instance) {
  if (instance.mesh.primitives.empty()) return;
  const std::size_t count = instance.mesh.primitives.front().targets.size();
  spend(count, 1, instance.place);
  const tinygltf::Value names =
      instance.mesh.extras.Has("targetNames") ? instance.mesh.extras.Get("targetNames") : tinygltf::Value();
  std::set<std::string> own;
  for (std::size_t k = 0; k < count; ++k) {
    std::string name = k < names.ArrayLen() ? names.Get(static_cast<int>(k)).Get<std::string>() : "";
    if (name.empty()) name = fmt::format("target {}", k);
    name = unique_name(name, own);
    const auto [known, is_new] = morph_of_name_.try_emplace(name, morph_names_.size());
    instance.morphs.push_back(known->second);
    if (is_new) morph_names_.push_back(std::move(name));
  }
}

void GltfReader::add_primitive(Instance& instance, std::size_t index, const std::string& place) {
  const tinygltf::Primitive& primitive = instance.mesh.primitives[index];
  spend(1 + primitive.attributes.size() + primitive.targets.size(), 1, place);
  const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
  if (mode > TINYGLTF_MODE_TRIANGLE_FAN)
    fail_in_gltf(file_, place + "/mode", "a mode from 0 to 6", std::to_string(mode));
  if (mode < TINYGLTF_MODE_TRIANGLES) {
    ++left_out_;
    return;
  }
  if (primitive.targets.size() != instance.morphs.size())
    fail_in_gltf(file_, place + "/targets",
                 fmt::format("{} targets, as the first primitive of the mesh has", instance.morphs.size()),
                 std::to_string(primitive.targets.size()));
  const std::size_t first = add_vertices(instance, primitive, place);
  primitives_.push_back({instance.node, index, static_cast<Eigen::Index>(first), instance.to_scene.linear(),
                         instance.skin >= 0 ? std::optional(instance.to_scene) : std::nullopt});
  const std::size_t count = accessors_.count(primitive.attributes.at("POSITION"));
  std::vector<std::uint32_t> corners;
  spend(primitive.indices >= 0 ? accessors_.count(primitive.indices) : count, 1, place);
  if (primitive.indices >= 0)
    corners = accessors_.read_indices(primitive.indices, count);
  else
    for (std::size_t k = 0; k < count; ++k) corners.push_back(static_cast<std::uint32_t>(k));
  if (mode == TINYGLTF_MODE_TRIANGLES && corners.size() % 3 != 0)
    fail_in_gltf(file_, place, "three corners of each triangle", fmt::format("{} corners", corners.size()));
  const std::size_t begin = triangles_.size();
  const bool mirrored = instance.to_scene.linear().determinant() < 0;
  for (Triangle triangle : triangles_of(corners, mode)) {
    for (std::int32_t& corner : triangle) corner += static_cast<std::int32_t>(first);
    if (mirrored) std::swap(triangle[1], triangle[2]);
    triangles_.push_back(triangle);
  }
  const auto material = static_cast<std::size_t>(primitive.material);
  if (primitive.material < 0) return;
  if (material >= document_.model.materials.size())
    fail_in_gltf(file_, place + "/material", fmt::format("a material below {}", document_.model.materials.size()),
                 std::to_string(material));
  parts_.add_triangles(document_.model.materials[material].name, begin, triangles_.size());
}

// The first of the primitive's vertices: those of an earlier primitive of the same attributes, or new ones.
std::size_t GltfReader::add_vertices(Instance& instance, const tinygltf::Primitive& primitive,
                                     const std::string& place) {
  std::vector<std::pair<std::string, int>> attributes(primitive.attributes.begin(), primitive.attributes.end());
  for (const auto& target : primitive.targets)
    attributes.emplace_back("target", target.contains("POSITION") ? target.at("POSITION") : -1);
  const auto [entry, is_new] = instance.first.try_emplace(std::move(attributes), vertices_.size());
  if (!is_new) return entry->second;
  if (!primitive.attributes.contains("POSITION"))
    fail_in_gltf(file_, place + "/attributes", "an attribute POSITION", "none");

  const int accessor = primitive.attributes.at("POSITION");
  if (accessors_.is_zeros(accessor))
    fail_in_gltf(file_, fmt::format("/accessors/{}", accessor), "a view of a buffer with the positions", "none",
                 "if the mesh is compressed, export without compression");
  const std::size_t count = accessors_.count(accessor), first = vertices_.size();
  spend(count, primitive.attributes.size() + primitive.targets.size(), place);
  const VertexArray base = accessors_.read_positions(accessor), positions = to_scene(base, instance);
  for (const auto& x : positions.rowwise()) vertices_.push_back({x[0], x[1], x[2]});
  colours_.resize(vertices_.size(), {1, 1, 1});
  if (!skeleton_.empty()) add_bones(instance, primitive, count, place);
  add_attributes(primitive, first, count);
  for (std::size_t k = 0; k < primitive.targets.size(); ++k)
    if (primitive.targets[k].contains("POSITION")) add_target(instance, k, primitive, base, first, place);
  return first;
}

// Influences of any number of sets, which exporters round and need not add up to 1; a vertex without any hangs on the
// bone that the node hangs on.
void GltfReader::add_bones(const Instance& instance, const tinygltf::Primitive& primitive, std::size_t count,
                           const std::string& place) {
  const std::size_t first = bones_.size();
  bones_.resize(first + count);
  for (int set = 0; instance.skin >= 0; ++set) {
    const auto joints = primitive.attributes.find(fmt::format("JOINTS_{}", set));
    const auto weights = primitive.attributes.find(fmt::format("WEIGHTS_{}", set));
    if (joints == primitive.attributes.end()) break;
    const std::string name = fmt::format("{}/attributes/WEIGHTS_{}", place, set);
    if (weights == primitive.attributes.end())
      fail_in_gltf(file_, name, fmt::format("weights, as there is JOINTS_{}", set), "none");
    const RowMatrix numbers =
        accessors_.read_rows(matching(joints->second, count), TINYGLTF_TYPE_VEC4, "VEC4, of joints");
    const RowMatrix shares =
        accessors_.read_rows(matching(weights->second, count), TINYGLTF_TYPE_VEC4, "VEC4, of weights");
    for (std::size_t v = 0; v < count; ++v)
      for (Eigen::Index k = 0; k < 4; ++k) {
        const double share = shares(static_cast<Eigen::Index>(v), k);
        if (!(share >= 0)) fail_in_gltf(file_, name, "weights of at least 0", fmt::format("{:g}", share));
        if (share == 0) continue;
        const auto joint = static_cast<std::size_t>(std::max(0.0, numbers(static_cast<Eigen::Index>(v), k)));
        if (joint >= skeleton_.joints(instance.skin))
          fail_in_gltf(file_, fmt::format("{}/attributes/JOINTS_{}", place, set),
                       fmt::format("joints below {}", skeleton_.joints(instance.skin)), std::to_string(joint));
        bones_[first + v][skeleton_.bone(instance.skin, joint)] += share;
      }
  }
  const auto hangs = [](const auto& own) { return !own.empty(); };
  if (instance.skin >= 0 && primitive.attributes.contains("JOINTS_0") &&
      std::none_of(bones_.begin() + static_cast<std::ptrdiff_t>(first), bones_.end(), hangs))
    fail_in_gltf(file_, place + "/attributes/WEIGHTS_0", "weights above 0", "0 of all vertices");
  for (std::size_t v = first; v < bones_.size(); ++v) {
    double sum = 0;
    for (const auto& [bone, share] : bones_[v]) sum += share;
    if (sum > 0)
      for (auto& [bone, share] : bones_[v]) share /= sum;
    else
      bones_[v] = {{instance.skin >= 0 ? skeleton_.bone(instance.skin, 0) : instance.bone, 1}};
  }
}

void GltfReader::add_attributes(const tinygltf::Primitive& primitive, std::size_t first, std::size_t count) {
  for (const auto& [name, accessor] : primitive.attributes) {
    if (name == "POSITION" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_")) continue;
    if (name == "COLOR_0") {
      const VertexArray colours = accessors_.read_colours(matching(accessor, count));
      for (std::size_t v = 0; v < count; ++v)
        for (std::size_t k = 0; k < 3; ++k)
          colours_[first + v][k] = colours(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(k));
      has_colours_ = true;
    } else if (accessors_.is_scalar(matching(accessor, count))) {
      const Eigen::VectorXd values = accessors_.read_scalars(accessor);
      for (std::size_t v = 0; v < count; ++v)
        if (values[static_cast<Eigen::Index>(v)] > 0.5) parts_.add_vertex(name, static_cast<std::int32_t>(first + v));
    } else {
      no_scalars_.insert(name);
    }
  }
}

void GltfReader::add_target(const Instance& instance, std::size_t target, const tinygltf::Primitive& primitive,
                            const VertexArray& base, std::size_t first, const std::string& place) {
  const auto count = static_cast<std::size_t>(base.rows());
  const int accessor = matching(primitive.targets[target].at("POSITION"), count);
  const VertexArray moved = base + accessors_.read_positions(accessor);
  if (!moved.allFinite())
    fail_in_gltf(file_, fmt::format("{}/targets/{}", place, target), "finite positions", "others");
  blocks_.push_back({instance.morphs[target], static_cast<Eigen::Index>(first), to_scene(moved, instance)});
}

VertexArray GltfReader::to_scene(const VertexArray& positions, const Instance& instance) const {
  if (instance.to_scene.matrix() == Eigen::Matrix4d::Identity()) return positions;
  VertexArray moved =
      (positions * instance.to_scene.linear().transpose()).rowwise() + instance.to_scene.translation().transpose();
  if (!moved.allFinite())
    fail_in_gltf(file_, instance.place, "finite positions after the transforms of its nodes", "others");
  return moved;
}

// The accessor, if it has so many rows.
int GltfReader::matching(int accessor, std::size_t count) const {
  if (const std::size_t found = accessors_.count(accessor); found != count)
    fail_in_gltf(file_, fmt::format("/accessors/{}/count", accessor), fmt::format("{}, as the positions have", count),
                 std::to_string(found));
  return accessor;
}

void GltfReader::spend(std::size_t rows, std::size_t times, const std::string& place) {
  const std::size_t most = kRows + kRowsPerByte * document_.bytes;
  if (times > 0 && rows > (most - rows_) / times)
    fail_in_gltf(file_, place,
                 fmt::format("at most {} positions, colours, flags and corners for the file's size", most), "more",
                 "join the instances and targets that repeat the same data");
  rows_ += rows * times;
}

SurfaceFile GltfReader::finish() {
  SurfaceFile surface;
  surface.mesh = {vertex_array(vertices_), triangle_array(triangles_)};
  if (has_colours_) surface.colours = vertex_array(colours_);
  surface.files = document_.files;
  surface.warnings = flattened_;
  if (!skeleton_.empty()) {
    surface.skeleton = skeleton_.data(surface.remarks);
    surface.skeleton->weights.setZero(std::ssize(bones_), static_cast<Eigen::Index>(skeleton_.size()));
    for (std::size_t v = 0; v < bones_.size(); ++v)
      for (const auto& [bone, share] : bones_[v])
        surface.skeleton->weights(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(bone)) = share;
  }
  add_morphs(surface);
  add_remarks(surface);
  parts_.finish(surface, document_.bytes);
  return surface;
}

void GltfReader::add_morphs(SurfaceFile& surface) {
  rows_ = 0;
  spend(vertices_.size(), morph_names_.size(), "/meshes");
  for (const std::string& name : morph_names_) surface.morphs.push_back({name, surface.mesh.vertices});
  for (const Block& block : blocks_)
    surface.morphs[block.morph].positions.middleRows(block.first, block.positions.rows()) = block.positions;
  // Many exporters write the rest shape as a target, with the noise of its numbers.
  constexpr double kNoise = 1e-6;
  const auto& rest = surface.mesh.vertices;
  const double size = longest_box_edge(rest);
  std::erase_if(surface.morphs, [&](const MorphTarget& morph) {
    if ((morph.positions - rest).cwiseAbs().maxCoeff() > kNoise * size) return false;
    surface.remarks.push_back(fmt::format("the morph target \"{}\" moves no vertex and is left out", morph.name));
    return true;
  });
}

void GltfReader::add_remarks(SurfaceFile& surface) const {
  auto& remarks = surface.remarks;
  if (nodes_with_meshes_ > 1)
    remarks.push_back(fmt::format("{} {} in {} nodes are taken as one object", meshes_.size(),
                                  meshes_.size() == 1 ? "mesh" : "meshes", nodes_with_meshes_));
  if (document_.model.scenes.size() > 1)
    remarks.push_back(fmt::format("one of {} scenes is read: the default one", document_.model.scenes.size()));
  if (left_out_ > 0) remarks.push_back(fmt::format("primitives of points or lines are left out: {}", left_out_));
  for (const std::string& name : no_scalars_)
    remarks.push_back(fmt::format("the attribute {} is left out: it has more than one number a vertex", name));
}

}  // namespace

SurfaceFile read_gltf(const std::filesystem::path& file) { return read_gltf_shapes(file).surface; }

GltfShapes read_gltf_shapes(const std::filesystem::path& file) { return GltfReader(file).read(); }

}  // namespace exmat::precompute

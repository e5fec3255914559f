#include "runtime/export/gltf_file.h"

#include <Eigen/Geometry>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/version.h"
#include "common/mesh/geometry.h"

#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>

namespace exmat::runtime {
namespace {

static_assert(std::endian::native == std::endian::little, "a buffer of glTF is little-endian");

using FloatMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr Eigen::Index kShortIndices = 65535;  // vertices that 16 bits count, the last number being reserved
constexpr std::size_t kMostBytes = std::numeric_limits<std::int32_t>::max();

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

class GltfWriter {
 public:
  explicit GltfWriter(std::string file) : file_(std::move(file)) {
    model_.asset.version = "2.0";
    model_.asset.generator = fmt::format("exmat-runtime {}", version());
    model_.buffers.emplace_back();
    model_.scenes.emplace_back();
    model_.defaultScene = 0;
    tinygltf::Material material;
    material.name = "material";
    material.doubleSided = true;
    material.pbrMetallicRoughness.metallicFactor = 0;
    material.pbrMetallicRoughness.roughnessFactor = 0.6;
    model_.materials.push_back(material);
  }

  /// `has_weights`: the mesh, not its nodes.
  void add_mesh(const DrawnKind& kind, bool has_weights) {
    const auto& [surface, normals, targets] = kind;
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.material = 0;
    primitive.indices = add_indices(surface.triangles, surface.vertex_count());
    primitive.attributes["POSITION"] = add_floats(surface.vertices.cast<float>(), TINYGLTF_TYPE_VEC3, kVertices, true);
    primitive.attributes["NORMAL"] = add_floats(normals.cast<float>(), TINYGLTF_TYPE_VEC3, kVertices);
    std::vector<tinygltf::Value> names;
    for (Eigen::Index k = 0; k < targets.displacements.cols(); ++k) {
      primitive.targets.push_back(
          {{"POSITION", add_floats(vectors_of(targets.displacements, k), TINYGLTF_TYPE_VEC3, kVertices, true)},
           {"NORMAL", add_floats(vectors_of(targets.normals, k), TINYGLTF_TYPE_VEC3, kVertices)}});
      names.emplace_back(targets.names[static_cast<std::size_t>(k)]);
    }
    tinygltf::Mesh& mesh = model_.meshes.emplace_back();
    mesh.name = surface.name;
    mesh.primitives.push_back(std::move(primitive));
    if (has_weights) {
      mesh.weights.assign(static_cast<std::size_t>(targets.displacements.cols()), 0.0);
      set_first(targets.weights, mesh.weights);
    }
    mesh.extras = tinygltf::Value(std::map<std::string, tinygltf::Value>{{"targetNames", tinygltf::Value(names)}});
  }

  void add_nodes(const std::vector<DrawnKind>& kinds, const std::vector<DrawnBody>& bodies, UpAxis up) {
    if (up == UpAxis::kZ) {
      tinygltf::Node& upright = model_.nodes.emplace_back();
      upright.name = "y up";
      upright.rotation = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
    }
    origin_ = origin_of(kinds, bodies);
    const int above = static_cast<int>(model_.nodes.size());
    if (!origin_.isZero(0)) {
      tinygltf::Node& placed = model_.nodes.emplace_back();
      placed.name = "origin";
      placed.translation = {origin_.x(), origin_.y(), origin_.z()};
    }
    first_body_ = static_cast<int>(model_.nodes.size());
    std::vector<int> nodes;
    for (const DrawnBody& drawn : bodies) {
      const Eigen::Vector3d origin = kinds[drawn.kind].surface.origin - origin_;
      nodes.push_back(static_cast<int>(model_.nodes.size()));
      tinygltf::Node& body = model_.nodes.emplace_back();
      body.name = drawn.name;
      body.mesh = static_cast<int>(drawn.kind);
      body.translation = {origin.x(), origin.y(), origin.z()};
      if (bodies.size() == 1 || drawn.weights.rows() == 0) continue;
      body.weights.resize(static_cast<std::size_t>(drawn.weights.cols()));
      set_first(drawn.weights, body.weights);
    }
    if (!origin_.isZero(0))
      model_.nodes[static_cast<std::size_t>(above)].children = std::exchange(nodes, std::vector{above});
    if (up == UpAxis::kZ) model_.nodes.front().children = std::exchange(nodes, {0});
    model_.scenes.front().nodes = nodes;
  }

  void add_animations(const std::vector<DrawnKind>& kinds, const std::vector<DrawnBody>& bodies) {
    const Eigen::VectorXd& times = bodies.front().motion->times;
    add_times(times);
    tinygltf::Animation& animation = model_.animations.emplace_back();
    animation.name = "motion";
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (bodies[i].motion->times != times)
        throw InputError({file_, "", "frames of all bodies at the same times",
                          fmt::format("others of {}", bodies[i].name), "is this a trajectory of one run?"});
      add_channels(kinds[bodies[i].kind].surface, bodies[i], first_body_ + static_cast<int>(i), animation);
    }
  }

  std::int64_t write(const std::filesystem::path& target) {
    AtomicFile output(target);
    std::ofstream stream(output.temporary(), std::ios::binary | std::ios::trunc);
    const bool written = tinygltf::TinyGLTF().WriteGltfSceneToStream(&model_, stream, /*prettyPrint=*/false, true);
    stream.close();
    if (!written || !stream)
      throw WorkError("cannot write " + target.string() + ": " + std::generic_category().message(errno));
    const auto bytes = static_cast<std::int64_t>(std::filesystem::file_size(output.temporary()));
    output.commit();
    return bytes;
  }

 private:
  static constexpr int kOther = 0, kVertices = TINYGLTF_TARGET_ARRAY_BUFFER,
                       kIndices = TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER;

  /// Those of the first frame, where there is one.
  static void set_first(const RowMatrix& weights, std::vector<double>& first) {
    for (Eigen::Index k = 0; weights.rows() > 0 && k < weights.cols(); ++k)
      first[static_cast<std::size_t>(k)] = weights(0, k);
  }

  void add_times(const Eigen::VectorXd& seconds) {
    const FloatMatrix times = seconds.cast<float>();
    for (Eigen::Index frame = 1; frame < times.size(); ++frame)
      if (!(times(frame) > times(frame - 1)))
        throw InputError({file_, "", "frames at different times in single precision, as glTF has them",
                          fmt::format("frames {} and {} at {:.9g} s", frame - 1, frame, seconds[frame]),
                          "write fewer frames (output.every of the scene)"});
    input_ = add_floats(times, TINYGLTF_TYPE_SCALAR, kOther, true);
  }

  void add_channels(const DrawnSurface& surface, const DrawnBody& drawn, int node, tinygltf::Animation& animation) {
    const BodyMotion& motion = *drawn.motion;
    const RowMatrix places = places_of(surface, motion).rowwise() - origin_.transpose();
    const RowMatrix& turns = motion.orientations;
    if (!(places.rowwise() - places.row(0)).isZero(0) || !motion.positions.row(0).isZero(0))
      add_channel(animation, node, "translation", add_floats(places.cast<float>(), TINYGLTF_TYPE_VEC3, kOther));
    if (!turns.rightCols(3).isZero(0)) {
      FloatMatrix quaternions(turns.rows(), 4);
      quaternions << turns.rightCols(3).cast<float>(), turns.leftCols(1).cast<float>();
      add_channel(animation, node, "rotation", add_floats(quaternions, TINYGLTF_TYPE_VEC4, kOther));
    }
    const FloatMatrix weights = drawn.weights.cast<float>().reshaped<Eigen::RowMajor>();
    add_channel(animation, node, "weights", add_floats(weights, TINYGLTF_TYPE_SCALAR, kOther));
  }

  void add_channel(tinygltf::Animation& animation, int node, const char* path, int output) {
    tinygltf::AnimationSampler sampler;
    sampler.input = input_;
    sampler.output = output;
    tinygltf::AnimationChannel channel;
    channel.sampler = static_cast<int>(animation.samplers.size());
    channel.target_node = node;
    channel.target_path = path;
    animation.samplers.push_back(sampler);
    animation.channels.push_back(channel);
  }

  template <typename Array>
  tinygltf::Accessor& add_array(const Array& array, int use) {
    std::vector<unsigned char>& data = model_.buffers.front().data;
    const std::size_t first = data.size(), bytes = static_cast<std::size_t>(array.size()) * sizeof(array(0));
    const std::size_t end = (first + bytes + 3) / 4 * 4;
    if (end > kMostBytes)
      throw InputError({file_, "", "at most 2 GiB", "more",
                        "take fewer morph targets (--targets) or write fewer frames (output.every of the scene)"});
    data.resize(end);
    std::memcpy(data.data() + first, array.data(), bytes);
    tinygltf::BufferView& view = model_.bufferViews.emplace_back();
    view.buffer = 0;
    view.byteOffset = first;
    view.byteLength = bytes;
    view.target = use;
    tinygltf::Accessor& accessor = model_.accessors.emplace_back();
    accessor.bufferView = static_cast<int>(model_.bufferViews.size()) - 1;
    return accessor;
  }

  int add_floats(const FloatMatrix& rows, int type, int use, bool bounded = false) {
    if (!rows.allFinite())
      throw InputError({file_, "", "positions that single precision holds, as glTF has them", "larger ones",
                        "the motion has left every scale; look at its energies"});
    tinygltf::Accessor& accessor = add_array(rows, use);
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
    accessor.type = type;
    accessor.count = static_cast<std::size_t>(rows.rows());
    if (bounded)
      for (const auto column : rows.colwise()) {
        accessor.minValues.push_back(column.minCoeff());
        accessor.maxValues.push_back(column.maxCoeff());
      }
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  int add_indices(const TriangleArray& triangles, Eigen::Index vertices) {
    const bool is_short = vertices < kShortIndices;
    using Short = Eigen::Matrix<std::uint16_t, Eigen::Dynamic, 3, Eigen::RowMajor>;
    tinygltf::Accessor& accessor =
        is_short ? add_array(Short(triangles.cast<std::uint16_t>()), kIndices) : add_array(triangles, kIndices);
    accessor.componentType = is_short ? TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT : TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    accessor.type = TINYGLTF_TYPE_SCALAR;
    accessor.count = static_cast<std::size_t>(triangles.size());
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  std::string file_;
  tinygltf::Model model_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  int first_body_ = 0;  // node
  int input_ = 0;       // accessor of the times
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

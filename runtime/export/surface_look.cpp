#include "runtime/export/surface_look.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>

#include "common/core/error.h"
#include "common/surface_io/glb.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little, "a buffer of glTF is little-endian");

/// Rows of three numbers in the buffer of a look.
class Rows {
 public:
  /// Rows of an accessor; none where it is sparse, or of numbers that normals are not made of.
  Rows(const SurfaceLook& look, const Json& accessor, Eigen::Index count) {
    const int type = accessor.at("componentType").get<int>();
    bytes_ = type == kByte ? 1 : type == kShort ? 2 : type == kFloat ? 4 : 0;
    if (bytes_ == 0 || accessor.contains("sparse") || !accessor.contains("bufferView") || accessor.at("type") != "VEC3")
      return;
    const Json& view = look.document.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
    stride_ = view.value("byteStride", 3 * bytes_);
    const std::size_t offset = view.value("byteOffset", std::size_t{0}) + accessor.value("byteOffset", std::size_t{0});
    const auto rows = static_cast<std::size_t>(count);
    if (offset > look.buffer.size() || rows == 0 || stride_ > look.buffer.size() ||
        (rows - 1) * stride_ + 3 * bytes_ > look.buffer.size() - offset)
      return;
    first_ = look.buffer.data() + offset;
  }

  explicit operator bool() const { return first_ != nullptr; }

  Eigen::Vector3d operator[](Eigen::Index row) const {
    Eigen::Vector3d vector;
    for (int k = 0; k < 3; ++k) {
      const char* const at = first_ + static_cast<std::size_t>(row) * stride_ + static_cast<std::size_t>(k) * bytes_;
      vector[k] = bytes_ == 4 ? load<float>(at) : bytes_ == 2 ? load<std::int16_t>(at) : load<std::int8_t>(at);
    }
    return vector;
  }

 private:
  static constexpr int kByte = 5120, kShort = 5122, kFloat = 5126;

  template <typename Number>
  static double load(const char* bytes) {
    std::array<char, sizeof(Number)> raw{};
    std::memcpy(raw.data(), bytes, sizeof(Number));
    return static_cast<double>(std::bit_cast<Number>(raw));
  }

  const char* first_ = nullptr;
  std::size_t stride_ = 0, bytes_ = 0;
};

/// Visits all primitives of the meshes of a look, in their order.
template <typename Visitor>
void visit_primitives(const Json& document, const Visitor& visit) {
  std::size_t index = 0;
  for (const Json& mesh : document.at("meshes"))
    for (const Json& primitive : mesh.at("primitives")) visit(primitive, index++);
}

Eigen::Index count_of(const Json& document, const Json& primitive) {
  const auto positions = primitive.at("attributes").at("POSITION").get<std::size_t>();
  return document.at("accessors").at(positions).at("count").get<Eigen::Index>();
}

SurfaceLook parsed(const std::string& bundle, const RenderData& render) {
  const std::string_view glb(reinterpret_cast<const char*>(render.look.data()),
                             static_cast<std::size_t>(render.look.size()));
  const GlbParts parts = parts_of_glb(bundle + ": /render/look", glb);
  SurfaceLook look{Json::parse(parts.json), std::string(parts.buffer.value_or("")), {}, {}};
  static_cast<void>(look.document.at("nodes").at(0));
  static_cast<void>(look.document.at("scenes").at(0).at("nodes").at(0));
  visit_primitives(look.document, [&](const Json& primitive, std::size_t index) {
    const auto k = static_cast<Eigen::Index>(index);
    LookPrimitive& found = look.primitives.emplace_back();
    found.count = count_of(look.document, primitive);
    if (k >= render.look_vertices.size()) return;
    found.first = render.look_vertices[k];
    found.frame = render.look_frames.middleRows(3 * k, 3);
  });
  return look;
}

/// Normals of the vertices; none from an accessor of the wrong kind.
VertexArray normals_of(const SurfaceLook& look, Eigen::Index vertices) {
  VertexArray normals = VertexArray::Zero(vertices, 3);
  visit_primitives(look.document, [&](const Json& primitive, std::size_t index) {
    const auto attribute = primitive.at("attributes").find("NORMAL");
    if (attribute == primitive.at("attributes").end()) return;
    const LookPrimitive& place = look.primitives[index];
    const Rows rows(look, look.document.at("accessors").at(attribute->get<std::size_t>()), place.count);
    if (!rows) return;
    const Eigen::Matrix3d turn = place.frame.inverse().transpose();
    for (Eigen::Index k = 0; k < place.count; ++k) {
      const Eigen::Vector3d normal = turn * rows[k];
      const double length = normal.norm();
      if (length > 0 && std::isfinite(length)) normals.row(place.first + k) = normal.transpose() / length;
    }
  });
  return normals;
}

}  // namespace

SurfaceLook read_look(const std::string& bundle, const RenderData& render) {
  const auto refuse = [&](const std::string& expected, const std::string& found) {
    throw InputError({bundle, "/render/look", expected, found, "precompute the bundle again"});
  };
  SurfaceLook look;
  try {
    look = parsed(bundle, render);
  } catch (const Json::exception& error) {
    refuse("a .glb file", error.what());
  }
  if (std::ssize(look.primitives) != render.look_vertices.size())
    refuse(fmt::format("{} primitives, as /render/look_vertices has", render.look_vertices.size()),
           fmt::format("{}", look.primitives.size()));
  for (const LookPrimitive& primitive : look.primitives) {
    if (primitive.count < 0 || primitive.count > render.tets.size() - primitive.first)
      refuse(fmt::format("primitives of the {} vertices of /render", render.tets.size()),
             fmt::format("{} from {}", primitive.count, primitive.first));
    if (!(std::abs(primitive.frame.determinant()) > 0)) refuse("frames that can be inverted", "a singular one");
  }
  try {
    look.normals = normals_of(look, render.tets.size());
  } catch (const Json::exception& error) {
    refuse("accessors of normals", error.what());
  }
  return look;
}

}  // namespace exmat::runtime

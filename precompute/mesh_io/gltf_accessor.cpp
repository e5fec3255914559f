#include "precompute/mesh_io/gltf_accessor.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>

namespace exmat::precompute {
namespace {

std::string place_of_accessor(int accessor) { return fmt::format("/accessors/{}", accessor); }

// 0 where it is none of glTF.
std::size_t bytes_of(int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

// Little-endian, anywhere in memory.
template <typename Number>
Number load(const unsigned char* bytes) {
  std::array<unsigned char, sizeof(Number)> raw{};
  std::copy_n(bytes, sizeof(Number), raw.begin());
  if constexpr (std::endian::native != std::endian::little) std::ranges::reverse(raw);
  return std::bit_cast<Number>(raw);
}

template <typename Number>
double load_part(const unsigned char* bytes, bool normalized) {
  const double value = load<Number>(bytes);
  return normalized ? std::max(value / std::numeric_limits<Number>::max(), -1.0) : value;
}

double component(const unsigned char* bytes, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return load_part<std::int8_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load_part<std::uint8_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return load_part<std::int16_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load_part<std::uint16_t>(bytes, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load_part<std::uint32_t>(bytes, normalized);
    default:
      return static_cast<double>(load<float>(bytes));
  }
}

std::uint32_t index(const unsigned char* bytes, int type) {
  return static_cast<std::uint32_t>(component(bytes, type, false));
}

bool is_index_type(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

}  // namespace

struct GltfAccessors::Rows {
  const unsigned char* first = nullptr;
  std::size_t stride = 0, component_bytes = 0;
  const unsigned char* at(std::size_t row, std::size_t column = 0) const {
    return first + row * stride + column * component_bytes;
  }
};

const tinygltf::Accessor& GltfAccessors::at(int accessor) const {
  if (accessor < 0 || static_cast<std::size_t>(accessor) >= model_.accessors.size())
    fail("/accessors", fmt::format("an accessor below {}", model_.accessors.size()), std::to_string(accessor));
  return model_.accessors[static_cast<std::size_t>(accessor)];
}

std::size_t GltfAccessors::count(int accessor) const { return at(accessor).count; }

GltfAccessors::Rows GltfAccessors::rows_of(int view, std::size_t offset, std::size_t count, int component_type,
                                           int components, const std::string& place) const {
  if (view < 0 || static_cast<std::size_t>(view) >= model_.bufferViews.size())
    fail(place + "/bufferView", fmt::format("a view below {}", model_.bufferViews.size()), std::to_string(view));
  const tinygltf::BufferView& source = model_.bufferViews[static_cast<std::size_t>(view)];
  const std::string source_place = fmt::format("/bufferViews/{}", view);
  if (source.buffer < 0 || static_cast<std::size_t>(source.buffer) >= model_.buffers.size())
    fail(source_place + "/buffer", fmt::format("a buffer below {}", model_.buffers.size()),
         std::to_string(source.buffer));
  const auto& bytes = model_.buffers[static_cast<std::size_t>(source.buffer)].data;
  if (source.byteOffset > bytes.size() || source.byteLength > bytes.size() - source.byteOffset)
    fail(source_place, fmt::format("bytes of a buffer of {}", bytes.size()),
         fmt::format("{} from {}", source.byteLength, source.byteOffset));
  const std::size_t component_bytes = bytes_of(component_type);
  if (component_bytes == 0) fail(place + "/componentType", "a type of numbers of glTF", std::to_string(component_type));
  const std::size_t row_bytes = component_bytes * static_cast<std::size_t>(components);
  const std::size_t stride = source.byteStride == 0 ? row_bytes : source.byteStride;
  if (stride < row_bytes)
    fail(source_place + "/byteStride", fmt::format("at least {}", row_bytes), std::to_string(stride));
  // All of them are below 2^31.
  if (count > 0 && offset + (count - 1) * stride + row_bytes > source.byteLength)
    fail(place, fmt::format("rows within the {} bytes of their view", source.byteLength),
         fmt::format("{} rows", count));
  return {bytes.data() + source.byteOffset + offset, stride, component_bytes};
}

RowMatrix GltfAccessors::read(int accessor, bool normalized) const {
  const tinygltf::Accessor& source = at(accessor);
  const std::string place = place_of_accessor(accessor);
  const int components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(source.type));
  Rows rows;  // an accessor without a view is zeros, but for its sparse rows
  if (source.bufferView >= 0)
    rows = rows_of(source.bufferView, source.byteOffset, source.count, source.componentType, components, place);
  RowMatrix values = RowMatrix::Zero(static_cast<Eigen::Index>(source.count), components);
  if (rows.first)
    for (Eigen::Index row = 0; row < values.rows(); ++row)
      for (Eigen::Index column = 0; column < components; ++column)
        values(row, column) = component(rows.at(static_cast<std::size_t>(row), static_cast<std::size_t>(column)),
                                        source.componentType, normalized);
  if (source.sparse.isSparse) read_sparse(source, normalized, place + "/sparse", values);
  if (!values.allFinite()) fail(place, "finite numbers", "others");
  return values;
}

void GltfAccessors::read_sparse(const tinygltf::Accessor& accessor, bool normalized, const std::string& place,
                                RowMatrix& values) const {
  const auto& sparse = accessor.sparse;
  const auto count = static_cast<std::size_t>(sparse.count);
  if (sparse.count < 0 || count > accessor.count)
    fail(place + "/count", fmt::format("at most {}", accessor.count), std::to_string(sparse.count));
  if (!is_index_type(sparse.indices.componentType))
    fail(place + "/indices/componentType", "a type of unsigned integers", std::to_string(sparse.indices.componentType));
  const Rows indices = rows_of(sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset), count,
                               sparse.indices.componentType, 1, place + "/indices");
  const Rows rows = rows_of(sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset), count,
                            accessor.componentType, static_cast<int>(values.cols()), place + "/values");
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t row = index(indices.at(k), sparse.indices.componentType);
    if (row >= accessor.count)
      fail(place + "/indices", fmt::format("rows below {}", accessor.count), std::to_string(row));
    for (Eigen::Index column = 0; column < values.cols(); ++column)
      values(row, column) = component(rows.at(k, static_cast<std::size_t>(column)), accessor.componentType, normalized);
  }
}

void GltfAccessors::check(int accessor, std::size_t count) const {
  const tinygltf::Accessor& source = at(accessor);
  if (source.count != count)
    fail(place_of_accessor(accessor) + "/count", std::to_string(count), std::to_string(source.count));
  if (tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(source.type)) <= 0)
    fail(place_of_accessor(accessor) + "/type", "a type of glTF", "another");
  read(accessor, false);
}

VertexArray GltfAccessors::read_positions(int accessor) const {
  const tinygltf::Accessor& source = at(accessor);
  if (source.type != TINYGLTF_TYPE_VEC3)
    fail(place_of_accessor(accessor) + "/type", "VEC3, of positions", "another type");
  if (source.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
    fail(place_of_accessor(accessor) + "/componentType", "reals or integers of at most 16 bits", "of 32 bits");
  return read(accessor, source.normalized);
}

VertexArray GltfAccessors::read_colours(int accessor) const {
  const tinygltf::Accessor& source = at(accessor);
  if (source.type != TINYGLTF_TYPE_VEC3 && source.type != TINYGLTF_TYPE_VEC4)
    fail(place_of_accessor(accessor) + "/type", "VEC3 or VEC4, of colours", "another type");
  return read(accessor, true).leftCols(3).cwiseMax(0).cwiseMin(1);
}

Eigen::VectorXd GltfAccessors::read_scalars(int accessor) const {
  if (!is_scalar(accessor)) fail(place_of_accessor(accessor) + "/type", "SCALAR", "another type");
  return read(accessor, at(accessor).normalized).col(0);
}

RowMatrix GltfAccessors::read_rows(int accessor, int type, const char* name) const {
  if (at(accessor).type != type) fail(place_of_accessor(accessor) + "/type", name, "another type");
  return read(accessor, at(accessor).normalized);
}

std::vector<std::uint32_t> GltfAccessors::read_indices(int accessor, std::size_t end) const {
  const tinygltf::Accessor& source = at(accessor);
  const std::string place = place_of_accessor(accessor);
  if (!is_scalar(accessor) || !is_index_type(source.componentType))
    fail(place, "SCALAR of unsigned integers, of corners", "another type");
  if (source.sparse.isSparse) fail(place, "corners that are not sparse", "sparse ones");
  std::vector<std::uint32_t> indices(source.count);
  if (source.bufferView < 0) return indices;
  const Rows rows = rows_of(source.bufferView, source.byteOffset, source.count, source.componentType, 1, place);
  for (std::size_t k = 0; k < indices.size(); ++k) {
    indices[k] = index(rows.at(k), source.componentType);
    if (indices[k] >= end) fail(place, fmt::format("vertices below {}", end), std::to_string(indices[k]));
  }
  return indices;
}

}  // namespace exmat::precompute

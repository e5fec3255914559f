#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/arrays.h"
#include "precompute/mesh_io/gltf_document.h"

namespace exmat::precompute {

/// The arrays of a glTF file. What an accessor says is checked before anything is read or allocated: views, strides,
/// types, sparse parts; the caller bounds the count. An accessor without a view is zeros. Faults are InputErrors of the
/// accessor's JSON pointer.
class GltfAccessors {
 public:
  /// Both must outlive it.
  GltfAccessors(const std::string& file, const GltfDocument& document) : file_(file), model_(document.model) {}

  /// Rows that the accessor has.
  std::size_t count(int accessor) const;
  /// `count` x 3 of a VEC3: reals, or integers of at most 16 bits, in parts of the largest where they are normalised.
  VertexArray read_positions(int accessor) const;
  /// `count` x 3 of a VEC3 or VEC4: reals or parts of the largest integer, cut off at 0 and 1.
  VertexArray read_colours(int accessor) const;
  /// Values of a SCALAR of any type.
  Eigen::VectorXd read_scalars(int accessor) const;
  /// Rows of the type that `name` says, in parts of the largest where they are normalised.
  RowMatrix read_rows(int accessor, int type, const char* name) const;
  /// Values of a SCALAR of unsigned integers; each is below `end`.
  std::vector<std::uint32_t> read_indices(int accessor, std::size_t end) const;
  /// Throws InputError unless it has so many rows, each of its numbers in a buffer.
  void check(int accessor, std::size_t count) const;
  /// True if it has no numbers of its own.
  bool is_zeros(int accessor) const { return at(accessor).bufferView < 0 && !at(accessor).sparse.isSparse; }
  /// True if it has one number a row.
  bool is_scalar(int accessor) const { return at(accessor).type == TINYGLTF_TYPE_SCALAR; }

 private:
  struct Rows;  // where rows of numbers are, checked
  const tinygltf::Accessor& at(int accessor) const;
  Rows rows_of(int view, std::size_t offset, std::size_t count, int component_type, int components,
               const std::string& place) const;
  RowMatrix read(int accessor, bool normalized) const;
  void read_sparse(const tinygltf::Accessor& accessor, bool normalized, const std::string& place,
                   RowMatrix& values) const;
  [[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found,
                         const std::string& advice = "") const {
    fail_in_gltf(file_, place, expected, found, advice);
  }

  const std::string& file_;
  const tinygltf::Model& model_;
};

}  // namespace exmat::precompute

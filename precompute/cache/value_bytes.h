#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstddef>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/bundle/fields.h"

namespace exmat::precompute {

// Values as bytes, to hash them or to keep them: the bytes of two values are the same exactly where the values are, bit
// for bit. One list of members, pass_members, serves both directions; a type of its own folder has its list beside it.
// For files that the same program reads again.

/// The bytes of a value do not fit its type.
class DamagedBytes : public std::runtime_error {
 public:
  DamagedBytes() : std::runtime_error("its bytes do not fit its type") {}
};

class ByteWriter {
 public:
  static constexpr bool kReads = false;
  void raw(void* data, std::size_t size) { bytes.append(static_cast<const char*>(data), size); }

  std::string bytes;
};

class ByteReader {
 public:
  static constexpr bool kReads = true;
  explicit ByteReader(std::string_view bytes) : rest_(bytes) {}
  /// Throws DamagedBytes where fewer are left.
  void raw(void* data, std::size_t size) {
    if (size > rest_.size()) throw DamagedBytes();
    if (size > 0) std::memcpy(data, rest_.data(), size);
    rest_.remove_prefix(size);
  }
  std::size_t left() const { return rest_.size(); }

 private:
  std::string_view rest_;
};

template <typename Archive, typename Value>
void pass(Archive& archive, Value& value);

/// A number of elements, each of at least so many bytes, which the rest must hold.
template <typename Archive>
std::int64_t pass_size(Archive& archive, std::int64_t size, std::size_t element_bytes) {
  pass(archive, size);
  if constexpr (Archive::kReads)
    if (size < 0 || static_cast<std::size_t>(size) > archive.left() / element_bytes) throw DamagedBytes();
  return size;
}

template <typename Archive, typename Array>
void pass_dense(Archive& archive, Array& array) {
  std::int64_t rows = array.rows(), cols = array.cols();
  pass(archive, rows);
  pass(archive, cols);
  using Scalar = typename Array::Scalar;
  if constexpr (Archive::kReads) {
    const bool fits = rows >= 0 && cols >= 0 && (Array::RowsAtCompileTime < 0 || rows == Array::RowsAtCompileTime) &&
                      (Array::ColsAtCompileTime < 0 || cols == Array::ColsAtCompileTime);
    const std::size_t most = archive.left() / sizeof(Scalar);
    if (!fits || (cols > 0 && static_cast<std::size_t>(rows) > most / static_cast<std::size_t>(cols)))
      throw DamagedBytes();
    array.resize(rows, cols);
  }
  archive.raw(array.data(), static_cast<std::size_t>(array.size()) * sizeof(Scalar));
}

template <typename Archive, typename Sparse>
void pass_sparse(Archive& archive, Sparse& matrix) {
  using Index = typename Sparse::StorageIndex;
  using Vector = Eigen::Matrix<Index, Eigen::Dynamic, 1>;
  using Values = Eigen::Matrix<typename Sparse::Scalar, Eigen::Dynamic, 1>;
  std::int64_t rows = matrix.rows(), cols = matrix.cols();
  Vector outer, inner;
  Values values;
  if constexpr (!Archive::kReads) {
    Sparse compressed = matrix;
    compressed.makeCompressed();
    outer = Eigen::Map<const Vector>(compressed.outerIndexPtr(), compressed.outerSize() + 1);
    inner = Eigen::Map<const Vector>(compressed.innerIndexPtr(), compressed.nonZeros());
    values = Eigen::Map<const Values>(compressed.valuePtr(), compressed.nonZeros());
  }
  pass(archive, rows);
  pass(archive, cols);
  pass(archive, outer);
  pass(archive, inner);
  pass(archive, values);
  if constexpr (Archive::kReads)
    matrix = Eigen::Map<const Sparse>(rows, cols, values.size(), outer.data(), inner.data(), values.data());
}

/// A visitor of common/bundle/fields.h.
template <typename Archive>
struct FieldPasser {
  Archive& archive;
  void group(std::string_view, std::string_view) {}
  template <typename T>
  void attribute(std::string_view, T& member) {
    pass(archive, member);
  }
  template <typename T>
  void dataset(std::string_view, T& member) {
    pass(archive, member);
  }
};

template <typename Archive>
void pass_members(Archive& archive, CubatureData& value) {
  FieldPasser<Archive> fields{archive};
  visit_cubature(value, fields);
}

template <typename Archive>
void pass_members(Archive& archive, TargetElasticityData& value) {
  pass_all(archive, value.heldout_error, value.elements, value.weights, value.volumes, value.gradient,
           value.target_gradient, value.youngs_modulus, value.poisson_ratio, value.control_points);
}

template <typename Archive>
void pass_members(Archive& archive, PolynomialData& value) {
  FieldPasser<Archive> fields{archive};
  visit_polynomial(value, fields);
}

template <typename Archive>
void pass_members(Archive& archive, TargetTableData& value) {
  FieldPasser<Archive> fields{archive};
  visit_targets(kTopPlace, value, fields);
}

/// To be hashed alone: how many examples there are is not in the bytes.
inline void pass_members(ByteWriter& archive, ExampleSet& value) {
  FieldPasser<ByteWriter> fields{archive};
  visit_examples(kTopPlace, value, fields);
}

template <typename Archive, typename... Members>
void pass_all(Archive& archive, Members&... members) {
  (pass(archive, members), ...);
}

template <typename Archive>
void pass_members(Archive& archive, TetMesh& value) {
  pass_all(archive, value.vertices, value.tets);
}

template <typename Archive>
void pass_members(Archive& archive, TetMaterials& value) {
  pass_all(archive, value.density, value.youngs_modulus, value.poisson_ratio, value.model, value.formulation,
           value.variance_factor);
}

template <typename Archive, typename First, typename Second>
void pass_members(Archive& archive, std::pair<First, Second>& value) {
  pass_all(archive, value.first, value.second);
}

template <typename Archive>
void pass_members(Archive& archive, std::string& value) {
  value.resize(static_cast<std::size_t>(pass_size(archive, std::ssize(value), 1)));
  archive.raw(value.data(), value.size());
}

template <typename Archive, typename Element>
void pass_members(Archive& archive, std::vector<Element>& value) {
  value.resize(static_cast<std::size_t>(pass_size(archive, std::ssize(value), 1)));
  for (Element& element : value) pass(archive, element);
}

template <typename Archive, typename Held>
void pass_members(Archive& archive, std::optional<Held>& value) {
  bool holds = value.has_value();
  pass(archive, holds);
  if constexpr (Archive::kReads) {
    if (holds)
      value.emplace();
    else
      value.reset();
  }
  if (holds) pass(archive, *value);
}

template <typename Archive, typename Value>
void pass(Archive& archive, Value& value) {
  if constexpr (std::is_arithmetic_v<Value> || std::is_enum_v<Value>)
    archive.raw(&value, sizeof(value));
  else if constexpr (std::is_base_of_v<Eigen::SparseMatrixBase<Value>, Value>)
    pass_sparse(archive, value);
  else if constexpr (std::is_base_of_v<Eigen::PlainObjectBase<Value>, Value>)
    pass_dense(archive, value);
  else
    pass_members(archive, value);
}

/// A writer leaves what it passes over as it was.
template <typename Value>
void write_bytes(ByteWriter& writer, const Value& value) {
  pass(writer, const_cast<Value&>(value));
}

}  // namespace exmat::precompute

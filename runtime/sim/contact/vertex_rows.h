#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <numeric>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"

namespace exmat::runtime {

/// The rows of a basis of some vertices, three of r modes each, padded as the kernels of vertices have them.
class VertexRows {
 public:
  using Rows = Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>, Eigen::Unaligned,
                          Eigen::OuterStride<>>;

  VertexRows() = default;
  /// Those of the vertices at `ids` of `basis` [3n x r].
  template <class Ids>
  VertexRows(const RowMatrix& basis, const Ids& ids)
      : modes_(basis.cols()), numbers_(3 * static_cast<Eigen::Index>(ids.size()) * padded(modes_)) {
    double* to = numbers_.data();
    for (const auto id : ids)
      for (int row = 0; row < 3; ++row, to += stride()) {
        const auto from = basis.row(3 * static_cast<Eigen::Index>(id) + row);
        std::copy(from.begin(), from.end(), to);
      }
  }

  /// Sets one mode, by which each vertex moves as its row of `velocities` says.
  void set_one_mode(const VertexArray& velocities) {
    if (modes_ != 1) {
      modes_ = 1;
      numbers_ = AlignedArray(velocities.size() * stride());
    }
    double* to = numbers_.data();
    for (const double velocity : velocities.reshaped<Eigen::RowMajor>()) {
      *to = velocity;
      to += stride();
    }
  }

  Eigen::Index modes() const noexcept { return modes_; }
  Eigen::Index stride() const noexcept { return padded(modes_); }  ///< numbers of a row
  const double* data() const noexcept { return numbers_.data(); }

  Rows operator[](int vertex) const noexcept {  ///< 3 x r
    return {numbers_.data() + 3 * stride() * vertex, 3, modes_, Eigen::OuterStride<>(stride())};
  }
  /// [3 count]: the rows of each of `vertices` times x [stride].
  void products(const int* vertices, std::ptrdiff_t count, const AlignedArray& x, double* products) const noexcept {
    kernels().vertex_products(data(), stride(), vertices, count, x.data(), products);
  }
  /// The same of the first `count` vertices; where v is not null also times v, of each 64 vertices in turn: their rows
  /// stay in the cache.
  void products_of_all(std::ptrdiff_t count, const AlignedArray& x, double* times_x, const AlignedArray* v,
                       double* times_v) const noexcept {
    std::array<int, 64> vertices;
    for (std::ptrdiff_t done = 0; done < count; done += std::ssize(vertices)) {
      const std::ptrdiff_t some = std::min(count - done, std::ssize(vertices));
      std::iota(vertices.begin(), vertices.begin() + some, static_cast<int>(done));
      products(vertices.data(), some, x, times_x + 3 * done);
      if (v != nullptr) products(vertices.data(), some, *v, times_v + 3 * done);
    }
  }

 private:
  Eigen::Index modes_ = 0;
  AlignedArray numbers_;
};

}  // namespace exmat::runtime

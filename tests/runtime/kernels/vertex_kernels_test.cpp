#include <Eigen/Core>
#include <algorithm>
#include <gtest/gtest.h>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/kernels/aligned_array.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace vertex_kernels_test {

constexpr double kRounding = 1e-14;  // of sums of at most 50 terms, over their norms

/// Rows of vertices, numbers beside them, and some of the vertices, not in order and one of them twice.
class VertexKernels : public testing::TestWithParam<int> {
 protected:
  VertexKernels() : basis(test::random_matrix(3 * kVertices, modes, 1)), rows(3 * kVertices * stride) {
    for (Eigen::Index i = 0; i < basis.rows(); ++i)
      for (Eigen::Index c = 0; c < modes; ++c) rows[i * stride + c] = basis(i, c);
  }
  auto rows_of(Eigen::Index i) const { return basis.middleRows<3>(3 * vertices[static_cast<std::size_t>(i)]); }
  Eigen::Index count() const { return std::ssize(vertices); }

  static constexpr Eigen::Index kVertices = 11;
  const Eigen::Index modes = GetParam(), stride = padded(modes);
  const RowMatrix basis;
  AlignedArray rows;
  const std::vector<int> vertices{7, 0, 10, 3, 3, 9, 1};
};

TEST_P(VertexKernels, ProductsAreThoseOfTheRows) {
  const Eigen::VectorXd q = test::random_vector(modes, 2);
  AlignedArray x(modes);
  std::copy(q.begin(), q.end(), x.data());
  for (const Kernels* kernels : available()) {
    Eigen::Matrix3Xd products = Eigen::Matrix3Xd::Constant(3, count() + 1, 5);
    kernels->vertex_products(rows.data(), stride, vertices.data(), count(), x.data(), products.data());
    for (Eigen::Index i = 0; i < count(); ++i)
      EXPECT_LE((products.col(i) - rows_of(i) * q).norm(), kRounding * rows_of(i).norm() * q.norm()) << kernels->name;
    EXPECT_EQ(products.col(count()), Eigen::Vector3d::Constant(5)) << "written beyond the end";
  }
}

TEST_P(VertexKernels, LoadsAreTheTransposedProductsAndTheirSum) {
  const Eigen::Matrix3Xd vectors = test::random_matrix(3, count(), 3);
  const Eigen::VectorXd before = test::random_vector(stride, 4);
  const Eigen::Index outer = stride + 2 * kLanes;
  Eigen::VectorXd expected = before.head(modes);
  for (Eigen::Index i = 0; i < count(); ++i) expected += rows_of(i).transpose() * vectors.col(i);
  for (const Kernels* kernels : available()) {
    AlignedArray loads(count() * outer), sums(stride);
    std::copy(before.begin(), before.end(), sums.data());
    kernels->vertex_loads(rows.data(), stride, vertices.data(), count(), vectors.data(), loads.data(), outer);
    kernels->add_vertex_loads(rows.data(), stride, vertices.data(), count(), vectors.data(), sums.data());
    for (Eigen::Index i = 0; i < count(); ++i) {
      const Eigen::VectorXd own = rows_of(i).transpose() * vectors.col(i);
      const Eigen::Map<const Eigen::VectorXd> found(loads.data() + i * outer, outer);
      EXPECT_LE((found.head(modes) - own).norm(), kRounding * rows_of(i).norm()) << kernels->name;
      EXPECT_EQ(found.tail(outer - modes).squaredNorm(), 0) << kernels->name;
    }
    const Eigen::Map<const Eigen::VectorXd> sum(sums.data(), stride);
    EXPECT_LE((sum.head(modes) - expected).norm(), kRounding * basis.norm()) << kernels->name;
    EXPECT_EQ(sum.tail(stride - modes), before.tail(stride - modes)) << kernels->name;
  }
}

TEST_P(VertexKernels, SquaresAreTheProductWithTheTranspose) {
  for (const Eigen::Index some : {0, 1, 48}) {
    RowMatrix factors = RowMatrix::Zero(some, stride);
    factors.leftCols(modes) = test::random_matrix(some, modes, 5);
    AlignedArray padded_factors(some * stride);
    std::copy(factors.reshaped<Eigen::RowMajor>().begin(), factors.reshaped<Eigen::RowMajor>().end(),
              padded_factors.data());
    const Eigen::MatrixXd expected = factors.transpose() * factors + Eigen::MatrixXd::Ones(stride, stride);
    for (const Kernels* kernels : available()) {
      AlignedArray squares(stride * stride);
      std::fill_n(squares.data(), stride * stride, 1.0);
      kernels->add_squares(padded_factors.data(), some, stride, squares.data());
      const Eigen::Map<const RowMatrix> found(squares.data(), stride, stride);
      for (Eigen::Index i = 0; i < stride; ++i)
        for (Eigen::Index j = i; j < stride; ++j)
          EXPECT_NEAR(found(i, j), expected(i, j), kRounding * static_cast<double>(some + 1)) << kernels->name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, VertexKernels, testing::Values(1, 7, 8, 20, 30, 42));

}  // namespace vertex_kernels_test
}  // namespace exmat::runtime

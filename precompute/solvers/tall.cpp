#include "precompute/solvers/tall.h"

#include <algorithm>
#include <omp.h>
#include <vector>

#include "precompute/solvers/blas.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kParts = 16;  // of the rows, summed one by one whatever the number of threads
constexpr Eigen::Index kLittle = 300'000;
constexpr int kSummed = 8;                // columns of a row of a product that the registers hold
constexpr Eigen::Index kTransposed = 64;  // rows that are turned around while they are in the caches

struct Part {
  Eigen::Index begin, size;
};

Part part_of(Eigen::Index rows, Eigen::Index index) {
  const Eigen::Index begin = rows * index / kParts;
  return {begin, rows * (index + 1) / kParts - begin};
}

// For so many numbers: threads that wait for each other cost more than little work.
int threads_for(Eigen::Index numbers, int most) { return numbers < kLittle ? 1 : most; }

// Sums work(part), a matrix of each part of the rows.
template <typename Work>
Eigen::MatrixXd sum_of_parts(Eigen::Index rows, int threads, const Work& work) {
  std::vector<Eigen::MatrixXd> sums(kParts);
#pragma omp parallel for schedule(static) num_threads(threads)
  for (Eigen::Index i = 0; i < kParts; ++i) sums[static_cast<std::size_t>(i)] = work(part_of(rows, i));
  for (std::size_t i = 1; i < sums.size(); ++i) sums.front() += sums[i];
  return sums.front();
}

int as_int(Eigen::Index i) { return static_cast<int>(i); }

}  // namespace

RowMatrix product(const SparseMatrix& A, const RowMatrix& X) {
  RowMatrix Y;
  product(A, X, Y);
  return Y;
}

void product(const SparseMatrix& A, const RowMatrix& X, RowMatrix& Y) {
  Y.resize(A.rows(), X.cols());
  const Eigen::Index whole = X.cols() / kSummed * kSummed, left = X.cols() - whole;
  const int threads = threads_for(A.nonZeros() + Y.size(), omp_get_max_threads());
#pragma omp parallel for schedule(static) num_threads(threads)
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    for (Eigen::Index begin = 0; begin < whole; begin += kSummed) {
      Eigen::Matrix<double, 1, kSummed> sum = Eigen::Matrix<double, 1, kSummed>::Zero();
      for (SparseMatrix::InnerIterator entry(A, row); entry; ++entry)
        sum += entry.value() * X.row(entry.col()).segment<kSummed>(begin);
      Y.row(row).segment<kSummed>(begin) = sum;
    }
    if (left == 0) continue;
    auto sum = Y.row(row).tail(left);
    sum.setZero();
    for (SparseMatrix::InnerIterator entry(A, row); entry; ++entry)
      sum += entry.value() * X.row(entry.col()).tail(left);
  }
}

Eigen::MatrixXd inner(const Columns& A, const Columns& B) {
  if (A.cols() == 0 || B.cols() == 0) return Eigen::MatrixXd::Zero(A.cols(), B.cols());
  return sum_of_parts(A.rows(), threads_for(A.rows() * (A.cols() + B.cols()), blas_callers()), [&](Part part) {
    Eigen::MatrixXd C = Eigen::MatrixXd::Zero(A.cols(), B.cols());
    if (part.size == 0) return C;
    const int m = as_int(A.cols()), n = as_int(B.cols()), k = as_int(part.size), lda = as_int(A.outerStride()),
              ldb = as_int(B.outerStride());
    const double one = 1, zero = 0;
    dgemm_("N", "T", &m, &n, &k, &one, A.data() + part.begin * A.outerStride(), &lda,
           B.data() + part.begin * B.outerStride(), &ldb, &zero, C.data(), &m);
    return C;
  });
}

void add_product(double factor, const Columns& V, const Eigen::MatrixXd& C, RowMatrix& X) {
  if (V.cols() == 0 || X.cols() == 0) return;
  const int threads = threads_for(X.rows() * (V.cols() + X.cols()), blas_callers());
#pragma omp parallel for schedule(static) num_threads(threads)
  for (Eigen::Index i = 0; i < kParts; ++i) {
    const Part part = part_of(X.rows(), i);
    if (part.size == 0) continue;
    const int m = as_int(X.cols()), n = as_int(part.size), k = as_int(V.cols()), ldv = as_int(V.outerStride());
    const double one = 1;
    dgemm_("T", "N", &m, &n, &k, &factor, C.data(), &k, V.data() + part.begin * V.outerStride(), &ldv, &one,
           X.data() + part.begin * X.cols(), &m);
  }
}

void combine(const Eigen::RowVectorXd& a, const Eigen::RowVectorXd& b, const RowMatrix& V, RowMatrix& X) {
  const int threads = threads_for(X.size() + V.size(), omp_get_max_threads());
#pragma omp parallel for schedule(static) num_threads(threads)
  for (Eigen::Index row = 0; row < X.rows(); ++row)
    X.row(row) = X.row(row).cwiseProduct(a) + V.row(row).cwiseProduct(b);
}

RowMatrix by_rows(const Eigen::Ref<const Eigen::MatrixXd>& columns) {
  RowMatrix rows(columns.rows(), columns.cols());
  const Eigen::Index blocks = (rows.rows() + kTransposed - 1) / kTransposed;
#pragma omp parallel for schedule(static) num_threads(threads_for(rows.size(), omp_get_max_threads()))
  for (Eigen::Index block = 0; block < blocks; ++block) {
    const Eigen::Index begin = block * kTransposed, count = std::min(kTransposed, rows.rows() - begin);
    rows.middleRows(begin, count) = columns.middleRows(begin, count);
  }
  return rows;
}

void put_by_columns(const RowMatrix& rows, Eigen::Ref<Eigen::MatrixXd> columns) {
  const Eigen::Index blocks = (rows.rows() + kTransposed - 1) / kTransposed;
#pragma omp parallel for schedule(static) num_threads(threads_for(rows.size(), omp_get_max_threads()))
  for (Eigen::Index block = 0; block < blocks; ++block) {
    const Eigen::Index begin = block * kTransposed, count = std::min(kTransposed, rows.rows() - begin);
    columns.middleRows(begin, count) = rows.middleRows(begin, count);
  }
}

Eigen::RowVectorXd column_dots(const RowMatrix& A, const RowMatrix& B) {
  return sum_of_parts(A.rows(), threads_for(A.size() + B.size(), omp_get_max_threads()), [&](Part part) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(1, A.cols());
    for (Eigen::Index row = part.begin; row < part.begin + part.size; ++row)
      sum.row(0) += A.row(row).cwiseProduct(B.row(row));
    return sum;
  });
}

}  // namespace exmat::precompute

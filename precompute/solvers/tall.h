#pragma once

// Private to precompute/solvers: products of matrices of many rows and few columns, by rows, on all threads. Results
// are the same for every number of threads.

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "common/mesh/assembly.h"

namespace exmat::precompute {

/// Some columns of a matrix by rows.
using Columns = Eigen::Ref<const RowMatrix, 0, Eigen::OuterStride<>>;

/// A X.
RowMatrix product(const SparseMatrix& A, const RowMatrix& X);
/// The same into `Y`, whose memory is used again where it fits.
void product(const SparseMatrix& A, const RowMatrix& X, RowMatrix& Y);

/// A^T B.
Eigen::MatrixXd inner(const Columns& A, const Columns& B);

/// X += factor V C.
void add_product(double factor, const Columns& V, const Eigen::MatrixXd& C, RowMatrix& X);

/// X = X a + V b, a and b a number of each column.
void combine(const Eigen::RowVectorXd& a, const Eigen::RowVectorXd& b, const RowMatrix& V, RowMatrix& X);

/// The same numbers by rows, or by columns.
RowMatrix by_rows(const Eigen::Ref<const Eigen::MatrixXd>& columns);
void put_by_columns(const RowMatrix& rows, Eigen::Ref<Eigen::MatrixXd> columns);

/// a . b of the columns of both.
Eigen::RowVectorXd column_dots(const RowMatrix& A, const RowMatrix& B);

}  // namespace exmat::precompute

#pragma once

// Private to precompute/solvers: the functions of BLAS that PETSc's headers do not declare. Matrices are by columns.

namespace exmat::precompute {

/// Threads that may call BLAS at the same time. OpenBLAS that was built without threads hands out the same work space
/// twice: then it is one.
int blas_callers();

}  // namespace exmat::precompute

// Their names are those of BLAS. NOLINTBEGIN(readability-identifier-naming)
extern "C" {
void sgemm_(const char* form_a, const char* form_b, const int* m, const int* n, const int* k, const float* alpha,
            const float* a, const int* lda, const float* b, const int* ldb, const float* beta, float* c,
            const int* ldc);
void ssyrk_(const char* triangle, const char* form, const int* n, const int* k, const float* alpha, const float* a,
            const int* lda, const float* beta, float* c, const int* ldc);
void strsm_(const char* side, const char* triangle, const char* form, const char* diagonal, const int* m, const int* n,
            const float* alpha, const float* a, const int* lda, float* b, const int* ldb);
void dgemm_(const char* form_a, const char* form_b, const int* m, const int* n, const int* k, const double* alpha,
            const double* a, const int* lda, const double* b, const int* ldb, const double* beta, double* c,
            const int* ldc);
}
// NOLINTEND(readability-identifier-naming)

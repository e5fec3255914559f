#include "precompute/solvers/blas.h"

#include <dlfcn.h>
#include <omp.h>

namespace exmat::precompute {

int blas_callers() {
  using Kind = int (*)();  // 0: OpenBLAS without threads
  static const auto kind = reinterpret_cast<Kind>(dlsym(RTLD_DEFAULT, "openblas_get_parallel"));
  return kind != nullptr && kind() == 0 ? 1 : omp_get_max_threads();
}

}  // namespace exmat::precompute

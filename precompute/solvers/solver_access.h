#pragma once

// Private to precompute/solvers.

#include "precompute/solvers/petsc_handles.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

struct SemidefiniteSolver::Implementation {
  MatHandle matrix, factor;
  Eigen::Index size = 0;    ///< n
  Eigen::Index border = 0;  ///< c
};

}  // namespace exmat::precompute

#pragma once

#include <Eigen/Core>

#include "precompute/full_space/sparse_direction.h"
#include "tests/support/sparse_space/step_potential.h"

namespace exmat::precompute {

/// Minimises the potential of a step from `d`, that of its start(), as runtime::newton_minimise() does with dense
/// matrices: exact Hessian, positive semi-definite element tangents only where it is not positive definite, Armijo line
/// search. On return the last evaluate() was at d.
runtime::NewtonReport minimise_step(StepPotential& potential, const runtime::NewtonSettings& settings,
                                    SparseDirection& solver, Eigen::VectorXd& d);

}  // namespace exmat::precompute

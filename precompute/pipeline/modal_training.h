#pragma once

#include "precompute/pipeline/basis_stage.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

/// True if runs of training are to have the degrees of freedom of many modes: one step in full space would take
/// seconds where there are more than 50,000 of them.
bool trains_in_modes(TrainingSpace space, const ElasticSystem& system);

/// A body of many modes and elements, in place of the full space.
struct ManyModes {
  ReducedModel model;
  EnergyReference reference = EnergyReference::kExample;  ///< reference of its targets
};

/// [f x k] what a body of `size` [m] looks like at rest under the loads of the chains, as far as that is linear;
/// `solver` is that of the system's stiffness.
Eigen::MatrixXd static_responses(const ElasticSystem& system, const SemidefiniteSolver& solver, double size,
                                 const std::vector<Chain>& chains);

/// Up to 100 modes: those of modal_basis() of the examples' poses and the static responses [f x k], and up to 300
/// elements. `body` has /object.
ManyModes many_modes(const BodyStages& stages, const ReducedModel& body, const Eigen::MatrixXd& responses, bool thrown,
                     std::uint64_t seed);

/// Runs the chains with it.
TrainingSet run_training(const ManyModes& body, const ElasticSystem& system, const TrainingChains& chains);

}  // namespace exmat::precompute

#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace exmat::runtime {

/// Bits of StepReport::status.
enum StepStatus : std::uint32_t {
  kStepNonFinite = 1,       ///< NaN or infinity met: the state is as it was before the step
  kStepIterationLimit = 2,  ///< the residual is above the tolerance
  kStepStagnated = 4,       ///< likewise, and no step along the Newton direction lowers the potential
  kTargetNotConverged = 8,  ///< the target is its last iterate
  kStepSubnormal = 16,      ///< no fault: numbers of q or v below 2.2e-308 were set to zero, which keeps steps fast
  kStepAsleep = 32,         ///< no fault: the body rests, and the step has left it alone
  kStepDivided = 64,        ///< no fault: taken in several smaller ones
};

/// The bits that say that a residual is above its tolerance.
inline constexpr std::uint32_t kStepUnconverged = kStepIterationLimit | kStepStagnated | kTargetNotConverged;

/// Result of one step.
struct StepReport {
  std::uint32_t status = 0;
  int newton_iterations = 0;
  int factorisations = 0;           ///< Hessians factored; the residual of a later iteration may do with an earlier one
  int line_search_evaluations = 0;  ///< beyond one evaluation of each iterate
  int projections = 0;              ///< Hessians that needed positive semi-definite element tangents
  int target_iterations = 0;
  int contacts = 0;                                         ///< vertices that touch an obstacle
  Eigen::Vector3d contact_force = Eigen::Vector3d::Zero();  ///< sum over them [N]
  double residual = 0;                                      ///< residual of the equation of motion [kg^1/2 m/s^2]
};

}  // namespace exmat::runtime

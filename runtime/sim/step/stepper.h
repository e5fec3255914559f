#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// Bits of StepReport::status.
enum StepStatus : std::uint32_t {
  kStepNonFinite = 1,       ///< NaN or infinity met: the state is as it was before the step
  kStepIterationLimit = 2,  ///< the residual is above the tolerance
  kStepStagnated = 4,       ///< likewise, and no step along the Newton direction lowers the potential
  kTargetNotConverged = 8,  ///< the target is its last iterate
  kStepSubnormal = 16,      ///< no fault: numbers of q or v below 2.2e-308 were set to zero, which keeps steps fast
};

/// The bits that say that a residual is above its tolerance.
inline constexpr std::uint32_t kStepUnconverged = kStepIterationLimit | kStepStagnated | kTargetNotConverged;

/// What one step did.
struct StepReport {
  std::uint32_t status = 0;
  int newton_iterations = 0;
  int factorisations = 0;           ///< of the Hessian; the residual of a later iteration may do with an earlier one
  int line_search_evaluations = 0;  ///< beyond one evaluation of each iterate
  int projections = 0;              ///< Hessians that needed positive semi-definite element tangents
  int target_iterations = 0;
  int contacts = 0;                                         ///< vertices that touch an obstacle
  Eigen::Vector3d contact_force = Eigen::Vector3d::Zero();  ///< sum over them [N]
  double residual = 0;                                      ///< of the equation of motion [kg^1/2 m/s^2]
};

/// Advances a body by one time step: qddot + (alpha I + beta K) qdot + f_int(q) = f_ext + f_example, for a free body
/// with the forces of its rotation, near obstacles with those of its contacts. method.md, section 6. No allocation, no
/// exception. docs/step_in_detail.md.
StepReport step(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept;

/// Puts a body that a motion carries where it is at the time of `state`.
void place_on_carrier(const Model& model, const StepScene& scene, State& state);

/// Example weights of a state that no step has led to, for its output.
void refresh_weights(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept;

struct Energies {
  double kinetic = 0;    ///< 1/2 |v|^2 [J]
  double elastic = 0;    ///< E(q) [J]
  double potential = 0;  ///< of gravity, 0 at rest [J]

  double total() const { return kinetic + elastic + potential; }
};
Energies energies(const StepScene& scene, const State& state) noexcept;

}  // namespace exmat::runtime

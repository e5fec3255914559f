#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "common/config/scene_config.h"
#include "precompute/full_space/full_space_model.h"
#include "precompute/full_space/sparse_direction.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::precompute {

/// Loads on a body in full space, and how it is integrated: runtime::StepScene without a basis. A body that a motion
/// carries has no full-space scene.
struct FullSpaceScene {
  double time_step = 0.001;  ///< > 0 [s]
  Integrator integrator = Integrator::kBdf2;
  double mass_damping = 0;       ///< alpha >= 0 [1/s]
  double stiffness_damping = 0;  ///< beta >= 0 [s]
  runtime::NewtonSettings newton{50, 1e-8};
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [m/s^2]
  std::vector<VertexForceConfig> forces;              ///< vertices of the object
  runtime::Obstacles obstacles;
  std::vector<runtime::ExampleSettings> examples;  ///< one for each of the model's; none: no weights, targets, forces
};

/// Scratch of the steps of one body: factors that the next step may use again, nothing else.
struct FullSpaceWorkspace {
  explicit FullSpaceWorkspace(const FullSpaceModel& model);

  SparseDirection direction;                 ///< solves for Newton's directions
  std::unique_ptr<SupernodalCholesky> mass;  ///< once it is needed
  struct Examples {
    std::optional<runtime::TargetSolver::Workspace> target;
    std::optional<MeshElasticity> elasticity;  ///< from the target
  };
  std::vector<Examples> examples;  ///< as the model's
};

/// Result of one step, with its time.
struct FullSpaceReport : runtime::StepReport {
  Eigen::Index inverted_tets = 0;  ///< that an elastic example force leaves out, since the target inverts them
  double target_seconds = 0;       ///< weights and target: t_interp of the paper's Table 2
  double seconds = 0;              ///< all of it: t_total
};

/// Advances a body by one time step: M u'' + D u' + f_int(u) = f_ext + f_example, D = alpha M + beta K; what
/// runtime::step() does with all modes in the basis (docs/step_in_detail.md): the same integrators, the same first
/// iterate, damping and target frozen there, backward Euler near obstacles. Newton's method with an energy line search.
///
/// A free body moves in the world. Damping and example force are those of its deformation in the frame that fits it
/// best (FittedFrame) and take neither momentum nor, but for the integrator, angular momentum. It may turn by any
/// angle in a step: there is no backward Euler for fast turns, as there is in a moving frame.
FullSpaceReport step(const FullSpaceModel& model, const FullSpaceScene& scene, FullSpaceState& state,
                     FullSpaceWorkspace& workspace);

/// Kinetic, elastic and potential energy [J], as runtime::energies().
runtime::Energies energies(const FullSpaceModel& model, const FullSpaceScene& scene, const FullSpaceState& state);

}  // namespace exmat::precompute

#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/config/scene_config.h"
#include "precompute/full_space/full_space_model.h"
#include "runtime/sim/space/full/full_step.h"
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

/// Result of one step, with its time.
struct FullSpaceReport : runtime::StepReport {
  double target_seconds = 0;  ///< weights and target: t_interp of the paper's Table 2
  double seconds = 0;         ///< all of it: t_total
};

/// Steps of a body by runtime::FullStep, each to the tolerance of the scene. Refers to the model.
class FullSpaceStepper {
 public:
  explicit FullSpaceStepper(const FullSpaceModel& model) : model_(model), targets_(model.examples.size()) {}

  /// Takes what acts on the body in the next steps. Throws InputError: obstacles of a model without contact vertices.
  void set(const FullSpaceScene& scene);

  FullSpaceReport step(FullSpaceState& state);

 private:
  void set_targets(const FullSpaceState& state, runtime::FullStep& step, std::vector<runtime::ExampleState>& examples,
                   FullSpaceReport& report);

  const FullSpaceModel& model_;
  runtime::StepScene scene_;
  std::optional<runtime::FullWorkspace> workspace_;
  std::vector<std::optional<runtime::TargetSolver::Workspace>> targets_;
  runtime::ContactWorkspace contact_;
};

/// Kinetic, elastic and potential energy [J], as runtime::energies().
runtime::Energies energies(const FullSpaceModel& model, const FullSpaceScene& scene, const FullSpaceState& state);

}  // namespace exmat::precompute

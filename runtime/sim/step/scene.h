#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/choices.h"
#include "runtime/sim/contact/obstacle.h"
#include "runtime/sim/frame/world_loads.h"
#include "runtime/sim/solver/newton.h"
#include "runtime/sim/step/example_drivers.h"
#include "runtime/sim/step/model.h"

namespace exmat::runtime {

/// An example force, of the whole body or of a region. docs/step_in_detail.md, "The incremental potential".
struct ExampleSettings {
  double stiffness = 0;                                  ///< kappa >= 0 [1/s^2]; of an elastic one its factor e >= 0
  double damping = 0;                                    ///< c_kappa >= 0 [1/s]
  double bias = 1;                                       ///< in [0, 1]
  int target_iterations = TargetSolver::kMaxIterations;  ///< most in one step; the next one carries on
  /// The force is that of the elastic energy with the target as the undeformed shape, times the stiffness, in place of
  /// the linear one; the model has to have what that takes.
  bool elastic = false;
  Eigen::VectorXd given_weights{};       ///< [K] taken as they are, without the bias; empty: those of the pose
  std::vector<ExampleDriver> drivers{};  ///< that make the weights of a body on a skeleton, unless some are given
};

/// When a body is left alone: once its kinetic energy has been below `energy` for `time`.
struct SleepSettings {
  double energy = 0;  ///< [J]; 0: never
  double time = 0.5;  ///< [s]
};

/// In which of its spaces a body steps, and when it leaves the full one.
struct SpaceSettings {
  Space space = Space::kReduced;
  double release = 0.5;  ///< [s] that a body in space `auto` stays full after the last load that asked for it
  bool contact = true;   ///< to touch an obstacle is such a load, as forces of the caller are
  bool forces = true;    ///< the scene's forces are
  NewtonSettings newton{20, 0.01};  ///< settings for steps in full space
};

/// Loads on a body, and how it is integrated. The time step is the same for the whole life of a State.
struct StepScene : WorldLoads {
  double time_step = 0.001;  ///< > 0 [s]
  Integrator integrator = Integrator::kBdf2;
  double mass_damping = 0;       ///< alpha >= 0 [1/s]
  double stiffness_damping = 0;  ///< beta >= 0 [s]
  NewtonSettings newton;
  Precision precision = Precision::kDouble;  ///< the same for all bodies that step side by side
  SleepSettings sleep;
  SpaceSettings space;
  MeetingGroup meeting;
  Obstacles obstacles;                    ///< that the body meets
  std::vector<ExampleSettings> examples;  ///< one for each of the model's; none: no weights, targets, example forces
  bool begins_anew = false;  ///< something of it has jumped since the last step, which is no smooth past then
};

/// True if these examples exert a force; weights and targets of those that do not are left out.
inline bool acts(const ExampleSettings& examples) noexcept { return examples.stiffness > 0 || examples.damping > 0; }

/// True if drivers make the weights.
inline bool is_driven(const ExampleSettings& examples) noexcept {
  return examples.given_weights.size() == 0 && !examples.drivers.empty();
}

/// kappa of a linear force, and the factor e of an elastic one; 0 of the other.
inline double linear_stiffness(const ExampleSettings& examples) noexcept {
  return examples.elastic ? 0 : examples.stiffness;
}
inline double elastic_factor(const ExampleSettings& examples) noexcept {
  return examples.elastic ? examples.stiffness : 0;
}

/// True if the force has a part that the shape filter takes: a spring to the target, or damping.
inline bool is_filtered(const ExampleSettings& examples) noexcept {
  return linear_stiffness(examples) > 0 || examples.damping > 0;
}

/// True if any examples exert a force.
inline bool runs_examples(const StepScene& scene) noexcept { return std::ranges::any_of(scene.examples, acts); }

/// True if steps look for contacts with obstacles.
inline bool touches(const Model& model, const StepScene& scene) noexcept {
  return model.contact && !scene.obstacles.empty();
}

/// [r] generalised force of gravity [m/s^2].
Eigen::VectorXd gravity_force(const Model& model, const Eigen::Vector3d& gravity);

/// [r] generalised force of the same world-space force [N] on each of k vertices, `basis_rows` [3k x r].
Eigen::VectorXd vertex_force(const RowMatrix& basis_rows, const Eigen::Vector3d& force);

/// The same world-space force [N] on each of k vertices, `basis_rows` [3k x r], at rest at `positions` [k x 3], for all
/// times. `positions` are asked of a body that moves alone.
ScriptedForce scripted_force(const Model& model, const RowMatrix& basis_rows, const VertexArray& positions,
                             const Eigen::Vector3d& force);

}  // namespace exmat::runtime

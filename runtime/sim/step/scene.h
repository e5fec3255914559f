#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/choices.h"
#include "runtime/sim/contact/obstacle.h"
#include "runtime/sim/solver/newton.h"
#include "runtime/sim/step/model.h"

namespace exmat::runtime {

/// A constant world-space force on each of some vertices that acts in every step whose midpoint lies in [start, end).
struct ScriptedForce {
  Eigen::VectorXd force;                                 ///< [r] generalised, of a body that stays where it is
  double start = 0;                                      ///< [s]
  double end = std::numeric_limits<double>::infinity();  ///< [s]
  Eigen::Vector3d total = Eigen::Vector3d::Zero();       ///< sum over the vertices [N]
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();       ///< mean of the vertices' X about the centre of mass [m]
  Eigen::Matrix3Xd mean_basis{};                         ///< [3 x r] mean of their U; these three for a body that moves
};

/// A linear example force, of the whole body or of a region. method.md, section 5.
struct ExampleSettings {
  double stiffness = 0;                                  ///< kappa >= 0 [1/s^2]
  double damping = 0;                                    ///< c_kappa >= 0 [1/s]
  double bias = 1;                                       ///< in [0, 1]
  int target_iterations = TargetSolver::kMaxIterations;  ///< most in one step; the next one carries on
};

/// What acts on a body, and how it is integrated. The time step is the same for the whole life of a State.
struct StepScene {
  double time_step = 0.001;  ///< > 0 [s]
  Integrator integrator = Integrator::kBdf2;
  double mass_damping = 0;       ///< alpha >= 0 [1/s]
  double stiffness_damping = 0;  ///< beta >= 0 [s]
  NewtonSettings newton;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [m/s^2]; moves a free body
  Eigen::VectorXd gravity_force;                      ///< [r], gravity_load^T g
  std::vector<ScriptedForce> forces;
  std::vector<Obstacle> obstacles;
  std::optional<RigidMotion> carrier;     ///< of a model with `carried`: what carries its fixed part
  std::vector<ExampleSettings> examples;  ///< one for each of the model's; none: no weights, targets, example forces
};

/// Whether these examples exert a force; weights and targets of those that do not are left out.
inline bool acts(const ExampleSettings& examples) noexcept { return examples.stiffness > 0 || examples.damping > 0; }

/// Whether any examples do.
inline bool runs_examples(const StepScene& scene) noexcept { return std::ranges::any_of(scene.examples, acts); }

/// Whether steps look for contacts.
inline bool touches(const Model& model, const StepScene& scene) noexcept {
  return model.contact && !scene.obstacles.empty();
}

/// [r] generalised force of gravity [m/s^2].
Eigen::VectorXd gravity_force(const Model& model, const Eigen::Vector3d& gravity);

/// [r] generalised force of the same world-space force [N] on each of k vertices, `basis_rows` [3k x r].
Eigen::VectorXd vertex_force(const RowMatrix& basis_rows, const Eigen::Vector3d& force);

}  // namespace exmat::runtime

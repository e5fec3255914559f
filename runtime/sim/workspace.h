#pragma once

#include <Eigen/Core>

#include "runtime/sim/integrator.h"
#include "runtime/sim/model.h"
#include "runtime/sim/newton.h"
#include "runtime/sim/profile.h"
#include "runtime/sim/scene.h"

namespace exmat::runtime {

/// Scratch of one step, sized once for a model and a scene; holds nothing from step to step. One per thread.
struct Workspace {
  Workspace(const Model& model, const StepScene& scene);

  Profile* profile = nullptr;  ///< times every stage, if set

  NewtonWorkspace newton;
  ReducedElasticity::Workspace elasticity;
  StepForm form;
  Eigen::VectorXd q, predictor;     ///< r
  Eigen::VectorXd external_force;   ///< r
  Eigen::VectorXd internal_force;   ///< r
  Eigen::VectorXd acceleration;     ///< r, at the beginning of the step
  Eigen::VectorXd offset, product;  ///< r
  Eigen::MatrixXd damping;          ///< r x r, beta K; only with stiffness damping
  Eigen::VectorXd skew_force;       ///< r; only with examples

  ExampleWeights::Workspace weights_solver;  // the rest only with examples
  TargetSolver::Workspace target_solver;
  Eigen::VectorXd weights;  ///< K
  Eigen::VectorXd target;   ///< d
  ExampleForce example_force;
};

}  // namespace exmat::runtime

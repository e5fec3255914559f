#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/solver/newton.h"
#include "runtime/sim/solver/profile.h"
#include "runtime/sim/step/attachment_terms.h"
#include "runtime/sim/step/integrator.h"
#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"

namespace exmat::runtime {

/// Scratch of steps near obstacles or held by a host, sized once.
struct ContactProblemWorkspace {
  ContactProblemWorkspace() = default;
  ContactProblemWorkspace(const Model& model, const StepScene& scene);

  ContactWorkspace contact;
  AttachmentWorkspace held;
  NewtonWorkspace newton;         ///< solves for the unknowns below
  Eigen::VectorXd x;              ///< 6 + r, or r of a constrained body
  Eigen::VectorXd q, gradient_q;  ///< r
  Eigen::MatrixXd stiffness;      ///< stiffness of the contacts, in the unknowns
  double extent = 0;              ///< distance of the vertices from the world's origin, about [m]
};

/// Scratch of one example force. K examples, d target coordinates.
struct ExampleWorkspace {
  explicit ExampleWorkspace(const ExampleModel& model);

  ExampleWeights::Workspace weights_solver;
  TargetTable::Workspace target_table;
  TargetSolver::Workspace target_solver;
  Eigen::VectorXd weights;        ///< K
  Eigen::VectorXd solved_target;  ///< d, its coordinates, where it is solved for or the force is elastic
  bool target_converged = false;  ///< true if solved_target converged
  Eigen::VectorXd target;         ///< r, its pull g, of a linear force
  std::optional<TargetElasticity::Workspace> elasticity;  ///< present for an elastic force
  ExampleForce force;
};

/// Scratch of one step, sized once for a model and a scene, of a body that may meet other bodies or not; holds nothing
/// from step to step that a result depends on. One per thread.
struct Workspace {
  Workspace(const Model& model, const StepScene& scene, bool meets_bodies = false);

  /// Sizes it for the steps of a body with these attachments.
  void fit(const Model& model, const StepScene& scene, std::span<const Attachment> attachments);

  Profile* profile = nullptr;  ///< times every stage, if set

  NewtonWorkspace newton;
  InternalForce::Workspace elasticity;
  StepForm form;
  Eigen::VectorXd q, v;            ///< r, at the end of the step
  Eigen::VectorXd external_force;  ///< r
  Eigen::VectorXd internal_force;  ///< r
  Eigen::VectorXd acceleration;    ///< r, at the beginning of the step
  Eigen::VectorXd offset;          ///< r
  Eigen::MatrixXd quadratic;       ///< padded(r) x r, see IncrementalPotential
  Eigen::VectorXd linear;          ///< r
  Eigen::VectorXd product;         ///< padded(r)

  Eigen::VectorXd frozen_force, next_frozen_force;  ///< r, see IncrementalPotential

  bool predictor_was_lower = true;  ///< in the last step than where it began: which of the two is looked at first

  std::optional<ContactProblemWorkspace> near;  ///< present for a body that may touch anything, or is held
  FrameWorkspace frame;                         ///< scratch of the model's frame
  std::vector<ExampleWorkspace> examples;       ///< one for each of the scene's
};

}  // namespace exmat::runtime

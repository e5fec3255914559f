#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "precompute/full_space/full_space_stepper.h"
#include "precompute/full_space/sparse_direction.h"
#include "tests/support/sparse_space/vertex_contacts.h"

// A full space that shares no step with the run time's: sparse Cholesky factors, all in double precision, another
// Newton's method.
namespace exmat::precompute {

/// With what its steps need beside those of the run time.
struct SparseModel : FullSpaceModel {
  SparseModel() = default;
  /// `data` is that of the same bundle.
  SparseModel(FullSpaceModel of, const ReducedModel& data);

  Eigen::VectorXd mass_values;             ///< values of the mass matrix on the pattern of the stiffness [kg]
  std::optional<VertexContacts> contacts;  ///< present for a bundle with /contact
};
SparseModel build_sparse_model(const ReducedModel& model, const FullSpaceOptions& options = {});

/// Scratch of the steps of one body: factors that the next step may use again, nothing else.
struct SparseWorkspace {
  explicit SparseWorkspace(const SparseModel& model);

  SparseDirection direction;                 ///< solves for Newton's directions
  std::unique_ptr<SupernodalCholesky> mass;  ///< once it is needed
  struct Examples {
    std::optional<runtime::TargetSolver::Workspace> target;
    std::optional<MeshElasticity> elasticity;  ///< from the target
  };
  std::vector<Examples> examples;  ///< as the model's
};

/// FullSpaceReport of a step here.
struct SparseReport : FullSpaceReport {
  Eigen::Index inverted_tets = 0;  ///< that an elastic example force leaves out, since the target inverts them
};

/// Advances a body by one time step: M u'' + D u' + f_int(u) = f_ext + f_example, D = alpha M + beta K; what
/// runtime::step() does with all modes in the basis (docs/step_in_detail.md): the same integrators, the same first
/// iterate, damping and target frozen there, backward Euler near obstacles. Newton's method with an energy line search.
///
/// A free body moves in the world. Damping and example force are those of its deformation in the frame that fits it
/// best (FittedFrame) and take neither momentum nor, but for the integrator, angular momentum. It may turn by any
/// angle in a step: there is no backward Euler for fast turns, as there is in a moving frame.
SparseReport step(const SparseModel& model, const FullSpaceScene& scene, FullSpaceState& state,
                  SparseWorkspace& workspace);

}  // namespace exmat::precompute

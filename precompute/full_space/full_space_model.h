#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/full_space/fitted_frame.h"
#include "precompute/full_space/full_space_examples.h"
#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/full_space/target_method.h"
#include "runtime/sim/space/full/full_model.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"

namespace exmat::precompute {

/// A body with all degrees of freedom of its mesh: what the reduced model of the same bundle is measured against.
/// Immutable. n vertices, f free degrees of freedom (all 3n of a free body, which moves in the world by itself).
struct FullSpaceModel {
  VertexArray rest;                         ///< n x 3 [m]
  ElasticSystem system;                     ///< consistent mass, f x f and 3n x 3n
  MeshElasticity elasticity;                ///< all tets
  Eigen::MatrixXd gravity_load;             ///< f x 3, force per unit acceleration along each axis [kg]
  std::optional<FittedFrame> frame;         ///< present for a free body
  std::vector<FullSpaceExamples> examples;  ///< the whole body's, if they are asked for, then the regions'
  /// In place of the targets of `examples`, one for each of them; or none.
  std::vector<std::shared_ptr<const TargetMethod>> target_methods;

  /// The same elements for FullSpaceStepper.
  runtime::FullModel matrix_free;

  Eigen::Index size() const { return elasticity.size(); }
};

struct FullSpaceOptions {
  bool whole_body = false;  ///< true to have its examples
  EnergyReference energy_reference = EnergyReference::kExample;
  struct Region {
    std::string name{};
    EnergyReference energy_reference = EnergyReference::kExample;
  };
  std::vector<Region> regions{};  ///< whose examples to have
  /// Displacements that hold all their targets, of the whole body, if it is asked for, then of the regions; or none:
  /// targets are sought among all poses that descriptors stand for.
  std::vector<PoseCoordinates> coordinates{};
};

/// From /object; /contact if it is there; with examples also /examples or /regions, /shape_space and /modal. Throws
/// InputError where a group is missing.
FullSpaceModel build_full_space_model(const ReducedModel& model, const FullSpaceOptions& options = {});

/// A State of the run time, of a body without a frame of its own: q, v and a [f] are displacement from rest [m],
/// velocity and acceleration of the free degrees of freedom, target [d] the coordinates of the last target.
using FullSpaceState = runtime::State;

/// At time 0 with the displacement and velocity [3n] of all vertices; those of fixed ones count for nothing.
FullSpaceState make_full_space_state(const FullSpaceModel& model, const Eigen::VectorXd& displacement,
                                     const Eigen::VectorXd& velocity);

/// The same for a free body that is deformed by u [3n] and moved by `motion`: x = c + R (X + u), X about the centre of
/// mass c at rest.
FullSpaceState make_full_space_state(const FullSpaceModel& model, const Eigen::VectorXd& deformation,
                                     const runtime::FrameMotion& motion);

/// [f] what displacements q [f] deform: of a free body in the frame that fits it, of a clamped one all.
Eigen::VectorXd deformation(const FullSpaceModel& model, const Eigen::VectorXd& q);

/// [n x 3] world positions [m] and velocities [m/s] of all vertices.
VertexArray world_positions(const FullSpaceModel& model, const FullSpaceState& state);
VertexArray world_velocities(const FullSpaceModel& model, const FullSpaceState& state);

}  // namespace exmat::precompute

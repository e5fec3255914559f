#pragma once

#include <algorithm>
#include <memory>
#include <optional>

#include "runtime/sim/contact/body_contact.h"
#include "runtime/sim/space/full/full_model.h"
#include "runtime/sim/step/body_step.h"
#include "runtime/sim/step/contact_problem.h"

namespace exmat::runtime {

/// Properties shared by the bodies of one kind. Model and scene outlive the world.
struct BodyKind {
  const Model* model = nullptr;                    ///< with contact, where there is a surface
  const StepScene* scene = nullptr;                ///< may change between steps
  std::shared_ptr<const TouchingSurface> surface;  ///< null: its bodies touch no other body and not themselves
  const FullModel* full = nullptr;                 ///< of bodies that may step in full space
};

/// A body of a World that may touch others or itself. Its state is another's.
struct WorldBody {
  WorldBody(const BodyKind& kind, State& its_state)
      : model(*kind.model),
        scene(*kind.scene),
        touching(kind.surface),
        surface(kind.surface->surface),
        state(its_state),
        workspace(model, scene, /*meets_bodies=*/true),
        shape(surface.make_shape()) {}

  const Model& model;
  const StepScene& scene;
  std::shared_ptr<const TouchingSurface> touching;
  const BodySurface& surface;
  State& state;
  Workspace workspace;
  SurfaceShape shape;
  StepReport report;
  bool anew = true;  ///< no step has led to where it is: what it overlaps was not watched coming

  // Of one step.
  std::optional<BodyStep> step;
  std::optional<ContactProblem> problem;
  Eigen::Vector3d start_velocity = Eigen::Vector3d::Zero();  ///< of the centre of mass, where the step begins [m/s]
  Placement placement;                                       ///< at the iterate
  Eigen::Index offset = 0;                                   ///< of its unknowns in those of its island

  ContactProblemWorkspace& near() noexcept { return *workspace.near; }
  const ContactProblemWorkspace& near() const noexcept { return *workspace.near; }
  const ContactSet& contact() const noexcept { return *model.contact; }
  int rigid() const noexcept { return static_cast<int>(model.frame->rigid_unknowns()); }
  Eigen::Index unknowns() const noexcept { return near().x.size(); }
  BodyPose pose() const noexcept { return {placement, near().q}; }  ///< at the iterate
  /// Bound on how far its vertices and its surface are from where they were at another pose [m].
  double way_bound(const Placement& from, const Eigen::VectorXd& from_q) const noexcept {
    return std::max(runtime::way_bound(contact().reach(), contact().tree().movement(), pose(), from, from_q),
                    runtime::way_bound(surface.reach(), surface.movement(), pose(), from, from_q));
  }
};

}  // namespace exmat::runtime

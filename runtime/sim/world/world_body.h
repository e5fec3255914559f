#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "runtime/sim/contact/body_contact.h"
#include "runtime/sim/step/body_step.h"
#include "runtime/sim/step/contact_problem.h"
#include "runtime/sim/world/full_member.h"

namespace exmat::runtime {

/// Properties shared by the bodies of one kind. Model and scene outlive the world.
struct BodyKind {
  const Model* model = nullptr;                    ///< with contact, where there is a surface
  const StepScene* scene = nullptr;                ///< may change between steps
  std::shared_ptr<const TouchingSurface> surface;  ///< null: its bodies touch no other body and not themselves
  const FullModel* full = nullptr;                 ///< null unless its bodies may step in full space
};

/// A body of a World that may touch others or itself. Its state is another's.
struct WorldBody {
  WorldBody(const BodyKind& kind, State& its_state)
      : model(*kind.model),
        touching(kind.surface),
        surface(kind.surface->surface),
        state(its_state),
        workspace(model, *kind.scene, /*meets_bodies=*/true),
        shape(surface.make_shape()),
        scene_(kind.scene) {}

  const Model& model;
  std::shared_ptr<const TouchingSurface> touching;
  const BodySurface& surface;
  State& state;
  Workspace workspace;
  SurfaceShape shape;
  StepReport report;
  double travel = 0;                 ///< most that a vertex goes in a step at its velocity [m]
  std::unique_ptr<FullMember> full;  ///< while it is in full space

  // State of one step.
  std::optional<BodyStep> step;  ///< not of one in full space, as the problem
  std::optional<ContactProblem> problem;
  Eigen::Vector3d start_velocity = Eigen::Vector3d::Zero();  ///< centre of mass at the start of the step [m/s]
  Placement placement;                                       ///< at the iterate
  Eigen::Index offset = 0;                                   ///< place of its unknowns in those of its island

  const StepScene& scene() const noexcept { return *scene_; }
  /// Later steps are of this scene, its own or that of the parts of a divided step.
  void take_scene(const StepScene& scene) {
    scene_ = &scene;
    if (full) full->fit(scene);
  }

  ContactProblemWorkspace& near() noexcept { return *workspace.near; }
  const ContactProblemWorkspace& near() const noexcept { return *workspace.near; }
  const ContactSet& contact() const noexcept { return *model.contact; }
  int rigid() const noexcept { return static_cast<int>(model.frame->rigid_unknowns()); }
  Eigen::Index unknowns() const noexcept { return full ? full->unknowns() : near().x.size(); }
  /// The body where a step begins.
  TouchingBody touching_body() const {
    if (full) return full->surface().touching();
    return {contact(),
            *touching,
            {model.frame->placement(state.frame), state.q},
            BodyVelocity{model.frame->velocity(state.frame), state.v}};
  }
  /// True if parts of it may touch each other in the step.
  bool may_meet_itself() const noexcept {
    return full ? touching->meets_itself() : touching->may_meet_itself(state.q, state.v, scene().time_step);
  }
  /// At the iterate, of a body in full space.
  FullSide full_side() const { return {*full, full->surface(), placement}; }
  /// Puts the surface where the state says, for searches.
  void place_surface() {
    if (full)
      full->place_surface();
    else
      surface.place(state.q, shape);
  }
  SurfaceShape& placed_shape() noexcept { return full ? full->surface().shape() : shape; }
  Energies energies() const noexcept { return full ? full->energies() : runtime::energies(model, scene(), state); }
  /// After a step: what it has is to be this share of it at most.
  void limit_kinetic_energy(double share) noexcept {
    if (!full)
      step->limit_kinetic_energy(share * model.frame->kinetic_energy(state.v, state.frame));
    else if (!full->is_driven())
      full->step().add_motion(std::sqrt(share), {});
  }
  /// After a step: every velocity becomes `share` of what it is and that of a rigid motion beside it.
  void add_motion(double share, const FrameVelocity& added) noexcept {
    full ? full->step().add_motion(share, added) : step->add_motion(share, added);
  }
  Eigen::Matrix3d inertia() const noexcept {
    return full ? full->inertia() : model.frame->inertia(workspace.frame, state.frame);
  }
  double kinetic_energy() const noexcept {
    return full ? full->energies().kinetic : model.frame->kinetic_energy(state.v, state.frame);
  }
  BodyPose pose() const noexcept { return {placement, near().q}; }  ///< at the iterate
  /// Bound on how far its vertices and its surface are from where they were at another pose [m].
  double way_bound(const Placement& from, const Eigen::VectorXd& from_q) const noexcept {
    return std::max(runtime::way_bound(contact().reach(), contact().tree().movement(), pose(), from, from_q),
                    runtime::way_bound(surface.reach(), surface.movement(), pose(), from, from_q));
  }

 private:
  const StepScene* scene_;
};

}  // namespace exmat::runtime

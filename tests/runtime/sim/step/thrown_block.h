#pragma once

#include <memory>

#include "runtime/sim/step/stepper.h"
#include "tests/support/surfaces.h"
#include "tests/support/synthetic_model.h"

namespace exmat::test {

/// A free block of 0.4 x 0.2 x 0.2 m, one corner at the origin, and one obstacle.
struct ThrownBlock {
  ThrownBlock(const runtime::Obstacle& obstacle, double time_step)
      : bar(make_bar({.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true})) {
    bar.model.contact = surface_contact(bar.model);
    model = runtime::build_model(bar.model, {}).model;
    scene.time_step = time_step;
    scene.gravity_force = gravity_force(*model, Eigen::Vector3d::Zero());
    scene.gravity_force.setZero();
    scene.obstacles.push_back(obstacle);
    state = make_state(*model);
    prepare_contacts(*model, 1, state);
  }

  void gravity(double size) { scene.gravity = Eigen::Vector3d(0, 0, -size); }
  void place(const runtime::FrameMotion& motion) { runtime::set_motion(*model, motion, state); }
  runtime::StepReport step(runtime::Workspace& workspace) { return runtime::step(*model, scene, state, workspace); }

  double mass() const { return bar.model.rigid->mass; }
  double energy() const { return energies(*model, scene, state).total(); }
  Eigen::Vector3d position() const { return runtime::free_state(state).position; }  ///< from where it is at rest
  Eigen::Vector3d centre() const { return model->frame->placement(state.frame).position; }
  Eigen::Vector3d velocity() const { return runtime::free_state(state).linear_momentum / mass(); }

  Bar bar;
  std::unique_ptr<const runtime::Model> model;
  runtime::StepScene scene;
  runtime::State state;
};

/// The surface of a box in triangles.
inline runtime::MeshShape mesh_of_box(const runtime::Box& box, int cells, double thickness = 0) {
  const Eigen::Vector3d size = 2 * box.half_extents;
  SurfaceMesh surface = box_surface({cells, cells, cells}, {size[0], size[1], size[2]});
  surface.vertices.rowwise() -= box.half_extents.transpose();
  return {std::make_shared<runtime::RigidMesh>(surface.vertices, surface.triangles, thickness), box.centre,
          box.rotation};
}

}  // namespace exmat::test

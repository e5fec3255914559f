#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <memory>
#include <vector>

#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/world/world.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime::test {

using namespace exmat::test;  // so that test:: is one

/// Free or clamped blocks of one model, in a world.
struct Blocks {
  explicit Blocks(double time_step, const exmat::test::BarOptions& options = free_block(), bool meets_itself = false)
      : bar(exmat::test::make_bar(options)) {
    bar.model.contact = exmat::test::surface_contact(bar.model);
    model = build_model(bar.model, {}).model;
    scene.time_step = time_step;
    scene.gravity_force = Eigen::VectorXd::Zero(model->modes());
    const ObjectData& object = *bar.model.object;
    surface = std::make_shared<TouchingSurface>(
        *model->contact,
        BodySurface::of_tets(object.mesh.tets, object.mesh.vertices, bar.basis(), model->frame->origin()),
        meets_itself);
  }

  static exmat::test::BarOptions free_block() {
    return {.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true};
  }

  void set_gravity(double acceleration) { scene.gravity = Eigen::Vector3d(0, 0, -acceleration); }
  void add_floor(double stiffness, double friction, double damping) {
    scene.obstacles.push_back(Obstacle{Plane{}, RigidMotion(), stiffness, damping, friction});
  }

  /// Moved from where it was meshed.
  WorldBodyStart body(const FrameMotion& motion) const {
    State state = make_state(*model);
    prepare_contacts(*model, scene.obstacles.size(), state);
    set_motion(*model, motion, state);
    return {{model.get(), &scene, surface}, std::move(state)};
  }
  WorldBodyStart body(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero(),
                      const Eigen::Vector3d& spin = Eigen::Vector3d::Zero(),
                      const Eigen::Quaterniond& turn = Eigen::Quaterniond::Identity()) const {
    return body(FrameMotion{position, turn, velocity, spin});
  }

  double mass() const { return bar.model.rigid->mass; }
  Eigen::Vector3d centre(const State& state) const {
    return bar.model.rigid->centre_of_mass + free_state(state).position;
  }

  exmat::test::Bar bar;
  std::unique_ptr<const Model> model;
  StepScene scene;
  std::shared_ptr<const TouchingSurface> surface;
};

/// Blocks that may step in all vertices.
struct FullBlocks : Blocks {
  FullBlocks(double time_step, const exmat::test::BarOptions& options, bool meets_itself = false)
      : Blocks(time_step, options, meets_itself) {
    full = std::move(build_full_model(bar.model, *model).model);
    full_scene = scene;
    full_scene.space.space = Space::kFull;
  }
  void put_in_full_space(WorldBodyStart& body) const {
    body.kind.scene = &full_scene;
    body.kind.full = full.get();
    prepare_full(*full, body.state);
  }
  std::unique_ptr<const FullModel> full;
  StepScene full_scene;
};

struct Momenta {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();
};

/// Momenta of all free bodies, angular about the origin.
inline Momenta momenta(const Blocks& blocks, const World& world) {
  Momenta sum;
  for (int i = 0; i < world.count(); ++i) {
    const FreeState& body = free_state(world.state(i));
    sum.linear += body.linear_momentum;
    sum.angular += body.angular_momentum + blocks.centre(world.state(i)).cross(body.linear_momentum);
  }
  return sum;
}

}  // namespace exmat::runtime::test

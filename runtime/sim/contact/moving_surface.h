#pragma once

#include <algorithm>

#include "runtime/sim/contact/body_contact.h"

namespace exmat::runtime {

/// The surface of a body that does not move by its modes, as searches for contacts take it: of one mode, the way that
/// its vertices go where a step begins, beside a rigid motion. Its vertices are numbered as those of the surfaces that
/// it is made of.
class MovingSurface {
 public:
  MovingSurface(const ContactSet& set, const TouchingSurface& touching);

  /// Places the body by a frame that goes with it, and for a vertex of the object `position(vertex)` [m] and
  /// `velocity(vertex)` [m/s], world.
  template <class Position, class Velocity>
  void place(const Placement& placement, const FrameVelocity& moves, const Position& position,
             const Velocity& velocity) {
    placement_ = placement;
    moves_ = moves;
    speed_ = 0;
    const auto fill = [&](const auto& object_vertex, VertexArray& positions, VertexArray& velocities) {
      for (int i = 0; i < positions.rows(); ++i) {
        const Eigen::Vector3d arm = position(object_vertex(i)) - placement.position, v = velocity(object_vertex(i));
        positions.row(i) = placement.rotation.transpose() * arm;
        velocities.row(i) = placement.rotation.transpose() * (v - moves.at(arm));
        speed_ = std::max(speed_, v.norm());
      }
    };
    fill([this](int i) { return set_.object_vertex(i); }, positions_, velocities_);
    set_.move(positions_, velocities_);
    fill([this](int i) { return touching_.surface.object_vertex(i); }, surface_positions_, surface_velocities_);
    touching_.surface.move(surface_positions_, surface_velocities_);
    touching_.surface.place(q_, shape_);
  }

  TouchingBody touching() const { return {set_, touching_, {placement_, q_}, {moves_, v_}}; }
  SurfaceShape& shape() noexcept { return shape_; }
  const BodySurface& surface() const noexcept { return touching_.surface; }
  int object_vertex(int vertex) const noexcept { return set_.object_vertex(vertex); }
  int object_corner(int triangle, int c) const noexcept {
    return surface().object_vertex(surface().corner(triangle, c));
  }
  /// A ball about it, world.
  DeformationTree::Ball bound() const noexcept {
    const DeformationTree::Ball ball = surface().bound(q_);
    return {placement_.position + placement_.rotation * ball.centre, ball.radius};
  }
  double speed() const noexcept { return speed_; }  ///< speed of its fastest vertex, world [m/s]

 private:
  Placement placement_;
  FrameVelocity moves_;
  double speed_ = 0;
  Eigen::VectorXd q_, v_;  // 0 and 1, of the mode
  ContactSet set_;
  TouchingSurface touching_;
  SurfaceShape shape_;
  VertexArray positions_, velocities_, surface_positions_, surface_velocities_;
};

}  // namespace exmat::runtime

#pragma once

#include "runtime/sim/contact/body_contact.h"

namespace exmat::runtime {

/// The surface of a body that does not move by its modes, as searches for contacts take it: of one mode, the way that
/// its vertices go where a step begins. Its vertices are numbered as those of the surfaces that it is made of.
class MovingSurface {
 public:
  MovingSurface(const ContactSet& set, const TouchingSurface& touching);

  /// Places the body by the frame that fits it, and for a vertex of the object `position(vertex)` [m] and
  /// `velocity(vertex)` [m/s], world.
  template <class Position, class Velocity>
  void place(const Placement& placement, const Position& position, const Velocity& velocity) {
    placement_ = placement;
    const auto fill = [&](const auto& object_vertex, VertexArray& positions, VertexArray& velocities) {
      for (int i = 0; i < positions.rows(); ++i) {
        positions.row(i) = placement.rotation.transpose() * (position(object_vertex(i)) - placement.position);
        velocities.row(i) = placement.rotation.transpose() * velocity(object_vertex(i));
      }
    };
    fill([this](int i) { return set_.object_vertex(i); }, positions_, velocities_);
    set_.move(positions_, velocities_);
    fill([this](int i) { return touching_.surface.object_vertex(i); }, surface_positions_, surface_velocities_);
    touching_.surface.move(surface_positions_, surface_velocities_);
    touching_.surface.place(q_, shape_);
  }

  TouchingBody touching() const { return {set_, touching_, {placement_, q_}, {{}, v_}}; }
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
  double speed() const noexcept { return surface().movement().norm; }  ///< speed of its fastest vertex, world [m/s]

 private:
  Placement placement_;
  Eigen::VectorXd q_, v_;  // 0 and 1, of the mode
  ContactSet set_;
  TouchingSurface touching_;
  SurfaceShape shape_;
  VertexArray positions_, velocities_, surface_positions_, surface_velocities_;
};

}  // namespace exmat::runtime

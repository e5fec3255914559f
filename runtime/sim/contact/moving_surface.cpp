#include "runtime/sim/contact/moving_surface.h"

namespace exmat::runtime {

MovingSurface::MovingSurface(const ContactSet& set, const TouchingSurface& touching)
    : q_(Eigen::VectorXd::Zero(1)),
      v_(Eigen::VectorXd::Ones(1)),
      set_(set),
      touching_(touching),
      positions_(VertexArray::Zero(set.vertices(), 3)),
      velocities_(positions_),
      surface_positions_(VertexArray::Zero(touching.surface.vertices(), 3)),
      surface_velocities_(surface_positions_) {
  touching_.drop_bounds();
  set_.move(positions_, velocities_);
  touching_.surface.move(surface_positions_, surface_velocities_);
  shape_ = touching_.surface.make_shape();
}

}  // namespace exmat::runtime

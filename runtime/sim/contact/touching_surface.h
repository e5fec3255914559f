#pragma once

#include <Eigen/Core>
#include <vector>

#include "runtime/sim/contact/body_surface.h"
#include "runtime/sim/contact/contact.h"

namespace exmat::runtime {

/// The surface of a body that touches others, and how its vertices look.
struct TouchingSurface {
  TouchingSurface(const ContactSet& set, BodySurface of, bool meets_itself = false);

  /// Drops the bounds: for a surface that moves in other ways than by modes, about which they say nothing.
  void drop_bounds();

  bool meets_itself() const noexcept { return !places.empty(); }

  /// True if parts of it may have come near to each other at q [r], moving at v [r/s], within a step of `time_step`
  /// [s]. O(r); never, where it does not meet itself.
  bool may_meet_itself(const Eigen::VectorXd& q, const Eigen::VectorXd& v, double time_step) const noexcept;

  /// The same of a vertex of the set at q, and for as long as q moves no vertex by more than `way` [m]; always, without
  /// bounds.
  bool may_meet_itself(int vertex, const ContactSet& set, const Eigen::VectorXd& q, double way = 0) const noexcept;

  BodySurface surface;
  VertexArray normals;  ///< normals of the vertices of the set at rest, unit, outward

  // Empty where it does not meet itself.
  std::vector<SurfaceHit> places;  ///< places of the vertices of the set on the surface
  // Empty without bounds, too.
  RowMatrix vertex_bounds;          ///< [vertices x r] BodySurface::approach_bounds() of them
  Eigen::VectorXd approach_bounds;  ///< [r] the largest of each mode
};

}  // namespace exmat::runtime

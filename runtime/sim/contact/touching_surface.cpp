#include "runtime/sim/contact/touching_surface.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace exmat::runtime {

TouchingSurface::TouchingSurface(const ContactSet& set, BodySurface of, bool meets_itself)
    : surface(std::move(of)), normals(set.vertices(), 3) {
  SurfaceShape shape = surface.make_shape();
  surface.place(Eigen::VectorXd::Zero(surface.modes()), shape);
  for (int i = 0; i < normals.rows(); ++i) {
    const auto hit = surface.nearest(set.rest(i), std::numeric_limits<double>::infinity(), shape);
    normals.row(i) = hit ? hit->normal : Eigen::Vector3d::Zero();
    if (meets_itself) places.push_back(hit.value_or(SurfaceHit()));
  }
  if (!meets_itself) return;
  RowMatrix basis(3 * set.vertices(), set.modes());
  for (int i = 0; i < set.vertices(); ++i) basis.middleRows<3>(3 * i) = set.basis_rows(i);
  vertex_bounds = surface.approach_bounds(set.rest(), basis);
  approach_bounds = vertex_bounds.colwise().maxCoeff();
}

void TouchingSurface::drop_bounds() {
  vertex_bounds.resize(0, 0);
  approach_bounds.resize(0);
}

bool TouchingSurface::may_meet_itself(const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                                      double time_step) const noexcept {
  if (approach_bounds.size() == 0) return false;
  return approach_bounds.dot(q.cwiseAbs() + kContactMarginSteps * time_step * v.cwiseAbs()) >= 1;
}

bool TouchingSurface::may_meet_itself(int vertex, const ContactSet& set, const Eigen::VectorXd& q,
                                      double way) const noexcept {
  if (vertex_bounds.size() == 0) return true;
  const auto bounds = vertex_bounds.row(vertex);
  const double now = bounds.dot(q.cwiseAbs());
  if (now >= 1 || way == 0) return now >= 1;
  return now + std::max(set.tree().movement().most(bounds, way), surface.movement().most(bounds, way)) >= 1;
}

}  // namespace exmat::runtime

#include "runtime/sim/contact/touching_surface.h"

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

bool TouchingSurface::may_meet_itself(const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                                      double time_step) const noexcept {
  if (approach_bounds.size() == 0) return false;
  return approach_bounds.dot(q.cwiseAbs() + kContactMarginSteps * time_step * v.cwiseAbs()) >= 1;
}

}  // namespace exmat::runtime

#include "runtime/sim/space/full/carried_part.h"

namespace exmat::runtime {

CarriedPart::CarriedPart(const FullSpace& space, const VertexArray& rest) {
  for (Eigen::Index place = 0; place < space.vertices(); ++place) number_at_.push_back(space.number_at(place));
  rest_.setZero(4, space.places());
  for (Eigen::Index v = 0; v < rest.rows(); ++v) rest_.col(space.place(v)).head<3>() = rest.row(v);
  const Eigen::VectorXd masses = space.masses().tail(space.driven());
  fixed_mass_ = masses.sum();
  fixed_centre_ = rest_.topRows<3>().rightCols(space.driven()) * masses / fixed_mass_;
}

void CarriedPart::place_fixed(const MotionSample& frame, Eigen::VectorXd& u) const noexcept {
  for (Eigen::Index place = std::ssize(number_at_); place < rest_.cols(); ++place)
    u.segment<3>(4 * place) = displacement(frame, place);
}

void CarriedPart::own_velocity(const MotionSample& frame, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                               Eigen::VectorXd& own) const noexcept {
  own.setZero();
  for (Eigen::Index place = 0; place < std::ssize(number_at_); ++place) {
    const Eigen::Index at = 3 * static_cast<Eigen::Index>(number_at_[static_cast<std::size_t>(place)]);
    const Eigen::Vector3d here = rest_.col(place).head<3>() + q.segment<3>(at);
    own.segment<3>(4 * place) = frame.rotation.transpose() * (v.segment<3>(at) - frame.velocity_at(here));
  }
}

void CarriedPart::carry(const MotionSample& from, const MotionSample& to, const Eigen::VectorXd& u,
                        Eigen::VectorXd& d) const noexcept {
  for (Eigen::Index place = 0; place < rest_.cols(); ++place) {
    const Eigen::Vector3d here = rest_.col(place).head<3>() + u.segment<3>(4 * place);
    const Eigen::Vector3d own = from.to_frame(here) + d.segment<3>(4 * place);
    d.segment<3>(4 * place) = to.to_world(own) - here;
  }
}

void CarriedPart::frame_velocity(const MotionSample& frame, const double* u, double factor,
                                 Eigen::VectorXd& v) const noexcept {
  for (Eigen::Index place = 0; place < rest_.cols(); ++place) {
    const Eigen::Vector3d here = rest_.col(place).head<3>() + Eigen::Map<const Eigen::Vector3d>(u + 4 * place);
    v.segment<3>(4 * place) = factor * frame.velocity_at(here);
  }
}

double CarriedPart::fixed_potential(const MotionSample& frame, const Eigen::Vector3d& gravity) const noexcept {
  return -fixed_mass_ * gravity.dot(frame.to_world(fixed_centre_) - fixed_centre_);
}

}  // namespace exmat::runtime

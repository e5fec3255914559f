#include "runtime/sim/lanes/lane_rotation.h"

#include <Eigen/LU>

namespace exmat::runtime {

LaneRotation::LaneRotation(const DeformingInertia& inertia)
    : inertia_(&inertia),
      inverse_inertia_(9 * kLanes),
      products_(9 * inertia.modes() * kLanes),
      centre_products_(3 * inertia.modes() * kLanes),
      factors_(12 * inertia.modes() * kLanes),
      scratch_(3 * inertia.modes() * kLanes) {
  momentum_.setZero();
  offset_.setZero();
  spin_.setZero();
  rotation_.setZero();
  factor_.setZero();
}

void LaneRotation::set_problem(Eigen::Index lane, const FreeMotionWorkspace& body) noexcept {
  momentum_.row(lane) = body.problem.momentum;
  offset_.row(lane) = body.problem.offset;
  factor_[lane] = body.problem.factor;
  spin_.row(lane) = body.solution.spin;
}

void LaneRotation::begin(const LaneNumbers& velocity_factor, const LaneVectors& velocity_centre) noexcept {
  velocity_factor_ = velocity_factor;
  velocity_centre_ = velocity_centre.data();
  kernels().lanes_begin_rotation(arrays());
}

void LaneRotation::begin_given(Eigen::Index lane) noexcept {
  for (Eigen::Index i = lane; i < factors_.size(); i += kLanes) factors_[i] = 0;
}

void LaneRotation::give(Eigen::Index lane, const FreeMotionWorkspace& body) noexcept {
  spin_.row(lane) = body.solution.spin;
  rotation_.row(lane) = body.solution.rotation;
}

LaneNumbers LaneRotation::update(const LaneNumbers& active, const LaneVectors& q, LaneVectors& force) noexcept {
  LaneNumbers found;
  kernels().lanes_rotate(arrays(), active.data(), q.data(), force.data(), found.data());
  return found;
}

void LaneRotation::add_stiffness(const LaneNumbers& chosen, AlignedArray& hessian) noexcept {
  LaneNumbers softening;
  for (Eigen::Index lane = 0; lane < kLanes; ++lane)
    softening[lane] = DeformingInertia::softens(spin_.row(lane).matrix(), velocity_factor_[lane]) ? 1 : 0;
  if ((chosen == 0).all() && (softening == 0).all()) return;
  kernels().lanes_rotation_stiffness(arrays(), chosen.data(), softening.data(), hessian.data());
}

LaneNumbers LaneRotation::gyroscopic_ratio() const noexcept {
  return 2 * spin_.square().rowwise().sum().sqrt() / velocity_factor_;
}

void LaneRotation::gyroscopic_product(const LaneVectors& x, LaneVectors& product) noexcept {
  kernels().lanes_gyroscopic_product(arrays(), x.data(), scratch_.data(), product.data());
}

void LaneRotation::take(Eigen::Index lane, FreeMotionWorkspace& body) const noexcept {
  body.solution = {spin_.row(lane).matrix(), rotation_.row(lane).matrix(), true};
  const Eigen::Index modes = inertia_->modes();
  const double* own = products_.data() + 6 * modes * kLanes + lane;
  for (Eigen::Index i = 0; i < 3 * modes; ++i) body.moments.deformation().data()[i] = -own[i * kLanes];
}

Eigen::Matrix3d LaneRotation::inertia(Eigen::Index lane) const noexcept {
  using Numbers = Eigen::Map<const Eigen::Matrix3d, Eigen::Unaligned, Eigen::Stride<3 * kLanes, kLanes>>;
  return Numbers(inverse_inertia_.data() + lane).inverse();
}

LaneRotationArrays LaneRotation::arrays() noexcept {
  LaneRotationArrays arrays = inertia_->lane_arrays();
  arrays.velocity_factor = velocity_factor_.data();
  arrays.velocity_centre = velocity_centre_;
  arrays.momentum = momentum_.data();
  arrays.offset = offset_.data();
  arrays.factor = factor_.data();
  arrays.spin = spin_.data();
  arrays.rotation = rotation_.data();
  arrays.inverse_inertia = inverse_inertia_.data();
  arrays.products = products_.data();
  arrays.centre_products = centre_products_.data();
  arrays.factors = factors_.data();
  return arrays;
}

}  // namespace exmat::runtime

#include "runtime/sim/frame/body_frame.h"

#include <cmath>

#include "runtime/sim/frame/carried_frame.h"
#include "runtime/sim/frame/free_frame.h"

namespace exmat::runtime {

void BodyFrame::begin(const FrameStep& step, FrameWorkspace& /*workspace*/,
                      Eigen::VectorXd& external_force) const noexcept {
  external_force = step.applied_force;
  external_force += step.loads.gravity_force;
  for (const ScriptedForce& force : step.loads.forces)
    if (force.acts_at(step.midpoint())) external_force += force.force;
}

Eigen::Vector3d BodyFrame::limit_kinetic_energy(double allowed, const Eigen::Vector3d& /*impulse*/,
                                                FrameWorkspace& /*workspace*/, Eigen::VectorXd& v,
                                                FrameState& state) const noexcept {
  v *= std::sqrt(allowed / kinetic_energy(v, state));
  return Eigen::Vector3d::Zero();
}

std::vector<double> BodyFrame::numbers(const FrameState& state) const {
  std::vector<double> numbers(write_numbers(state, nullptr));
  write_numbers(state, numbers.data());
  return numbers;
}

std::shared_ptr<const BodyFrame> make_frame(const RigidData* rigid, bool carried, const RowMatrix& gravity_load) {
  if (rigid == nullptr) return std::make_shared<ClampedFrame>();
  if (carried) return std::make_shared<CarriedFrame>(*rigid, gravity_load);
  return std::make_shared<FreeFrame>(*rigid);
}

}  // namespace exmat::runtime

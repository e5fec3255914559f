#include "runtime/sim/frame/carried_frame.h"

#include "runtime/sim/frame/frame_numbers.h"

namespace exmat::runtime {
namespace {

const MotionSample& sample_of(const FrameState& state) { return std::get_if<CarriedState>(&state)->frame; }
CarriedWorkspace& own(FrameWorkspace& workspace) { return *std::get_if<CarriedWorkspace>(&workspace); }
const CarriedWorkspace& own(const FrameWorkspace& workspace) { return *std::get_if<CarriedWorkspace>(&workspace); }

Placement placement_of(const MotionSample& sample) {
  return {Eigen::Vector3d::Zero(), sample.position, sample.rotation};
}

template <typename State, typename Visitor>
void visit(State& state, Visitor& visitor) {
  auto& frame = state.frame;
  visitor(frame.position, frame.rotation, frame.linear_velocity, frame.angular_velocity, frame.linear_acceleration,
          frame.angular_acceleration, state.kinetic_energy, state.potential_of_frame);
}

}  // namespace

void CarriedFrame::follow(const WorldLoads& loads, double time, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                          FrameWorkspace& workspace, FrameState& state) const noexcept {
  CarriedWorkspace& carried = own(workspace);
  set_frame(loads.carrier->sample(time), carried);
  carried.velocity = v;
  carried_force(inertia_, q, carried);
  state = carried_state(inertia_, gravity_load_, loads.gravity, q, v, carried);
}

Placement CarriedFrame::placement(const FrameState& state) const noexcept { return placement_of(sample_of(state)); }

FrameVelocity CarriedFrame::velocity(const FrameState& state) const noexcept {
  return {sample_of(state).linear_velocity, sample_of(state).angular_velocity};
}

FrameMotion CarriedFrame::motion(const FrameState& state) const noexcept {
  const MotionSample& frame = sample_of(state);
  return {frame.position, Eigen::Quaterniond(frame.rotation), frame.linear_velocity, frame.angular_velocity};
}

double CarriedFrame::turn_rate(const FrameState& state) const noexcept {
  return sample_of(state).angular_velocity.norm();
}

double CarriedFrame::kinetic_energy(const Eigen::VectorXd& /*v*/, const FrameState& state) const noexcept {
  return std::get_if<CarriedState>(&state)->kinetic_energy;
}

double CarriedFrame::potential_energy(const Eigen::Vector3d& /*gravity*/, const FrameState& state) const noexcept {
  return std::get_if<CarriedState>(&state)->potential_of_frame;
}

std::size_t CarriedFrame::write_numbers(const FrameState& state, double* to) const noexcept {
  NumberCounter counter;
  visit(*std::get_if<CarriedState>(&state), counter);
  if (to == nullptr) return counter.count;
  NumberWriter writer{to};
  visit(*std::get_if<CarriedState>(&state), writer);
  return counter.count;
}

void CarriedFrame::set_numbers(std::span<const double> numbers, FrameState& state) const noexcept {
  NumberReader reader{numbers};
  visit(*std::get_if<CarriedState>(&state), reader);
}

/// The motion at `sample`, and the external forces there.
void CarriedFrame::take(const FrameStep& step, const MotionSample& sample, FrameWorkspace& workspace,
                        Eigen::VectorXd& external_force) const noexcept {
  CarriedWorkspace& carried = own(workspace);
  set_frame(sample, carried);
  external_force = step.applied_force;
  add_carried_load(inertia_, gravity_load_, step.loads.gravity, carried, external_force);
  for (const ScriptedForce& force : step.loads.forces)
    if (force.acts_at(step.midpoint()))
      external_force.noalias() += force.mean_basis.transpose() * (sample.rotation.transpose() * force.total);
}

void CarriedFrame::begin(const FrameStep& step, FrameWorkspace& workspace,
                         Eigen::VectorXd& external_force) const noexcept {
  take(step, step.loads.carrier->sample(step.end, -kBesideKey * step.time_step), workspace, external_force);
}

FrameVelocity CarriedFrame::expected_velocity(const FrameState& /*state*/,
                                              const FrameWorkspace& workspace) const noexcept {
  return {own(workspace).frame.linear_velocity, own(workspace).frame.angular_velocity};
}

bool CarriedFrame::jumps(const WorldLoads& loads, double from, double to) const noexcept {
  return loads.carrier->has_key(from, to);
}

void CarriedFrame::enter_start(const FrameStep& step, FrameWorkspace& workspace,
                               Eigen::VectorXd& external_force) const noexcept {
  take(step, step.loads.carrier->sample(step.start, kBesideKey * step.time_step), workspace, external_force);
}

void CarriedFrame::add_start_force(const FrameStep& step, const FrameState& /*state*/, FrameWorkspace& workspace,
                                   Eigen::VectorXd& force) const noexcept {
  own(workspace).velocity = step.v;
  carried_force(inertia_, step.q, own(workspace));
  force += own(workspace).force;
}

void CarriedFrame::leave_start(const FrameStep& step, FrameWorkspace& workspace,
                               Eigen::VectorXd& external_force) const noexcept {
  begin(step, workspace, external_force);
}

bool CarriedFrame::update_force(const Eigen::VectorXd& q, double velocity_factor,
                                const Eigen::VectorXd& velocity_centre, FrameWorkspace& workspace) const noexcept {
  own(workspace).velocity = velocity_factor * (q - velocity_centre);
  carried_force(inertia_, q, own(workspace));
  return true;
}

const Eigen::VectorXd* CarriedFrame::force(const FrameWorkspace& workspace) const noexcept {
  return &own(workspace).force;
}

void CarriedFrame::add_stiffness(double velocity_factor, FrameWorkspace& workspace,
                                 Eigen::MatrixXd& hessian) const noexcept {
  inertia_.moments.add_softening(own(workspace).spin, velocity_factor, hessian);
}

double CarriedFrame::gyroscopic_ratio(double velocity_factor, const FrameWorkspace& workspace) const noexcept {
  const CarriedWorkspace& carried = own(workspace);
  return (2 * carried.spin.norm() + carried.spin_rate.norm() / velocity_factor) / velocity_factor;
}

const Eigen::MatrixXd* CarriedFrame::gyroscopic(double velocity_factor, FrameWorkspace& workspace) const noexcept {
  set_gyroscopic(inertia_, velocity_factor, own(workspace));
  return &own(workspace).gyroscopic;
}

const Eigen::VectorXd* CarriedFrame::gyroscopic_product(double velocity_factor, const Eigen::VectorXd& x,
                                                        FrameWorkspace& workspace) const noexcept {
  runtime::gyroscopic_product(inertia_, velocity_factor, x, own(workspace));
  return &own(workspace).product;
}

void CarriedFrame::commit(const WorldLoads& loads, double /*rate*/, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                          Eigen::VectorXd& /*a*/, FrameWorkspace& workspace, FrameState& state) const noexcept {
  state = carried_state(inertia_, gravity_load_, loads.gravity, q, v, own(workspace));
}

Placement CarriedFrame::place(const Eigen::VectorXd& /*x*/, FrameWorkspace& workspace) const noexcept {
  return placement_of(own(workspace).frame);
}

}  // namespace exmat::runtime

#include "runtime/sim/step/state.h"

namespace exmat::runtime {

namespace {

constexpr Eigen::VectorXd SkeletonMotion::*kSkeletonArrays[] = {
    &SkeletonMotion::own, &SkeletonMotion::own_previous, &SkeletonMotion::way_previous, &SkeletonMotion::q,
    &SkeletonMotion::v,   &SkeletonMotion::q_previous,   &SkeletonMotion::v_previous,   &SkeletonMotion::weights};

// Calls use(number) of all that is no flag, in a fixed order.
template <typename Bones, typename Use>
void for_numbers(Bones& motion, const Use& use) {
  for (auto* poses : {&motion.bones, &motion.next})
    for (auto& pose : *poses) {
      for (int axis = 0; axis < 3; ++axis) use(pose.joint[axis]);
      for (int k = 0; k < 4; ++k) use(pose.turn.coeffs()[k]);
    }
  for (const auto member : kSkeletonArrays)
    for (Eigen::Index i = 0; i < (motion.*member).size(); ++i) use((motion.*member)[i]);
}

}  // namespace

std::size_t write_numbers(const SkeletonMotion& motion, double* to) noexcept {
  std::size_t count = 0;
  const auto write = [&](double number) {
    if (to != nullptr) to[count] = number;
    ++count;
  };
  write(motion.anew ? 1.0 : 0.0);
  write(motion.bound ? 1.0 : 0.0);
  for_numbers(motion, write);
  return count;
}

Eigen::VectorXd numbers_of(const SkeletonMotion& motion) {
  Eigen::VectorXd numbers(static_cast<Eigen::Index>(write_numbers(motion, nullptr)));
  write_numbers(motion, numbers.data());
  return numbers;
}

void set_numbers(std::span<const double> numbers, SkeletonMotion& motion) noexcept {
  motion.anew = numbers[0] != 0;
  motion.bound = numbers[1] != 0;
  std::size_t at = 2;
  for_numbers(motion, [&](double& number) { number = numbers[at++]; });
}

State make_state(const Model& model) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.modes());
  return make_state(model, zero, zero);
}

State make_state(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  State state;
  state.q = state.q_previous = q;
  state.v = state.v_previous = v;
  state.a = Eigen::VectorXd::Zero(model.modes());
  state.applied_force = Eigen::VectorXd::Zero(model.modes());
  auto scratch = model.internal_force.make_workspace();
  state.elastic_energy = model.internal_force.energy(q, scratch);
  state.frame = model.frame->make_state();
  set_motion(model, {}, state);
  for (const ExampleModel& examples : model.examples) {
    ExampleState& start = state.examples.emplace_back();
    start.weights = Eigen::VectorXd::Unit(examples.weights.examples(), 0);
    if (examples.target) start.target = Eigen::VectorXd::Zero(examples.target->dimension());
  }
  return state;
}

void prepare_contacts(const Model& model, std::size_t obstacles, State& state) {
  if (!model.contact) return;
  const ContactSet& set = *model.contact;
  state.contacts.held.resize(obstacles * static_cast<std::size_t>(set.vertices()));
  state.contacts.near_planes = NearPlanes(set.vertices(), set.modes(), obstacles);
}

bool set_motion(const Model& model, const FrameMotion& motion, State& state) {
  FrameWorkspace workspace = model.frame->make_workspace();
  return model.frame->set_motion(motion, state.q, state.v, workspace, state.frame);
}

}  // namespace exmat::runtime

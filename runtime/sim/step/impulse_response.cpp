#include "runtime/sim/step/impulse_response.h"

#include "runtime/sim/frame/spin.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/sleep.h"

namespace exmat::runtime {

ImpulseResponse::ImpulseResponse(const Model& model, const StepScene& scene, const State& state)
    : model_(model),
      scene_(scene),
      state_(state),
      rigid_(model.frame->rigid_unknowns()),
      mass_(Eigen::MatrixXd::Zero(rigid_, rigid_ + model.modes())),
      springs_(Eigen::MatrixXd::Zero(mass_.cols(), mass_.cols())),
      A_(springs_),
      stiffness_(Eigen::MatrixXd::Zero(model.modes(), model.modes())),
      factor_(mass_.cols()),
      zero_(Eigen::VectorXd::Zero(mass_.cols())),
      elasticity_(model.internal_force.make_workspace()) {
  if (rigid_ > 0) moments_ = model.frame->inertia_of_momenta()->make_moments();
  for (std::size_t i = 0; i < scene.examples.size(); ++i) examples_.emplace_back(model.examples[i]);
  update(scene.time_step);
}

void ImpulseResponse::update(double duration, Tangent tangent) {
  const BodyPose pose = pose_of(model_, state_);
  const Eigen::Index modes = model_.modes();
  const double h = duration;
  placement_ = pose;
  frame_velocity_ = model_.frame->velocity(state_.frame);
  Eigen::MatrixXd& K = springs_;
  K.setZero();
  add_spring_stiffness(state_.attachments, {1 / h, h}, pose, K);
  if (rigid_ > 0) {  // from world axes
    const Eigen::Matrix3d& R = pose.rotation;
    K.block<3, 3>(3, 0) = (R.transpose() * K.block<3, 3>(3, 0)).eval();
    const Eigen::Matrix3d turn = K.block<3, 3>(3, 3).selfadjointView<Eigen::Lower>();
    K.block<3, 3>(3, 3) = R.transpose() * turn * R;
    for (Eigen::Index i = 6; i < K.rows(); ++i) K.block<1, 3>(i, 3) = (K.block<1, 3>(i, 3) * R).eval();
  }
  A_ = h * h * K;
  stiffness_.setZero();
  model_.internal_force.stiffness(state_.q, tangent, elasticity_, stiffness_);
  auto own = A_.bottomRightCorner(modes, modes);
  own.triangularView<Eigen::Lower>() += h * (h + scene_.stiffness_damping) * stiffness_;
  own.diagonal().array() += 1 + h * scene_.mass_damping;
  add_example_stiffness(h, tangent, own);
  if (rigid_ > 0) {
    const DeformingInertia& inertia = *model_.frame->inertia_of_momenta();
    inertia.moments(state_.q, moments_);
    mass_.topLeftCorner<3, 3>() = inertia.mass() * Eigen::Matrix3d::Identity();
    mass_.block<3, 3>(3, 3) = moments_.inertia;
    mass_.bottomRightCorner(3, modes) = moments_.deformation().transpose();
    A_.topLeftCorner(6, 6) += mass_.leftCols(6);
    A_.bottomLeftCorner(modes, 6) += mass_.rightCols(modes).transpose();
  }
  factor_.compute(A_);
  Eigen::Index conditions = 0;
  for (const Attachment& attachment : state_.attachments) conditions += attachment.conditions();
  if (held_.conditions() != conditions || held_.forces.cols() != std::ssize(state_.attachments)) {
    held_ = AttachmentWorkspace(state_.attachments, modes, unknowns());
    multipliers_ = held_.multipliers;
  }
  if (conditions == 0) return;
  set_conditions(state_.attachments, *model_.frame, zero_, pose, held_);
  held_.directions() = held_.gradients();
  factor_.solveInPlace(held_.directions());
  held_.factorise();
}

/// Stiffness and damping of the example forces, to the lower triangle of A; the stiffness also to that of K.
void ImpulseResponse::add_example_stiffness(double h, Tangent tangent, Eigen::Ref<Eigen::MatrixXd> A) noexcept {
  for (std::size_t i = 0; i < scene_.examples.size(); ++i) {
    const ExampleSettings& settings = scene_.examples[i];
    if (is_filtered(settings)) {
      const auto& filter = model_.examples[i].filter;
      A += h * (h * linear_stiffness(settings) + settings.damping) * filter;
      stiffness_ += linear_stiffness(settings) * filter;
    }
    if (elastic_factor(settings) == 0) continue;
    StepReport report;
    examples_[i].weights = state_.examples[i].weights;
    find_target(model_.examples[i], settings, state_.examples[i], examples_[i], report);
    A.triangularView<Eigen::Lower>() -= h * h * stiffness_;
    model_.examples[i].elasticity->add_stiffness(state_.q, tangent, *examples_[i].elasticity, stiffness_);
    A.triangularView<Eigen::Lower>() += h * h * stiffness_;
  }
}

void ImpulseResponse::example_force(std::size_t i, const Eigen::VectorXd& weights, Eigen::VectorXd& force) noexcept {
  const ExampleModel& model = model_.examples[i];
  const ExampleSettings& settings = scene_.examples[i];
  StepReport report;
  examples_[i].weights = weights;
  find_target(model, settings, state_.examples[i], examples_[i], report);
  force.setZero();
  if (elastic_factor(settings) > 0) {
    model.elasticity->add_force(state_.q, *examples_[i].elasticity, force);
    force = -force;
  } else {
    force = linear_stiffness(settings) * examples_[i].target;
  }
}

Eigen::Vector3d ImpulseResponse::place(const MaterialPoints& points, Eigen::Index i) const noexcept {
  return place_of(points, i, placement_, state_.q);
}

void ImpulseResponse::set_jacobian(const MaterialPoints& points, Eigen::MatrixXd& J) const noexcept {
  const Eigen::Index modes = state_.q.size();
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i) {
    if (rigid_ > 0) {
      J.block<3, 3>(3 * i, 0).setIdentity();
      J.block<3, 3>(3 * i, 3) = -cross_matrix(place(points, i) - placement_.position) * placement_.rotation;
    }
    J.block(3 * i, rigid_, 3, modes) = placement_.rotation.lazyProduct(points.basis_rows.middleRows<3>(3 * i));
  }
}

Eigen::MatrixXd ImpulseResponse::jacobian(const MaterialPoints& points) const {
  Eigen::MatrixXd J(3 * points.rest.rows(), unknowns());
  set_jacobian(points, J);
  return J;
}

void ImpulseResponse::solve_in_place(Eigen::MatrixXd& forces) noexcept {
  factor_.solveInPlace(forces);
  if (held_.conditions() == 0) return;
  for (Eigen::Index k = 0; k < forces.cols(); ++k) {
    multipliers_.noalias() = held_.gradients().transpose() * forces.col(k);
    held_.change.noalias() = held_.factor.solve(multipliers_);
    forces.col(k).noalias() -= held_.directions() * held_.change;
  }
}

Eigen::MatrixXd ImpulseResponse::solve(const Eigen::MatrixXd& forces) const {
  Eigen::MatrixXd x = factor_.solve(forces);
  if (held_.conditions() > 0) x -= held_.directions() * (held_.factor.solve(held_.gradients().transpose() * x));
  return x;
}

void ImpulseResponse::set_velocity(Eigen::VectorXd& v) const noexcept {
  if (rigid_ > 0) {
    v.head<3>() = frame_velocity_.linear;
    v.segment<3>(3) = placement_.rotation.transpose() * frame_velocity_.angular;
  }
  v.tail(state_.v.size()) = state_.v;
}

Eigen::VectorXd ImpulseResponse::velocity(const MaterialPoints& points) const {
  Eigen::VectorXd velocity(3 * points.rest.rows());
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i)
    velocity.segment<3>(3 * i) = frame_velocity_.at(place(points, i) - placement_.position) +
                                 placement_.rotation * (points.basis_rows.middleRows<3>(3 * i) * state_.v);
  return velocity;
}

void ImpulseResponse::apply(const MaterialPoints& points, const Eigen::VectorXd& impulses, Workspace& workspace,
                            State& state) const {
  const double dt = scene_.time_step;
  const Eigen::VectorXd x = solve(jacobian(points).transpose() * impulses);
  state.q += dt * x.tail(state.v.size());
  state.v += x.tail(state.v.size());
  state.elastic_energy = model_.internal_force.energy(state.q, workspace.elasticity);
  if (rigid_ == 0) {
    model_.frame->follow(scene_, state.time, state.q, state.v, workspace.frame, state.frame);
  } else {
    FrameMotion motion = model_.frame->motion(state.frame);
    FrameMomenta momenta = *model_.frame->momenta(state.frame);
    momenta.linear += mass_.topRows<3>() * x;
    momenta.angular += motion.orientation * Eigen::Vector3d(mass_.bottomRows<3>() * x);
    motion.position += dt * x.head<3>();
    motion.orientation = motion.orientation * quaternion_of(dt * x.segment<3>(3));
    model_.frame->adopt(motion, momenta, state.q, state.v, workspace.frame, state.frame);
  }
  wake(state);
  state.begins_anew = true;
}

}  // namespace exmat::runtime

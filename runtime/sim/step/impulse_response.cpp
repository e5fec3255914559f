#include "runtime/sim/step/impulse_response.h"

#include "runtime/sim/frame/spin.h"
#include "runtime/sim/step/sleep.h"

namespace exmat::runtime {

ImpulseResponse::ImpulseResponse(const Model& model, const StepScene& scene, const State& state)
    : model_(model),
      scene_(scene),
      pose_(pose_of(model, state)),
      frame_velocity_(model.frame->velocity(state.frame)),
      v_(state.v),
      rigid_(model.frame->rigid_unknowns()),
      held_(state.attachments, model.modes(), rigid_ + model.modes()) {
  const double dt = scene.time_step;
  const Eigen::Index modes = model.modes(), size = rigid_ + modes;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(size, size);
  add_spring_stiffness(state.attachments, {1 / dt, dt}, pose_, K);
  if (rigid_ > 0) {  // from world axes
    K.block(3, 0, 3, 3) = pose_.rotation.transpose() * K.block(3, 0, 3, 3);
    K.block(3, 3, 3, 3) = pose_.rotation.transpose() *
                          K.block<3, 3>(3, 3).selfadjointView<Eigen::Lower>().toDenseMatrix() * pose_.rotation;
    K.block(6, 3, modes, 3) = K.block(6, 3, modes, 3) * pose_.rotation;
  }
  Eigen::MatrixXd A = dt * dt * K;
  InternalForce::Workspace scratch = model.internal_force.make_workspace();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(modes, modes);
  model.internal_force.stiffness(state.q, Tangent::kPositiveSemidefinite, scratch, stiffness);
  auto own = A.bottomRightCorner(modes, modes);
  own.triangularView<Eigen::Lower>() += dt * (dt + scene.stiffness_damping) * stiffness;
  own.diagonal().array() += 1 + dt * scene.mass_damping;
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (is_filtered(scene.examples[i]))
      own += dt * (dt * linear_stiffness(scene.examples[i]) + scene.examples[i].damping) *
             model.examples[i].filter.symmetric_part();
  mass_.setZero(rigid_, size);
  if (rigid_ > 0) {
    const DeformingInertia& inertia = *model.frame->inertia_of_momenta();
    DeformingInertia::Moments moments = inertia.make_moments();
    inertia.moments(state.q, moments);
    mass_.topLeftCorner<3, 3>() = inertia.mass() * Eigen::Matrix3d::Identity();
    mass_.block<3, 3>(3, 3) = moments.inertia;
    mass_.bottomRightCorner(3, modes) = moments.deformation().transpose();
    A.topLeftCorner(6, 6) += mass_.leftCols(6);
    A.bottomLeftCorner(modes, 6) += mass_.rightCols(modes).transpose();
  }
  factor_.compute(A);
  if (held_.conditions() == 0) return;
  set_conditions(state.attachments, *model.frame, Eigen::VectorXd::Zero(size), pose_, held_);
  held_.directions = factor_.solve(held_.gradients);
  held_.invert();
}

Eigen::MatrixXd ImpulseResponse::jacobian(const MaterialPoints& points) const {
  Eigen::MatrixXd J(3 * points.rest.rows(), rigid_ + v_.size());
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i) {
    const auto rows = points.basis_rows.middleRows<3>(3 * i);
    const Eigen::Vector3d own = points.rest.row(i).transpose() + rows * pose_.q;
    if (rigid_ > 0) {
      J.block<3, 3>(3 * i, 0).setIdentity();
      J.block<3, 3>(3 * i, 3) = -cross_matrix(pose_.to_world(own) - pose_.position) * pose_.rotation;
    }
    J.block(3 * i, rigid_, 3, v_.size()) = pose_.rotation * rows;
  }
  return J;
}

Eigen::MatrixXd ImpulseResponse::solve(const Eigen::MatrixXd& forces) const {
  Eigen::MatrixXd x = factor_.solve(forces);
  if (held_.conditions() > 0) x -= held_.directions * (held_.inverse * (held_.gradients.transpose() * x));
  return x;
}

Eigen::VectorXd ImpulseResponse::velocity(const MaterialPoints& points) const {
  Eigen::VectorXd velocity(3 * points.rest.rows());
  for (Eigen::Index i = 0; i < points.rest.rows(); ++i) {
    const auto rows = points.basis_rows.middleRows<3>(3 * i);
    const Eigen::Vector3d own = points.rest.row(i).transpose() + rows * pose_.q;
    const Eigen::Vector3d arm = pose_.to_world(own) - pose_.position;
    velocity.segment<3>(3 * i) =
        frame_velocity_.linear + frame_velocity_.angular.cross(arm) + pose_.rotation * (rows * v_);
  }
  return velocity;
}

void ImpulseResponse::apply(const MaterialPoints& points, const Eigen::VectorXd& impulses, Workspace& workspace,
                            State& state) const {
  const double dt = scene_.time_step;
  const Eigen::VectorXd x = solve(jacobian(points).transpose() * impulses);
  state.q += dt * x.tail(v_.size());
  state.v += x.tail(v_.size());
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

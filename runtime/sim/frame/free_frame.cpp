#include "runtime/sim/frame/free_frame.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/sim/frame/frame_numbers.h"

namespace exmat::runtime {
namespace {

FreeState& own_free(FrameState& state) { return *std::get_if<FreeState>(&state); }
const FreeState& own_free(const FrameState& state) { return *std::get_if<FreeState>(&state); }
FreeMotionWorkspace& own_free(FrameWorkspace& workspace) { return *std::get_if<FreeMotionWorkspace>(&workspace); }
const FreeMotionWorkspace& own_free(const FrameWorkspace& workspace) {
  return *std::get_if<FreeMotionWorkspace>(&workspace);
}

template <typename Body, typename Visitor>
void visit_numbers(Body& body, Visitor& visitor) {
  visitor(body.position, body.orientation.coeffs(), body.linear_momentum, body.angular_momentum, body.spin,
          body.applied_force, body.applied_torque,  // FreeFrame::kFirstLoad
          body.momentum, body.momentum_previous);
}

}  // namespace

// ---- Its state ------------------------------------------------------------------------------------------------------

FrameState FreeFrame::make_state() const {
  FreeState body;
  body.mass = inertia_.mass();
  body.momentum = body.momentum_previous = Eigen::VectorXd::Zero(inertia_.modes());
  return body;
}

void FreeFrame::follow(const WorldLoads& /*loads*/, double /*time*/, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                       FrameWorkspace& workspace, FrameState& state) const noexcept {
  set_motion(motion(state), q, v, workspace, state);
}

bool FreeFrame::set_motion(const FrameMotion& motion, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                           FrameWorkspace& workspace, FrameState& state) const noexcept {
  FreeState& body = own_free(state);
  DeformingInertia::Moments& moments = own_free(workspace).moments;
  inertia_.moments(q, moments);
  body.position = motion.position;
  body.orientation = motion.orientation.normalized();
  body.spin = body.orientation.conjugate() * motion.angular_velocity;
  body.linear_momentum = body.mass * motion.linear_velocity;
  body.angular_momentum = body.orientation * (moments.inertia * body.spin + moments.deformation().transpose() * v);
  body.momentum = v + moments.deformation().lazyProduct(body.spin);
  body.momentum_previous = body.momentum;
  return true;
}

void FreeFrame::adopt(const FrameMotion& motion, const FrameMomenta& momenta, const Eigen::VectorXd& q,
                      const Eigen::VectorXd& v, FrameWorkspace& workspace, FrameState& state) const noexcept {
  set_motion(motion, q, v, workspace, state);
  FreeState& body = own_free(state);
  const DeformingInertia::Moments& moments = own_free(workspace).moments;
  body.linear_momentum = momenta.linear;
  body.angular_momentum = momenta.angular;
  const Eigen::Vector3d own = body.orientation.conjugate() * momenta.angular;
  body.spin = moments.inertia.inverse() * (own - moments.deformation().transpose() * v);
  body.momentum = v + moments.deformation().lazyProduct(body.spin);
  body.momentum_previous = body.momentum;
}

Placement FreeFrame::placement(const FrameState& state) const noexcept {
  const FreeState& body = own_free(state);
  return {origin(), origin() + body.position, body.orientation.toRotationMatrix()};
}

FrameVelocity FreeFrame::velocity(const FrameState& state) const noexcept {
  const FreeState& body = own_free(state);
  return {body.linear_momentum / body.mass, body.orientation.toRotationMatrix() * body.spin};
}

FrameMotion FreeFrame::motion(const FrameState& state) const noexcept {
  const FreeState& body = own_free(state);
  return {body.position, body.orientation, body.linear_momentum / body.mass, body.orientation * body.spin};
}

std::optional<FrameMomenta> FreeFrame::momenta(const FrameState& state) const noexcept {
  return FrameMomenta{own_free(state).linear_momentum, own_free(state).angular_momentum};
}

double FreeFrame::turn_rate(const FrameState& state) const noexcept { return own_free(state).spin.norm(); }

const Eigen::VectorXd& FreeFrame::momentum(const Eigen::VectorXd& /*v*/, const FrameState& state) const noexcept {
  return own_free(state).momentum;
}

const Eigen::VectorXd& FreeFrame::former_momentum(const Eigen::VectorXd& /*v_previous*/,
                                                  const FrameState& state) const noexcept {
  return own_free(state).momentum_previous;
}

double FreeFrame::kinetic_energy(const Eigen::VectorXd& v, const FrameState& state) const noexcept {
  const FreeState& body = own_free(state);
  // w . l = w . (J w + h) and (pi - v) . v = w . h.
  const Eigen::Vector3d l = body.orientation.conjugate() * body.angular_momentum;
  double energy = 0.5 * v.squaredNorm();
  energy += 0.5 * body.linear_momentum.squaredNorm() / body.mass;
  energy += 0.5 * (body.spin.dot(l) + (body.momentum - v).dot(v));
  return energy;
}

double FreeFrame::potential_energy(const Eigen::Vector3d& gravity, const FrameState& state) const noexcept {
  return -(own_free(state).mass * gravity.dot(own_free(state).position));
}

BodyFrame::Coordinates FreeFrame::coordinates(const FrameState& state) const noexcept {
  const FreeState& body = own_free(state);
  Coordinates coordinates(13);
  coordinates << body.position, body.orientation.coeffs(), body.linear_momentum, body.angular_momentum;
  return coordinates;
}

std::size_t FreeFrame::write_numbers(const FrameState& state, double* to) const noexcept {
  NumberCounter counter;
  visit_numbers(own_free(state), counter);
  if (to == nullptr) return counter.count;
  NumberWriter writer{to};
  visit_numbers(own_free(state), writer);
  return counter.count;
}

void FreeFrame::set_numbers(std::span<const double> numbers, FrameState& state) const noexcept {
  NumberReader reader{numbers};
  visit_numbers(own_free(state), reader);
}

void FreeFrame::apply(const Eigen::Vector3d& force, const Eigen::Vector3d& torque, FrameState& state) const noexcept {
  own_free(state).applied_force += force;
  own_free(state).applied_torque += torque;
}

void FreeFrame::clear_forces(FrameState& state) const noexcept {
  own_free(state).applied_force.setZero();
  own_free(state).applied_torque.setZero();
}

/// With momenta and the velocity v given, the energy is p^2 / 2m + l^T J^-1 l / 2, the rigid part, and a part that is
/// quadratic in v.
Eigen::Vector3d FreeFrame::limit_kinetic_energy(double allowed, const Eigen::Vector3d& impulse,
                                                FrameWorkspace& workspace, Eigen::VectorXd& v,
                                                FrameState& state) const noexcept {
  const FreeMotionWorkspace& free = own_free(workspace);
  FreeState& body = own_free(state);
  const double mass = body.mass;
  const Eigen::Vector3d before = body.linear_momentum;
  const Eigen::Matrix3d to_body = body.orientation.toRotationMatrix().transpose();
  const Eigen::Matrix3d inverse = free.moments.inertia.inverse();
  Eigen::Vector3d l = to_body * body.angular_momentum;
  const auto product = [&](const Eigen::Vector3d& p, const Eigen::Vector3d& l_p, const Eigen::Vector3d& of,
                           const Eigen::Vector3d& l_of) { return p.dot(of) / mass + l_p.dot(inverse * l_of); };
  const double rigid = 0.5 * product(before, l, before, l);
  const double whole = kinetic_energy(v, state);
  v *= rigid < allowed ? std::sqrt((allowed - rigid) / (whole - rigid)) : 0;
  if (rigid > allowed) {
    const Eigen::Vector3d turn = l - to_body * (free.unknowns.start_rotation * free.problem.momentum);
    const double slope = product(before, l, impulse, turn), curvature = product(impulse, turn, impulse, turn);
    const double root = std::sqrt(std::max(0.0, slope * slope - 2 * curvature * (rigid - allowed)));
    const double share = curvature > 0 ? std::clamp((slope - root) / curvature, 0.0, 1.0) : 0;
    body.linear_momentum -= share * impulse;
    l -= share * turn;
    const double left = 0.5 * product(body.linear_momentum, l, body.linear_momentum, l);
    const double rest = left > allowed ? std::sqrt(allowed / left) : 1;
    body.linear_momentum *= rest;
    l *= rest;
    body.angular_momentum = to_body.transpose() * l;
  }
  body.spin = inverse * (l - free.moments.deformation().transpose() * v);
  body.momentum = v + free.moments.deformation().lazyProduct(body.spin);
  return before - body.linear_momentum;
}

void FreeFrame::add_motion(double share, const FrameVelocity& added, FrameWorkspace& workspace, Eigen::VectorXd& v,
                           FrameState& state) const noexcept {
  const DeformingInertia::Moments& moments = own_free(workspace).moments;
  FreeState& body = own_free(state);
  v *= share;
  body.linear_momentum = share * body.linear_momentum + body.mass * added.linear;
  body.angular_momentum = share * body.angular_momentum + inertia(workspace, state) * added.angular;
  body.spin = share * body.spin + body.orientation.conjugate() * added.angular;
  body.momentum = v + moments.deformation().lazyProduct(body.spin);
}

bool FreeFrame::is_finite(const FrameWorkspace& workspace) const noexcept {
  const FreeMotionWorkspace& free = own_free(workspace);
  // Places are read in single precision, too.
  return free.moved.position.cast<float>().allFinite() && free.moved.linear_momentum.allFinite() &&
         free.moved.angular_momentum.allFinite() && free.solution.spin.allFinite() &&
         free.solution.rotation.allFinite();
}

Eigen::Matrix3d FreeFrame::inertia(const FrameWorkspace& workspace, const FrameState& state) const noexcept {
  const Eigen::Matrix3d rotation = own_free(state).orientation.toRotationMatrix();
  return rotation * own_free(workspace).moments.inertia * rotation.transpose();
}

std::optional<FrameMomenta> FreeFrame::expected_momenta(const FrameWorkspace& workspace) const noexcept {
  const FreeState& body = own_free(workspace).moved;
  return FrameMomenta{body.linear_momentum, body.angular_momentum};
}

// ---- A step ---------------------------------------------------------------------------------------------------------

/// Scripted forces act on its momenta first, in move().
void FreeFrame::begin(const FrameStep& step, FrameWorkspace& /*workspace*/,
                      Eigen::VectorXd& external_force) const noexcept {
  external_force = step.applied_force;
  external_force += step.loads.gravity_force;
}

/// Scripted forces act where the body would be at the middle of the step by its spin. The centre of mass is exact for
/// them, away from obstacles.
void FreeFrame::move(const FrameStep& step, bool near, bool dissipative, const FrameState& state,
                     FrameWorkspace& workspace, Eigen::VectorXd& external_force) const noexcept {
  const FreeState& start = own_free(state);
  FreeState& body = own_free(workspace).moved;
  body.mass = start.mass;
  body.position = start.position;
  body.orientation = start.orientation;
  body.linear_momentum = start.linear_momentum;
  body.angular_momentum = start.angular_momentum;
  body.spin = start.spin;
  const double dt = step.time_step, mass = inertia_.mass();
  Eigen::Vector3d force = mass * step.loads.gravity + start.applied_force, torque = start.applied_torque;
  for (const ScriptedForce& scripted : step.loads.forces) {
    if (!scripted.acts_at(step.midpoint())) continue;
    const Eigen::Matrix3d rotation = body.orientation.toRotationMatrix() * rotation_of(0.5 * dt * body.spin);
    const Eigen::Vector3d local = rotation.transpose() * scripted.total;
    const Eigen::Vector3d arm = scripted.lever + scripted.mean_basis * step.q;
    force += scripted.total;
    torque += rotation * arm.cross(local);
    external_force.noalias() += scripted.mean_basis.transpose() * local;
  }
  // Forces that contacts balance have to act on the position as those do.
  RigidUnknowns& unknowns = own_free(workspace).unknowns;
  unknowns.second_order = near && !dissipative;
  if (unknowns.second_order) {
    const FreeStart& before = start.before;
    const double h = 2 * dt / 3;
    body.linear_momentum = (4 * start.linear_momentum - before.linear_momentum) / 3 + h * force;
    body.angular_momentum = (4 * start.angular_momentum - before.angular_momentum) / 3 + h * torque;
    body.position = (4 * start.position - before.position) / 3 + h / mass * body.linear_momentum;
    unknowns.last_turn = before.orientation.conjugate() * start.orientation;
  } else {
    const double share = near ? 1 : 0.5;
    body.position += dt / mass * (body.linear_momentum + share * dt * force);
    body.linear_momentum += dt * force;
    body.angular_momentum += dt * torque;
  }
  begin_rotation(body, dt, dissipative, own_free(workspace));
}

void FreeFrame::add_start_force(const FrameStep& step, const FrameState& state, FrameWorkspace& workspace,
                                Eigen::VectorXd& force) const noexcept {
  FreeMotionWorkspace& free = own_free(workspace);
  free.velocity = step.v;
  free.solution.spin = own_free(state).spin;
  inertia_.moments(step.q, free.moments);
  rotation_force(inertia_, 0, free);
  force += free.force;
}

bool FreeFrame::update_force(const Eigen::VectorXd& q, double velocity_factor, const Eigen::VectorXd& velocity_centre,
                             FrameWorkspace& workspace) const noexcept {
  return update_rotation(inertia_, velocity_factor, q, velocity_centre, own_free(workspace));
}

const Eigen::VectorXd* FreeFrame::force(const FrameWorkspace& workspace) const noexcept {
  return &own_free(workspace).force;
}

void FreeFrame::add_stiffness(double velocity_factor, FrameWorkspace& workspace,
                              Eigen::MatrixXd& hessian) const noexcept {
  add_rotation_stiffness(inertia_, velocity_factor, own_free(workspace), hessian);
}

double FreeFrame::gyroscopic_ratio(double velocity_factor, const FrameWorkspace& workspace) const noexcept {
  return 2 * own_free(workspace).solution.spin.norm() / velocity_factor;
}

const Eigen::MatrixXd* FreeFrame::gyroscopic(double velocity_factor, FrameWorkspace& workspace) const noexcept {
  set_gyroscopic(inertia_, velocity_factor, own_free(workspace));
  return &own_free(workspace).gyroscopic;
}

const Eigen::VectorXd* FreeFrame::gyroscopic_product(double velocity_factor, const Eigen::VectorXd& x,
                                                     FrameWorkspace& workspace) const noexcept {
  runtime::gyroscopic_product(inertia_, velocity_factor, x, own_free(workspace));
  return &own_free(workspace).product;
}

bool FreeFrame::fall_back(const FrameStep& step, FrameWorkspace& workspace) const noexcept {
  turn_rigidly(inertia_, step.q, step.v, step.time_step, own_free(workspace));
  return true;
}

void FreeFrame::commit(const WorldLoads& /*loads*/, double rate, const Eigen::VectorXd& /*q*/, const Eigen::VectorXd& v,
                       Eigen::VectorXd& a, FrameWorkspace& workspace, FrameState& state) const noexcept {
  commit_free_motion(rate, v, own_free(workspace), a, own_free(state));
}

// ---- Near obstacles -------------------------------------------------------------------------------------------------

void FreeFrame::begin_contact(const FrameState& state, const Eigen::VectorXd& q, double time_step,
                              FrameWorkspace& workspace, Eigen::VectorXd& x) const noexcept {
  FreeMotionWorkspace& free = own_free(workspace);
  free.spin_is_given = true;
  x.segment<3>(3) = free.solution.rotation;
  inertia_.moments(q, free.moments);
  free.unknowns.time_step = time_step;
  free.unknowns.start_rotation = own_free(state).orientation.toRotationMatrix();
  free.unknowns.start_inertia = free.moments.inertia;
  free.unknowns.expected_turn = free.solution.rotation;
  free.unknowns.frozen_turn.setZero();
  free.unknowns.next_frozen_turn.setZero();
}

Placement FreeFrame::place(const Eigen::VectorXd& x, FrameWorkspace& workspace) const noexcept {
  FreeMotionWorkspace& free = own_free(workspace);
  const Eigen::Vector3d turn = x.segment<3>(3);
  free.solution.rotation = turn;
  free.solution.spin = free.unknowns.spin(turn);
  return {origin(), origin() + free.moved.position + x.head<3>(), free.unknowns.start_rotation * rotation_of(turn)};
}

double FreeFrame::rigid_potential(const Eigen::VectorXd& x, FrameWorkspace& workspace) const noexcept {
  const RigidUnknowns& unknowns = own_free(workspace).unknowns;
  const double h = 1 / unknowns.velocity_factor();
  const Eigen::Vector3d d = x.head<3>(), t = x.segment<3>(3);
  const Eigen::Vector3d quadratic = unknowns.start_inertia * (t - unknowns.expected_turn) / (h * h);
  return 0.5 * inertia_.mass() / (h * h) * d.squaredNorm() + 0.5 * (t - unknowns.expected_turn).dot(quadratic) +
         unknowns.frozen_turn.dot(t);
}

void FreeFrame::rigid_gradient(const Eigen::VectorXd& x, const FrameMomenta& contact, FrameWorkspace& workspace,
                               Eigen::VectorXd& gradient) const noexcept {
  FreeMotionWorkspace& free = own_free(workspace);
  RigidUnknowns& unknowns = free.unknowns;
  const double h = 1 / unknowns.velocity_factor(), mass = inertia_.mass();
  const Eigen::Vector3d d = x.head<3>(), t = x.segment<3>(3);
  const Eigen::Vector3d quadratic = unknowns.start_inertia * (t - unknowns.expected_turn) / (h * h);
  const Eigen::Matrix3d turn = rotation_of(t);
  const Eigen::Vector3d momentum =
      free.moments.inertia * free.solution.spin + free.moments.deformation().transpose() * free.velocity;
  const Eigen::Matrix3d to_turn = right_jacobian(t).transpose();
  const Eigen::Vector3d inertia = to_turn * ((momentum - turn.transpose() * free.problem.momentum) / h);
  unknowns.next_frozen_turn = inertia - quadratic;
  gradient.head<3>() = mass / (h * h) * d - contact.linear;
  gradient.segment<3>(3) =
      inertia - to_turn * (turn.transpose() * (unknowns.start_rotation.transpose() * contact.angular));
}

double FreeFrame::accept_rigid(FrameWorkspace& workspace) const noexcept {
  FreeMotionWorkspace& free = own_free(workspace);
  RigidUnknowns& unknowns = free.unknowns;
  const double change = (unknowns.next_frozen_turn - unknowns.frozen_turn).dot(free.solution.rotation);
  unknowns.frozen_turn = unknowns.next_frozen_turn;
  return change;
}

/// Contacts turn about world axes, the unknown t is a rotation vector.
Eigen::Matrix3d FreeFrame::turn_to_world(const Eigen::VectorXd& x, const Placement& placement) const noexcept {
  return placement.rotation * right_jacobian(x.segment<3>(3));
}

void FreeFrame::add_rigid_hessian(const Eigen::VectorXd& x, const Placement& placement,
                                  Eigen::MatrixXd& contact_stiffness, FrameWorkspace& workspace,
                                  Eigen::MatrixXd& hessian) const noexcept {
  const FreeMotionWorkspace& free = own_free(workspace);
  const double h = 1 / free.unknowns.velocity_factor();
  const Eigen::Matrix3d to_world = turn_to_world(x, placement);
  Eigen::MatrixXd& K = contact_stiffness;
  K.triangularView<Eigen::StrictlyUpper>() = K.transpose();
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    const Eigen::RowVector3d row = K.block<1, 3>(i, 3) * to_world;
    K.block<1, 3>(i, 3) = row;
  }
  for (Eigen::Index j = 0; j < K.cols(); ++j) {
    const Eigen::Vector3d column = to_world.transpose() * K.block<3, 1>(3, j);
    K.block<3, 1>(3, j) = column;
  }
  hessian.triangularView<Eigen::Lower>() += K;
  hessian.diagonal().head<3>().array() += inertia_.mass() / (h * h);
  hessian.block<3, 3>(3, 3).triangularView<Eigen::Lower>() += free.moments.inertia / (h * h);
  hessian.block(6, 3, inertia_.modes(), 3) += free.moments.deformation() / (h * h);
}

Eigen::Vector3d FreeFrame::force_of(const Eigen::VectorXd& x, const FrameWorkspace& workspace) const noexcept {
  const double factor = own_free(workspace).unknowns.velocity_factor();
  return inertia_.mass() * factor * factor * x.head<3>();
}

double FreeFrame::residual_of(const Eigen::Vector3d& force) const noexcept {
  return force.norm() / std::sqrt(inertia_.mass());
}

void FreeFrame::end_contact(const Eigen::VectorXd& x, bool converged, const Eigen::Vector3d& torque,
                            const FrameState& state, FrameWorkspace& workspace, Eigen::Vector3d& force) const noexcept {
  FreeMotionWorkspace& free = own_free(workspace);
  FreeState& body = free.moved;
  const double h = 1 / free.unknowns.velocity_factor();
  const Eigen::Matrix3d rotation = own_free(state).orientation.toRotationMatrix() * rotation_of(free.solution.rotation);
  const Eigen::Vector3d deformation = free.moments.deformation().transpose() * free.velocity;
  if (converged) {
    body.position += h * h / body.mass * force;  // d, but for the residual: the centre goes as its momentum says
    body.angular_momentum += h * torque;
    free.solution.spin = free.moments.inertia.inverse() * (rotation.transpose() * body.angular_momentum - deformation);
  } else {
    body.position += x.head<3>();
    force = force_of(x, workspace);
    free.solution.spin = free.unknowns.spin(free.solution.rotation);
    body.angular_momentum = rotation * (free.moments.inertia * free.solution.spin + deformation);
  }
  body.linear_momentum += h * force;
}

}  // namespace exmat::runtime

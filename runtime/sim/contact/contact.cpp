#include "runtime/sim/contact/contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace exmat::runtime {
namespace {

constexpr int kLeafVertices = 16;
constexpr Eigen::Index kFactorColumns = 32;

/// Lower triangle of A += F F^T, F the first `used` columns of `factors`. Eigen keeps its panels on the stack up to r =
/// 500.
void add_factors(const Eigen::MatrixXd& factors, Eigen::Index used, Eigen::MatrixXd& A) {
  if (used > 0) A.selfadjointView<Eigen::Lower>().rankUpdate(factors.topLeftCorner(A.rows(), used));
}

/// Whether the distance that a candidate feels changes by no more than its vertex goes: not by a side plane, nor over
/// the border of ground.
bool has_steady_distance(const PlacedObstacle& placed, const ContactCandidate& candidate) {
  return candidate.passage.kind == Passage::Kind::kNearest &&
         !std::holds_alternative<HeightFieldShape>(placed.obstacle->shape);
}

}  // namespace

double way_bound(double reach, double basis_norm, const BodyPose& pose, const Placement& from,
                 const Eigen::VectorXd& from_q) noexcept {
  return (pose.position - from.position).norm() +
         (pose.rotation - from.rotation).norm() * (reach + basis_norm * pose.q.norm()) +
         basis_norm * (pose.q - from_q).norm();
}

ContactWorkspace::ContactWorkspace(const ContactSet& set, std::size_t obstacle_count)
    : obstacles(obstacle_count),
      candidates(obstacle_count * static_cast<std::size_t>(set.vertices())),
      first_q(set.modes()),
      factors(Eigen::MatrixXd::Zero(6 + set.modes(), kFactorColumns)) {
  set_zero(set.modes());
}

ContactSet::ContactSet(const ContactData& data, const Eigen::Vector3d& origin) {
  const auto count = static_cast<int>(data.areas.size());
  const VertexArray rest = data.positions.rowwise() - origin.transpose();
  tree_ = DeformationTree(IndexVector::LinSpaced(count, 0, count - 1), rest, data.basis, kLeafVertices);
  data_indices_ = tree_.order();
  const bool numbered = data.vertices.size() == count;
  for (const int index : data_indices_)
    object_vertices_.push_back(numbered ? static_cast<int>(data.vertices[index]) : index);
  rest_ = rest(data_indices_, Eigen::all);
  areas_ = data.areas(data_indices_);
  basis_.resize(3 * count, data.basis.cols());
  for (int i = 0; i < count; ++i) basis_.middleRows<3>(3 * i) = data.basis.middleRows<3>(3 * data_index(i));
  if (count > 0) reach_ = rest.rowwise().norm().maxCoeff();
}

ContactState ContactSet::make_state(std::size_t obstacle_count) const {
  return {std::vector<HeldContact>(obstacle_count * static_cast<std::size_t>(vertices())), 0};
}

double ContactSet::travel_bound(const BodyPose& pose, const BodyVelocity& velocity, double time_step) const noexcept {
  const double reach = reach_ + tree_.basis_norm() * pose.q.norm();
  return time_step *
         (velocity.linear.norm() + velocity.angular.norm() * reach + tree_.basis_norm() * velocity.v.norm());
}

bool ContactSet::body_is_near(const BodyPose& pose, double q_norm, double margin,
                              const ContactWorkspace& workspace) const noexcept {
  const DeformationTree::Node& all = tree_.nodes().front();
  const Eigen::Vector3d centre = pose.position + pose.rotation * all.centre;
  const double radius = all.radius + tree_.basis_norm() * q_norm;
  return std::any_of(workspace.obstacles.begin(), workspace.obstacles.end(),
                     [&](const PlacedObstacle& obstacle) { return obstacle.may_meet(centre, radius, margin); });
}

/// Obstacles that go through the body in the step rather than up to it.
void ContactSet::find_sweeping(const BodyPose& pose, double q_norm, ContactWorkspace& workspace) const noexcept {
  for (PlacedObstacle& placed : workspace.obstacles) {
    if (!placed.obstacle->motion.moves()) continue;
    const double reach = reach_ + tree_.basis_norm() * q_norm;
    placed.sweeps = placed.sweep(pose.position, reach) > kSweep * shortest_passage(placed.obstacle->shape);
  }
}

bool ContactSet::is_near(int node, const BodyPose& pose, double q_norm, double margin,
                         const ContactWorkspace& workspace) const noexcept {
  const DeformationTree::Ball ball = tree_.ball(node, pose.q, q_norm);
  const Eigen::Vector3d centre = pose.position + pose.rotation * ball.centre;
  const double radius = ball.radius;
  return std::any_of(workspace.obstacles.begin(), workspace.obstacles.end(),
                     [&](const PlacedObstacle& obstacle) { return obstacle.may_meet(centre, radius, margin); });
}

Eigen::Vector3d ContactSet::world_arm(int vertex, const BodyPose& pose) const noexcept {
  const Eigen::Vector3d moved = rest_.row(vertex).transpose() + basis_.middleRows<3>(3 * vertex).lazyProduct(pose.q);
  return pose.rotation * moved;
}

Eigen::Vector3d ContactSet::world_velocity(int vertex, const Eigen::Vector3d& arm, const BodyPose& pose,
                                           const BodyVelocity& velocity) const noexcept {
  const Eigen::Vector3d own = basis_.middleRows<3>(3 * vertex).lazyProduct(velocity.v);
  return velocity.at(arm) + pose.rotation * own;
}

void ContactSet::test_vertices(const DeformationTree::Node& node, const BodyPose& pose, double margin,
                               ContactWorkspace& workspace) const noexcept {
  for (int vertex = node.first; vertex < node.last; ++vertex) {
    ++workspace.tested_vertices;
    const Eigen::Vector3d arm = world_arm(vertex, pose);
    const Eigen::Vector3d point = pose.position + arm;
    for (std::size_t i = 0; i < workspace.obstacles.size(); ++i) {
      if (!workspace.obstacles[i].may_meet(point, 0, margin)) continue;
      ContactCandidate& candidate = workspace.candidates[workspace.candidate_count++];
      candidate.vertex = vertex;
      candidate.obstacle = static_cast<int>(i);
      candidate.arm = arm;
    }
  }
}

void ContactSet::gather(const std::vector<Obstacle>& obstacles, double end_time, double time_step, const BodyPose& pose,
                        double margin, ContactWorkspace& workspace) const noexcept {
  workspace.candidate_count = 0;
  workspace.visited_nodes = workspace.tested_vertices = 0;
  if (tree_.empty()) return;
  for (std::size_t i = 0; i < obstacles.size(); ++i)
    workspace.obstacles[i] = PlacedObstacle(obstacles[i], end_time, time_step);
  const double q_norm = pose.q.norm();
  find_sweeping(pose, q_norm, workspace);
  if (!body_is_near(pose, q_norm, margin, workspace)) return;
  const auto count = static_cast<int>(tree_.nodes().size());
  for (int node = 0; node < count;) {
    ++workspace.visited_nodes;
    const DeformationTree::Node& branch = tree_.node(node);
    const bool near = is_near(node, pose, q_norm, margin, workspace);
    if (near && branch.is_leaf) test_vertices(branch, pose, margin, workspace);
    node = near ? node + 1 : branch.next;
  }
}

void ContactSet::freeze(const BodyPose& pose, const BodyVelocity& velocity, const FrameVelocity& expected,
                        double time_step, const ContactState& state, ContactWorkspace& workspace) const noexcept {
  std::size_t next = 0;
  workspace.has_first = false;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    ContactCandidate& candidate = workspace.candidates[i];
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    const Eigen::Vector3d arm = candidate.arm;
    const Eigen::Vector3d point = pose.position + arm;
    const Eigen::Vector3d at = world_velocity(candidate.vertex, arm, pose, velocity);
    const Eigen::Vector3d predicted = point + time_step * at;
    const Eigen::Vector3d heading = predicted + time_step * (at + expected.at(arm) - velocity.at(arm));
    freeze_contact(placed, find_held(state, next, candidate), {point, predicted, heading}, areas_[candidate.vertex],
                   time_step, candidate);
  }
}

void ContactSet::evaluate(const BodyPose& pose, ContactWorkspace& workspace) const noexcept {
  workspace.set_zero(modes());
  const bool is_first = !workspace.has_first;
  if (is_first) {
    workspace.has_first = true;
    workspace.first = pose;
    workspace.first_q = pose.q;
  }
  const double way = is_first ? 0 : way_bound(reach_, tree_.basis_norm(), pose, workspace.first, workspace.first_q);
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    ContactCandidate& candidate = workspace.candidates[i];
    if (candidate.clearance > way) {
      leave_untouched(way, candidate);
      continue;
    }
    candidate.arm = world_arm(candidate.vertex, pose);
    const Eigen::Vector3d point = pose.position + candidate.arm;
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    evaluate_contact(placed, point, candidate);
    if (is_first && has_steady_distance(placed, candidate)) candidate.clearance = clearance_of(candidate, point);
    if (candidate.normal_force > 0) {
      ++workspace.touching;
      workspace.stiffness += candidate.weights[0];
    }
    if (candidate.normal_force == 0 && candidate.friction_force == 0) continue;
    workspace.force += candidate.force;
    workspace.torque += candidate.arm.cross(candidate.force);
    const Eigen::Vector3d body_force = pose.rotation.transpose() * candidate.force;
    workspace.generalised += basis_.middleRows<3>(3 * candidate.vertex).transpose().lazyProduct(body_force);
    workspace.potential += contact_potential(candidate, candidate.gap, point);
  }
}

double ContactSet::potential(const BodyPose& pose, const ContactWorkspace& workspace) const noexcept {
  double sum = 0;
  const double way =
      workspace.has_first ? way_bound(reach_, tree_.basis_norm(), pose, workspace.first, workspace.first_q) : 0;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    const ContactCandidate& candidate = workspace.candidates[i];
    if (candidate.clearance > way) continue;
    const Eigen::Vector3d point = pose.position + world_arm(candidate.vertex, pose);
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    sum += contact_potential(placed, candidate, point);
  }
  return sum;
}

double ContactSet::refresh_friction(ContactWorkspace& workspace) const noexcept {
  return runtime::refresh_friction(workspace.obstacles, workspace.candidates, workspace.candidate_count);
}

template <int kRigid>
void ContactSet::add_stiffness_of(const BodyPose& pose, ContactWorkspace& workspace,
                                  Eigen::MatrixXd& stiffness) const noexcept {
  Eigen::Index used = 0;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    const ContactCandidate& candidate = workspace.candidates[i];
    for (int k = 0; k < 3; ++k) {
      if (candidate.weights[k] <= 0) continue;
      const Eigen::Vector3d direction = std::sqrt(candidate.weights[k]) * candidate.directions.col(k);
      auto factor = workspace.factors.col(used).head(kRigid + modes());
      if constexpr (kRigid > 0) {
        factor.template head<3>() = direction;
        factor.template segment<3>(3) = candidate.arm.cross(direction);
      }
      const Eigen::Vector3d body_direction = pose.rotation.transpose() * direction;
      factor.tail(modes()) = basis_.middleRows<3>(3 * candidate.vertex).transpose().lazyProduct(body_direction);
      if (++used < kFactorColumns) continue;
      add_factors(workspace.factors, used, stiffness);
      used = 0;
    }
  }
  add_factors(workspace.factors, used, stiffness);
}

void ContactSet::add_stiffness(const BodyPose& pose, ContactWorkspace& workspace,
                               Eigen::MatrixXd& stiffness) const noexcept {
  add_stiffness_of<6>(pose, workspace, stiffness);
}

void ContactSet::add_reduced_stiffness(const BodyPose& pose, ContactWorkspace& workspace,
                                       Eigen::MatrixXd& stiffness) const noexcept {
  add_stiffness_of<0>(pose, workspace, stiffness);
}

void ContactSet::commit(const BodyPose& pose, const ContactWorkspace& workspace, ContactState& state) const noexcept {
  state.count = 0;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    const ContactCandidate& candidate = workspace.candidates[i];
    const Eigen::Vector3d point = pose.position + candidate.arm;
    hold_contact(workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)], point, candidate, state);
  }
}

}  // namespace exmat::runtime

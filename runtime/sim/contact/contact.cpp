#include "runtime/sim/contact/contact.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace exmat::runtime {
namespace {

constexpr int kLeafVertices = 16;
constexpr Eigen::Index kFactorColumns = 32;

using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;

/// Largest singular value of each 3 x r block less `mean`.
double largest_norm(const RowMatrix& basis, const std::vector<int>& order, int first, int last, const Rows& mean) {
  double largest = 0;
  for (int i = first; i < last; ++i) {
    const Rows rows = basis.middleRows<3>(3 * order[static_cast<std::size_t>(i)]) - mean;
    const Eigen::Matrix3d square = rows * rows.transpose();
    largest = std::max(largest, Eigen::JacobiSVD<Eigen::Matrix3d>(square).singularValues()[0]);
  }
  return std::sqrt(largest);
}

/// Lower triangle of A += F F^T, F the first `used` columns of `factors`. Eigen keeps its panels on the stack up to r =
/// 500.
void add_factors(const Eigen::MatrixXd& factors, Eigen::Index used, Eigen::MatrixXd& A) {
  if (used > 0) A.selfadjointView<Eigen::Lower>().rankUpdate(factors.topLeftCorner(A.rows(), used));
}

}  // namespace

ContactWorkspace::ContactWorkspace(const ContactSet& set, std::size_t obstacle_count)
    : obstacles(obstacle_count),
      candidates(obstacle_count * static_cast<std::size_t>(set.vertices())),
      generalised(Eigen::VectorXd::Zero(set.modes())),
      factors(Eigen::MatrixXd::Zero(6 + set.modes(), kFactorColumns)) {}

ContactSet::ContactSet(const ContactData& data, const Eigen::Vector3d& origin) {
  const auto count = static_cast<int>(data.areas.size());
  const VertexArray rest = data.positions.rowwise() - origin.transpose();
  data_indices_.resize(static_cast<std::size_t>(count));
  std::iota(data_indices_.begin(), data_indices_.end(), 0);
  if (count > 0) build_branch(data_indices_, 0, count, data.basis, rest);
  const bool numbered = data.vertices.size() == count;
  for (const int index : data_indices_)
    object_vertices_.push_back(numbered ? static_cast<int>(data.vertices[index]) : index);
  rest_ = rest(data_indices_, Eigen::all);
  areas_ = data.areas(data_indices_);
  basis_.resize(3 * count, data.basis.cols());
  for (int i = 0; i < count; ++i) basis_.middleRows<3>(3 * i) = data.basis.middleRows<3>(3 * data_index(i));
  if (count == 0) return;
  reach_ = rest.rowwise().norm().maxCoeff();
  basis_norm_ = largest_norm(data.basis, data_indices_, 0, count, Rows::Zero(3, modes()));
}

void ContactSet::build_branch(std::vector<int>& order, int first, int last, const RowMatrix& basis,
                              const VertexArray& rest) {
  const std::size_t at = nodes_.size();
  nodes_.emplace_back();
  nodes_[at].first = first;
  nodes_[at].last = last;
  nodes_[at].is_leaf = last - first <= kLeafVertices;
  set_bounds(nodes_[at], order, basis, rest);
  if (!nodes_[at].is_leaf) {
    const std::vector<int> ids(order.begin() + first, order.begin() + last);
    const VertexArray points = rest(ids, Eigen::all);
    Eigen::Index axis = 0;
    (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff(&axis);
    const int middle = first + (last - first) / 2;
    std::nth_element(order.begin() + first, order.begin() + middle, order.begin() + last, [&](int a, int b) {
      return rest(a, axis) != rest(b, axis) ? rest(a, axis) < rest(b, axis) : a < b;
    });
    build_branch(order, first, middle, basis, rest);
    build_branch(order, middle, last, basis, rest);
  }
  nodes_[at].next = static_cast<int>(nodes_.size());
}

void ContactSet::set_bounds(Node& node, const std::vector<int>& order, const RowMatrix& basis,
                            const VertexArray& rest) {
  const std::vector<int> ids(order.begin() + node.first, order.begin() + node.last);
  const VertexArray points = rest(ids, Eigen::all);
  node.centre = 0.5 * (points.colwise().maxCoeff() + points.colwise().minCoeff()).transpose();
  node.radius = (points.rowwise() - node.centre.transpose()).rowwise().norm().maxCoeff();
  Rows mean = Rows::Zero(3, basis.cols());
  for (const int id : ids) mean += basis.middleRows<3>(3 * id) / static_cast<double>(ids.size());
  Eigen::RowVectorXd deviation = Eigen::RowVectorXd::Zero(basis.cols());
  for (const int id : ids) deviation = deviation.cwiseMax((basis.middleRows<3>(3 * id) - mean).colwise().norm());
  node.deviation_norm = largest_norm(basis, order, node.first, node.last, mean);
  const Eigen::Index index = deviations_.rows();
  means_.conservativeResize(3 * (index + 1), basis.cols());
  means_.bottomRows<3>() = mean;
  deviations_.conservativeResize(index + 1, basis.cols());
  deviations_.bottomRows<1>() = deviation;
}

ContactState ContactSet::make_state(std::size_t obstacle_count) const {
  return {std::vector<HeldContact>(obstacle_count * static_cast<std::size_t>(vertices())), 0};
}

double ContactSet::travel_bound(const BodyPose& pose, const BodyVelocity& velocity, double time_step) const noexcept {
  const double reach = reach_ + basis_norm_ * pose.q.norm();
  return time_step * (velocity.linear.norm() + velocity.angular.norm() * reach + basis_norm_ * velocity.v.norm());
}

bool ContactSet::body_is_near(const BodyPose& pose, double q_norm, double margin,
                              const ContactWorkspace& workspace) const noexcept {
  const Eigen::Vector3d centre = pose.position + pose.rotation * nodes_.front().centre;
  const double radius = nodes_.front().radius + basis_norm_ * q_norm + margin;
  return std::any_of(workspace.obstacles.begin(), workspace.obstacles.end(),
                     [&](const PlacedObstacle& obstacle) { return obstacle.signed_distance(centre) <= radius; });
}

bool ContactSet::is_near(int node, const BodyPose& pose, double q_norm, double margin,
                         const ContactWorkspace& workspace) const noexcept {
  const Node& ball = nodes_[static_cast<std::size_t>(node)];
  const Eigen::Vector3d moved = ball.centre + means_.middleRows<3>(3 * node).lazyProduct(pose.q);
  const Eigen::Vector3d centre = pose.position + pose.rotation * moved;
  const double spread = std::min(deviations_.row(node).dot(pose.q.cwiseAbs()), ball.deviation_norm * q_norm);
  const double radius = ball.radius + spread + margin;
  return std::any_of(workspace.obstacles.begin(), workspace.obstacles.end(),
                     [&](const PlacedObstacle& obstacle) { return obstacle.signed_distance(centre) <= radius; });
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

void ContactSet::test_vertices(const Node& node, const BodyPose& pose, double margin,
                               ContactWorkspace& workspace) const noexcept {
  for (int vertex = node.first; vertex < node.last; ++vertex) {
    ++workspace.tested_vertices;
    const Eigen::Vector3d point = pose.position + world_arm(vertex, pose);
    for (std::size_t i = 0; i < workspace.obstacles.size(); ++i) {
      if (workspace.obstacles[i].signed_distance(point) > margin) continue;
      ContactCandidate& candidate = workspace.candidates[workspace.candidate_count++];
      candidate.vertex = vertex;
      candidate.obstacle = static_cast<int>(i);
    }
  }
}

void ContactSet::gather(const std::vector<Obstacle>& obstacles, double end_time, double time_step, const BodyPose& pose,
                        double margin, ContactWorkspace& workspace) const noexcept {
  workspace.candidate_count = 0;
  workspace.visited_nodes = workspace.tested_vertices = 0;
  if (nodes_.empty()) return;
  for (std::size_t i = 0; i < obstacles.size(); ++i)
    workspace.obstacles[i] = PlacedObstacle(obstacles[i], end_time, time_step);
  const double q_norm = pose.q.norm();
  if (!body_is_near(pose, q_norm, margin, workspace)) return;
  const auto count = static_cast<int>(nodes_.size());
  for (int node = 0; node < count;) {
    ++workspace.visited_nodes;
    const Node& ball = nodes_[static_cast<std::size_t>(node)];
    const bool near = is_near(node, pose, q_norm, margin, workspace);
    if (near && ball.is_leaf) test_vertices(ball, pose, margin, workspace);
    node = near ? node + 1 : ball.next;
  }
}

void ContactSet::freeze(const BodyPose& pose, const BodyVelocity& velocity, double time_step, const ContactState& state,
                        ContactWorkspace& workspace) const noexcept {
  std::size_t next = 0;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    ContactCandidate& candidate = workspace.candidates[i];
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    const Eigen::Vector3d arm = world_arm(candidate.vertex, pose);
    const Eigen::Vector3d point = pose.position + arm;
    const Eigen::Vector3d predicted = point + time_step * world_velocity(candidate.vertex, arm, pose, velocity);
    freeze_contact(placed, point, predicted, areas_[candidate.vertex], time_step, candidate);
    take_friction(placed, state, next, candidate);
  }
}

void ContactSet::evaluate(const BodyPose& pose, ContactWorkspace& workspace) const noexcept {
  workspace.force.setZero();
  workspace.torque.setZero();
  workspace.generalised.setZero();
  workspace.potential = 0;
  workspace.touching = 0;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    ContactCandidate& candidate = workspace.candidates[i];
    candidate.arm = world_arm(candidate.vertex, pose);
    const Eigen::Vector3d point = pose.position + candidate.arm;
    evaluate_contact(workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)], point, candidate);
    if (candidate.normal_force > 0) ++workspace.touching;
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
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    const ContactCandidate& candidate = workspace.candidates[i];
    const Eigen::Vector3d point = pose.position + world_arm(candidate.vertex, pose);
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    sum += contact_potential(candidate, placed.signed_distance(point), point);
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

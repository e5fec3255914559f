#include "tests/support/sparse_space/vertex_contacts.h"

#include <algorithm>

namespace exmat::precompute {

VertexContacts::VertexContacts(const ContactData& data, const std::vector<std::int32_t>& free_dofs)
    : rest_(data.positions), areas_(data.areas) {
  for (const std::int32_t vertex : data.vertices)
    dofs_.push_back(std::lower_bound(free_dofs.begin(), free_dofs.end(), 3 * vertex) - free_dofs.begin());
}

Eigen::Vector3d VertexContacts::point(int vertex, const Eigen::VectorXd& u) const {
  return rest_.row(vertex).transpose() + u.segment<3>(dofs_[static_cast<std::size_t>(vertex)]);
}

/// True if an obstacle goes through the body in the step rather than up to it.
bool VertexContacts::sweeps(const runtime::PlacedObstacle& placed, const Eigen::VectorXd& u) const {
  const double limit = runtime::kSweep * runtime::shortest_passage(placed.obstacle->shape);
  for (int vertex = 0; vertex < vertices(); ++vertex)
    if (placed.sweep(point(vertex, u), 0) > limit) return true;
  return false;
}

VertexContacts::Step VertexContacts::begin(const runtime::Obstacles& obstacles, double end_time, double time_step,
                                           const Eigen::VectorXd& u, const Eigen::VectorXd& v, double extra,
                                           const runtime::ContactState& held) const {
  Step step;
  for (const auto& obstacle : obstacles) step.obstacles.emplace_back(*obstacle, end_time, time_step);
  for (auto& placed : step.obstacles) placed.sweeps = placed.obstacle->motion.moves() && sweeps(placed, u);
  double speed = 0;
  for (const Eigen::Index dof : dofs_) speed = std::max(speed, v.segment<3>(dof).norm());
  const double margin = runtime::kContactMarginSteps * time_step * speed + extra + held.longest_way_out();
  std::size_t next = 0;
  for (int vertex = 0; vertex < vertices(); ++vertex)
    for (std::size_t i = 0; i < obstacles.size(); ++i) {
      const Eigen::Vector3d here = point(vertex, u);
      if (!step.obstacles[i].may_meet(here, 0, margin)) continue;
      runtime::ContactCandidate& candidate = step.candidates.emplace_back();
      candidate.vertex = vertex;
      candidate.obstacle = static_cast<int>(i);
      const Eigen::Vector3d way = time_step * v.segment<3>(dofs_[static_cast<std::size_t>(vertex)]);
      runtime::freeze_contact(
          step.obstacles[i], runtime::find_held(held, next, candidate),
          {.point = here, .predicted = here + way, .heading = here + 2 * way, .first_step = held.first_step},
          areas_[vertex], time_step, candidate);
    }
  return step;
}

void VertexContacts::evaluate(const Eigen::VectorXd& u, Step& step) const {
  step.force.setZero(u.size());
  step.total_force.setZero();
  step.potential = 0;
  step.touching = 0;
  for (auto& candidate : step.candidates) {
    const Eigen::Vector3d here = point(candidate.vertex, u);
    runtime::evaluate_contact(step.obstacles[static_cast<std::size_t>(candidate.obstacle)], here, candidate);
    if (candidate.normal_force > 0) ++step.touching;
    step.force.segment<3>(dofs_[static_cast<std::size_t>(candidate.vertex)]) += candidate.force;
    step.total_force += candidate.force;
    step.potential += runtime::contact_potential(candidate, candidate.gap, here);
  }
}

double VertexContacts::potential(const Eigen::VectorXd& u, const Step& step) const {
  double sum = 0;
  for (const auto& candidate : step.candidates) {
    const Eigen::Vector3d here = point(candidate.vertex, u);
    sum += runtime::contact_potential(step.obstacles[static_cast<std::size_t>(candidate.obstacle)], candidate, here);
  }
  return sum;
}

void VertexContacts::add_stiffness(const Step& step, LowerTriangle& stiffness) const {
  for (const auto& candidate : step.candidates) {
    const runtime::StiffnessFactors factors(candidate);
    const Eigen::Matrix3d block = factors.used() * factors.used().transpose();
    const Eigen::Index dof = dofs_[static_cast<std::size_t>(candidate.vertex)];
    for (int j = 0; j < 3; ++j)
      for (int i = j; i < 3; ++i) stiffness.coeffRef(dof + i, dof + j) += block(i, j);
  }
}

void VertexContacts::commit(const Eigen::VectorXd& u, const Step& step, runtime::ContactState& held) const {
  held.count = 0;
  for (const auto& candidate : step.candidates)
    runtime::hold_contact(step.obstacles[static_cast<std::size_t>(candidate.obstacle)], point(candidate.vertex, u),
                          candidate, held);
}

}  // namespace exmat::precompute

#include "runtime/api/contact_record.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace exmat::runtime {

void ContactRecord::prepare(const Model& model, std::size_t obstacles) {
  touches_.resize(model.contact ? obstacles * static_cast<std::size_t>(model.contact->vertices()) : 0);
  obstacles_.resize(obstacles);
  clear();
}

void ContactRecord::clear() noexcept {
  count_ = 0;
  std::ranges::fill(obstacles_, ContactLoad{});
  body_ = {};
  steps_ = 0;
}

void ContactRecord::add(const StepReport& report, const Model& model, const State& state,
                        const Workspace& workspace) noexcept {
  ++steps_;
  count_ = 0;
  const bool touched = report.contacts > 0 || !report.contact_force.isZero(0);
  if (!workspace.near || !touched) return;
  const ContactWorkspace& contact = workspace.near->contact;
  body_.force += report.contact_force;
  body_.torque += contact.torque;
  const Eigen::Vector3d centre = model.frame->placement(state.frame).position;
  for (const ContactCandidate& candidate : std::span(contact.candidates).first(contact.candidate_count)) {
    if (candidate.force.isZero(0)) continue;
    const auto obstacle = static_cast<std::size_t>(candidate.obstacle);
    const Eigen::Vector3d position = centre + candidate.arm;
    ContactLoad& load = obstacles_[obstacle];
    load.force -= candidate.force;
    load.torque -= (position - contact.obstacles[obstacle].pose.position).cross(candidate.force);
    if (candidate.normal_force <= 0) continue;
    touches_[count_++] = {model.contact->object_vertex(candidate.vertex),
                          candidate.obstacle,
                          -candidate.gap,
                          position,
                          candidate.direction,
                          candidate.force};
  }
}

ContactLoad ContactRecord::mean(const ContactLoad& sum) const noexcept {
  if (steps_ == 0) return {};
  const auto steps = static_cast<double>(steps_);
  return {sum.force / steps, sum.torque / steps};
}

}  // namespace exmat::runtime

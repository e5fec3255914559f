#include "runtime/sim/step/divided_step.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace exmat::runtime {
namespace {

void count_in_parts(int parts, Motion& motion) noexcept {
  motion.step *= parts;
  motion.begins_anew = motion.begins_anew || parts > 1;  // what was a step ago is no part ago
}

/// After all parts of a step that began with `start`.
void count_as_one(const Motion& start, double time_step, Motion& motion) noexcept {
  motion.step = start.step + 1;
  motion.time = static_cast<double>(motion.step) * time_step;
  motion.q_previous = start.q;
  motion.v_previous = start.v;
  motion.begins_anew = true;
}

/// Adds the report of one of so many parts.
void add(const StepReport& part, int parts, StepReport& sum) noexcept {
  sum.status |= part.status;
  sum.newton_iterations += part.newton_iterations;
  sum.factorisations += part.factorisations;
  sum.line_search_evaluations += part.line_search_evaluations;
  sum.projections += part.projections;
  sum.target_iterations += part.target_iterations;
  sum.contacts = part.contacts;
  sum.contact_force += part.contact_force / parts;
  sum.residual = std::max(sum.residual, part.residual);
}

/// Puts a frame between its places at the ends of the whole step.
void move_frame(const Attachment& whole, double share, Attachment& frame) noexcept {
  const Eigen::Quaterniond from(whole.rotation_before), to(whole.rotation);
  frame.position =
      share == 1 ? whole.position : whole.position_before + share * (whole.position - whole.position_before);
  frame.rotation = share == 1 ? whole.rotation : from.slerp(share, to).toRotationMatrix();
}

}  // namespace

bool has_no_solution(const NewtonReport& newton, const NewtonSettings& settings) noexcept {
  constexpr NewtonSettings kDefault;
  if (newton.status == NewtonStatus::kConverged || settings.max_iterations < kDefault.max_iterations) return false;
  return newton.status == NewtonStatus::kNonFinite || newton.status == NewtonStatus::kAboveStart ||
         !(newton.residual < kDefault.tolerance * newton.force_scale);
}

void DividedStep::begin(int parts) {
  parts_ = parts;
  part_.reset();
  if (parts > 1) part_.emplace(whole_).time_step /= parts;
  state_ = start_;
  count_in_parts(parts, state_);
  if (state_.full) count_in_parts(parts, *state_.full);
  sum_ = {};
}

void DividedStep::begin_part(int part) noexcept {
  const double share = static_cast<double>(part + 1) / parts_;
  for (std::size_t k = 0; k < start_.attachments.size(); ++k) {
    Attachment& own = state_.attachments[k];
    if (own.motion)
      own.follow(state_.time, static_cast<double>(state_.step + 1) * scene().time_step);
    else if (own.is_framed())
      move_frame(start_.attachments[k], share, own);
  }
}

void DividedStep::end_part(const StepReport& report) noexcept { add(report, parts_, sum_); }

StepReport DividedStep::end() noexcept {
  part_.reset();
  count_as_one(start_, whole_.time_step, state_);
  if (state_.full) count_as_one(*start_.full, whole_.time_step, *state_.full);
  state_.sleep.still_steps = std::min(state_.sleep.still_steps, start_.sleep.still_steps + 1);
  for (std::size_t k = 0; k < start_.attachments.size(); ++k)
    state_.attachments[k].mean_before = start_.attachments[k].mean;
  sum_.status |= kStepDivided;
  return sum_;
}

}  // namespace exmat::runtime

#include "runtime/api/body_steps.h"

#include <algorithm>
#include <cinttypes>

#include "runtime/api/failures.h"
#include "runtime/api/world_handle.h"

namespace exmat::runtime {
namespace {

/// True where an attachment holds it, of its own or of another body of its world.
bool is_attached(const exmat_body& body) noexcept {
  return std::ranges::any_of(body.world->members, [&](const exmat_world::Member& member) {
    return std::ranges::any_of(member.body->state.attachments, [&](const Attachment& attachment) {
      return member.body == &body || (attachment.other && attachment.other->body == place_of(body));
    });
  });
}

}  // namespace

void begin_steps(exmat_body& body) noexcept {
  body.report = empty_report();
  body.contacts.clear();
}

void add_step(const StepReport& step, exmat_body& body) noexcept {
  exmat_report& sum = body.report;
  sum.status |= step.status;
  sum.newton_iterations += step.newton_iterations;
  sum.factorisations += step.factorisations;
  sum.line_search_evaluations += step.line_search_evaluations;
  sum.projections += step.projections;
  sum.target_iterations += step.target_iterations;
  sum.residual = step.residual;
  if ((step.status & kStepNonFinite) == 0) ++sum.steps;
}

exmat_status fail_non_finite(const char* function, const char* which, const exmat_body& body) noexcept {
  return fail(EXMAT_NON_FINITE,
              "%s: %s, step %" PRId64
              " (t = %g s): NaN or infinity; the body is as it was before. Try a smaller "
              "time_step (now %g s), smaller loads or example stiffness%s, or backward Euler",
              function, which, body.state.step + 1, body.state.time + body.scene.time_step, body.scene.time_step,
              is_attached(body) ? ", softer attachments or slower frames" : "");
}

}  // namespace exmat::runtime

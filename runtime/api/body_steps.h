#pragma once

#include "runtime/api/handles.h"
#include "runtime/scene/reach_loader.h"

namespace exmat::runtime {

// Helpers of the functions that step bodies.

/// Only one caller at a time may step a body; whether this one may.
inline bool acquire(exmat_body& body) noexcept { return !body.in_use.test_and_set(std::memory_order_acquire); }
inline void release(exmat_body& body) noexcept { body.in_use.clear(std::memory_order_release); }

/// Before the first step of a call.
void begin_steps(exmat_body& body) noexcept;

/// Before each of its steps: what its scene keys in time.
inline void apply_keys(exmat_body& body) noexcept {
  body.source->loaded.keys.apply(body.model(), body.state.step, body.scene);
}

/// Likewise: the weights of a body that reaches for something.
inline void choose_weights(exmat_body& body) {
  if (!body.reach) return;
  if (body.reaches_by_scene) move_targets(*body.source->loaded.reach, body.scene, body.state, *body.reach);
  body.reach->choose_weights(body.scene);
}

/// After each of its steps.
void add_step(const StepReport& step, exmat_body& body) noexcept;

/// After the last step of a call: the lost work of a body that has a capacity.
void measure_lost_work(exmat_body& body) noexcept;

inline bool non_finite(const exmat_body& body) noexcept { return (body.report.status & kStepNonFinite) != 0; }
exmat_status fail_non_finite(const char* function, const char* which, const exmat_body& body) noexcept;

}  // namespace exmat::runtime

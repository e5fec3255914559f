#pragma once

#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

// A body that rests is left alone until something acts on it. docs/step_in_detail.md, "Sleep". No call allocates or
// throws.

/// True if the body sleeps through its next step. Wakes one that something acts on.
bool sleeps(const Model& model, const StepScene& scene, State& state) noexcept;

/// That step: time goes on, and nothing else.
StepReport sleep_through(const StepScene& scene, State& state) noexcept;

/// After something was done to the body that no step would see.
void wake(State& state) noexcept;

/// After a step that reports this: counts how long the body has been still. True once it has been for long enough.
bool rests(const Model& model, const StepScene& scene, const StepReport& report, State& state) noexcept;

/// It stands still, and sleeps from the next step on.
void put_to_sleep(const Model& model, State& state, Workspace& workspace) noexcept;

}  // namespace exmat::runtime

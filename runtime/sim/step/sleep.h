#pragma once

#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

// A body that rests is left alone until something acts on it. docs/step_in_detail.md, "Sleep". No call allocates or
// throws.

/// Whether the body's next step is one that it sleeps through. Wakes one that something acts on.
bool sleeps(const Model& model, const StepScene& scene, State& state) noexcept;

/// That step: time goes on, and nothing else.
StepReport sleep_through(const StepScene& scene, State& state) noexcept;

/// After something was done to the body that no step would see.
void wake(State& state) noexcept;

/// After a step: counts how long the body has been still, and puts it to sleep.
void fall_asleep(const Model& model, const StepScene& scene, State& state, Workspace& workspace,
                 StepReport& report) noexcept;

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>

#include "runtime/sim/step/model.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/state.h"
#include "runtime/sim/step/step_report.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// Advances a body by one time step: qddot + (alpha I + beta K) qdot + f_int(q) = f_ext + f_example, for a free body
/// with the forces of its rotation, near obstacles with those of its contacts. A step that has no solution is taken in
/// parts (DividedStep), which allocates; else no allocation, no exception. docs/step_in_detail.md.
StepReport step(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept;

/// After q or v of `state` were set: what its frame carries follows (BodyFrame::follow).
void follow_frame(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept;

/// Sets how a free body moves; its q and v stay. The anchors of its friction go with it, so that a body that is held
/// stays so where it is put. False, and nothing is done, for other bodies.
bool move_body(const Model& model, const StepScene& scene, const FrameMotion& motion, State& state,
               Workspace& workspace) noexcept;

/// Example weights of a state that no step has led to, for its output.
void refresh_weights(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept;

struct Energies {
  double kinetic = 0;    ///< motion of the whole body in the world [J]
  double elastic = 0;    ///< E(q) [J]
  double potential = 0;  ///< potential of gravity, 0 at rest [J]
  double contact = 0;    ///< springs of contacts and attachments between the bodies of a world [J]

  double total() const { return kinetic + elastic + potential + contact; }
};
Energies energies(const Model& model, const StepScene& scene, const State& state) noexcept;

}  // namespace exmat::runtime

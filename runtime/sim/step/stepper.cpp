#include "runtime/sim/step/stepper.h"

#include "runtime/sim/step/body_step.h"
#include "runtime/sim/step/contact_step.h"
#include "runtime/sim/step/divided_step.h"
#include "runtime/sim/step/example_forces.h"
#include "runtime/sim/step/sleep.h"

namespace exmat::runtime {
namespace {

StepReport step_in_parts(const Model& model, const StepScene& scene, State& state, Workspace& workspace) {
  DividedStep divided(scene, state);
  StepReport last;
  const auto take = [&](int part) {
    divided.begin_part(part);
    BodyStep step(model, divided.scene(), state, workspace);
    step.begin(/*touches_others=*/false);
    last = step.finish(step.solve());
    divided.end_part(last);
    return last.status;
  };
  if (take_in_parts([&](int parts) { divided.begin(parts); }, take)) return divided.end();
  take(0);
  return last;
}

}  // namespace

StepReport step(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  if (sleeps(model, scene, state)) return sleep_through(scene, state);
  BodyStep step(model, scene, state, workspace);
  step.begin(/*touches_others=*/false);
  const NewtonReport newton = step.solve();
  return has_no_solution(newton, scene.newton) ? step_in_parts(model, scene, state, workspace) : step.finish(newton);
}

void refresh_weights(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  evaluate_weights(model, scene, state.q, workspace);
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (acts(scene.examples[i]) && is_driven(scene.examples[i]))
      drive(scene.examples[i].drivers, *model.skeleton, state.full->skeleton->bones, workspace.examples[i].weights);
  commit_weights(scene, workspace, state);
}

bool move_body(const Model& model, const StepScene& scene, const FrameMotion& motion, State& state,
               Workspace& workspace) noexcept {
  const Placement before = model.frame->placement(state.frame);
  if (!model.frame->set_motion(motion, state.q, state.v, workspace.frame, state.frame)) return false;
  carry_contacts(scene, before, model.frame->placement(state.frame), state);
  state.contacts.first_step = state.begins_anew = true;
  return true;
}

void follow_frame(const Model& model, const StepScene& scene, State& state, Workspace& workspace) noexcept {
  model.frame->follow(scene, state.time, state.q, state.v, workspace.frame, state.frame);
}

Energies energies(const Model& model, const StepScene& scene, const State& state) noexcept {
  return {model.frame->kinetic_energy(state.v, state.frame), state.elastic_energy,
          -scene.gravity_force.dot(state.q) + model.frame->potential_energy(scene.gravity, state.frame), 0};
}

}  // namespace exmat::runtime

#include "runtime/sim/step/sleep.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "runtime/sim/step/body_step.h"

namespace exmat::runtime {
namespace {

/// A hash of numbers, word by word.
class WordHash {
 public:
  void add(double number) noexcept {
    value_ = (value_ ^ std::bit_cast<std::uint64_t>(number)) * 0x9e3779b97f4a7c15U;
    value_ ^= value_ >> 32U;
  }
  void add_all(const auto& numbers) noexcept {
    for (const double number : numbers) add(number);
  }
  /// 53 bits, which any number of a file holds.
  std::uint64_t value() const noexcept { return value_ >> 11U; }

 private:
  std::uint64_t value_ = 0x243f6a8885a308d3U;
};

/// Hash of all loads on the body that have a value at any time.
std::uint64_t hash_of_loads(const StepScene& scene, const State& state) noexcept {
  WordHash hash;
  hash.add_all(scene.gravity);
  hash.add_all(scene.gravity_force);
  hash.add_all(state.applied_force);
  if (const auto* free = std::get_if<FreeState>(&state.frame)) {
    hash.add_all(free->applied_force);
    hash.add_all(free->applied_torque);
  }
  for (const ExampleSettings& examples : scene.examples) {
    for (const double number : {examples.stiffness, examples.damping, examples.bias}) hash.add(number);
    hash.add_all(examples.given_weights);
  }
  return hash.value();
}

/// True if an obstacle that the body may meet moves in this step.
bool is_met(const Model& model, const StepScene& scene, const State& state) noexcept {
  if (!touches(model, scene)) return false;
  const double end = static_cast<double>(state.step + 1) * scene.time_step;
  return std::ranges::any_of(scene.obstacles, [&](const SharedObstacle& obstacle) {
    if (!obstacle->motion.moves()) return false;
    const PlacedObstacle placed(*obstacle, end, scene.time_step);
    if (placed.start.position == placed.pose.position && placed.start.rotation == placed.pose.rotation) return false;
    return model.contact->may_meet(placed, {model.frame->placement(state.frame), state.q});
  });
}

}  // namespace

void wake(State& state) noexcept {
  if (state.sleep.asleep) state.begins_anew = true;
  state.sleep = {};
}

bool sleeps(const Model& model, const StepScene& scene, State& state) noexcept {
  if (!state.sleep.asleep) return false;
  const bool is_left_alone = scene.sleep.energy > 0 && !begins_anew(model, scene, state) &&
                             hash_of_loads(scene, state) == state.sleep.loads && !is_met(model, scene, state);
  if (!is_left_alone) wake(state);
  return is_left_alone;
}

StepReport sleep_through(const StepScene& scene, State& state) noexcept {
  ++state.step;
  state.time = static_cast<double>(state.step) * scene.time_step;
  StepReport report;
  report.status = kStepAsleep;
  return report;
}

bool rests(const Model& model, const StepScene& scene, const StepReport& report, State& state) noexcept {
  if (model.skeleton || is_held(state.attachments)) return false;  // its host may move it in any step
  if (scene.sleep.energy == 0 || model.frame->is_driven()) return false;
  const bool is_solved = (report.status & (kStepNonFinite | kStepUnconverged)) == 0;
  const std::uint64_t loads = hash_of_loads(scene, state);
  const bool is_still = is_solved && loads == state.sleep.loads &&
                        model.frame->kinetic_energy(state.v, state.frame) < scene.sleep.energy &&
                        !is_met(model, scene, state);
  state.sleep.loads = loads;
  state.sleep.still_steps = is_still ? state.sleep.still_steps + 1 : 0;
  return is_still && static_cast<double>(state.sleep.still_steps) * scene.time_step >= scene.sleep.time;
}

void put_to_sleep(const Model& model, State& state, Workspace& workspace) noexcept {
  state.q_previous = state.q;
  state.v.setZero();
  state.v_previous.setZero();
  state.a.setZero();
  FrameMotion motion = model.frame->motion(state.frame);
  motion.linear_velocity.setZero();
  motion.angular_velocity.setZero();
  model.frame->set_motion(motion, state.q, state.v, workspace.frame, state.frame);
  state.begins_anew = false;
  state.sleep.asleep = true;
}

}  // namespace exmat::runtime

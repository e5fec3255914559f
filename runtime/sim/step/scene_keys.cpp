#include "runtime/sim/step/scene_keys.h"

#include <algorithm>
#include <utility>

namespace exmat::runtime {
namespace {

/// The time whose value a step takes.
double time_of(const KeyedSetting& setting, double midpoint, double end) noexcept {
  return setting.interpolation() == Interpolation::kStep ? midpoint : end;
}

void sample_number(const KeyedSetting& setting, double midpoint, double end, double& number) noexcept {
  if (setting.empty()) return;
  Eigen::Map<Eigen::VectorXd> value(&number, 1);
  setting.sample(time_of(setting, midpoint, end), value);
}

bool any_jumps(const ExampleKeys& keys, double from, double to) noexcept {
  return keys.stiffness.jumps(from, to) || keys.damping.jumps(from, to) || keys.bias.jumps(from, to) ||
         keys.weights.jumps(from, to);
}

}  // namespace

KeyedSetting::KeyedSetting(std::vector<double> times, RowMatrix values, Interpolation interpolation)
    : times_(std::move(times)), values_(std::move(values)), interpolation_(interpolation) {}

/// The last key at or before the time, the first where there is none.
Eigen::Index KeyedSetting::segment(double time) const noexcept {
  const auto after = std::upper_bound(times_.begin(), times_.end(), time);
  return std::max<std::ptrdiff_t>(0, after - times_.begin() - 1);
}

void KeyedSetting::sample(double time, Eigen::Ref<Eigen::VectorXd> value) const noexcept {
  const Eigen::Index key = segment(time);
  value = values_.row(key).transpose();
  if (interpolation_ == Interpolation::kStep || key + 1 == values_.rows()) return;
  const double start = times_[static_cast<std::size_t>(key)], end = times_[static_cast<std::size_t>(key) + 1];
  const double share = std::clamp((time - start) / (end - start), 0.0, 1.0);
  value += share * (values_.row(key + 1) - values_.row(key)).transpose();
}

bool KeyedSetting::jumps(double from, double to) const noexcept {
  if (empty() || interpolation_ != Interpolation::kStep) return false;
  const Eigen::Index before = segment(from), after = segment(to);
  return before != after && values_.row(before) != values_.row(after);
}

bool SceneKeys::empty() const noexcept {
  return gravity.empty() && std::ranges::all_of(examples, [](const ExampleKeys& keys) { return keys.empty(); });
}

void SceneKeys::set(const Model& model, double midpoint, double end, StepScene& scene) const noexcept {
  if (!gravity.empty()) {
    const bool is_free = model.frame->rigid_unknowns() > 0;
    gravity.sample(is_free ? midpoint : time_of(gravity, midpoint, end), scene.gravity);
    scene.gravity_force.noalias() = model.gravity_load.transpose() * scene.gravity;
  }
  for (std::size_t i = 0; i < examples.size(); ++i) {
    const ExampleKeys& keys = examples[i];
    ExampleSettings& settings = scene.examples[i];
    sample_number(keys.stiffness, midpoint, end, settings.stiffness);
    sample_number(keys.damping, midpoint, end, settings.damping);
    sample_number(keys.bias, midpoint, end, settings.bias);
    if (!keys.weights.empty()) keys.weights.sample(time_of(keys.weights, midpoint, end), settings.given_weights);
  }
}

bool SceneKeys::jumps(double from, double to) const noexcept {
  return gravity.jumps(from, to) ||
         std::ranges::any_of(examples, [&](const ExampleKeys& keys) { return any_jumps(keys, from, to); });
}

void SceneKeys::apply(const Model& model, std::int64_t steps, StepScene& scene) const noexcept {
  if (empty()) return;
  const double dt = scene.time_step, start = static_cast<double>(steps) * dt, midpoint = start + 0.5 * dt;
  set(model, midpoint, static_cast<double>(steps + 1) * dt, scene);
  scene.begins_anew = jumps(midpoint - dt, midpoint);
}

void SceneKeys::apply_start(const Model& model, StepScene& scene) const noexcept { set(model, 0, 0, scene); }

}  // namespace exmat::runtime

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

void SceneKeys::set(bool is_free, double midpoint, double end, Eigen::Vector3d& gravity_now,
                    std::span<ExampleSettings> examples_now) const noexcept {
  if (!gravity.empty()) gravity.sample(is_free ? midpoint : time_of(gravity, midpoint, end), gravity_now);
  for (std::size_t i = 0; i < examples.size(); ++i) {
    const ExampleKeys& keys = examples[i];
    ExampleSettings& settings = examples_now[i];
    sample_number(keys.stiffness, midpoint, end, settings.stiffness);
    sample_number(keys.damping, midpoint, end, settings.damping);
    sample_number(keys.bias, midpoint, end, settings.bias);
    if (!keys.weights.empty()) keys.weights.sample(time_of(keys.weights, midpoint, end), settings.given_weights);
  }
}

void SceneKeys::set_gravity_force(const Model& model, StepScene& scene) const noexcept {
  if (!gravity.empty()) scene.gravity_force.noalias() = model.gravity_load.transpose() * scene.gravity;
}

bool SceneKeys::jumps(double from, double to) const noexcept {
  return gravity.jumps(from, to) ||
         std::ranges::any_of(examples, [&](const ExampleKeys& keys) { return any_jumps(keys, from, to); });
}

bool SceneKeys::apply(bool is_free, std::int64_t steps, double time_step, Eigen::Vector3d& gravity_now,
                      std::span<ExampleSettings> examples_now) const noexcept {
  const double start = static_cast<double>(steps) * time_step, midpoint = start + 0.5 * time_step;
  set(is_free, midpoint, static_cast<double>(steps + 1) * time_step, gravity_now, examples_now);
  return jumps(midpoint - time_step, midpoint);
}

void SceneKeys::apply_start(Eigen::Vector3d& gravity_now, std::span<ExampleSettings> examples_now) const noexcept {
  set(false, 0, 0, gravity_now, examples_now);
}

void SceneKeys::apply(const Model& model, std::int64_t steps, StepScene& scene) const noexcept {
  if (empty()) return;
  const bool is_free = model.frame->rigid_unknowns() > 0;
  scene.begins_anew = apply(is_free, steps, scene.time_step, scene.gravity, scene.examples);
  set_gravity_force(model, scene);
}

void SceneKeys::apply_start(const Model& model, StepScene& scene) const noexcept {
  apply_start(scene.gravity, scene.examples);
  set_gravity_force(model, scene);
}

}  // namespace exmat::runtime

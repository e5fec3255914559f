#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/choices.h"
#include "runtime/sim/step/scene.h"

namespace exmat::runtime {

/// A setting that changes at given times; before the first and after the last it has their values.
class KeyedSetting {
 public:
  KeyedSetting() = default;
  /// `times` ascend strictly [s], one or more; `values` [times x columns].
  KeyedSetting(std::vector<double> times, RowMatrix values, Interpolation interpolation);

  bool empty() const noexcept { return times_.empty(); }
  const std::vector<double>& times() const noexcept { return times_; }
  Interpolation interpolation() const noexcept { return interpolation_; }

  /// Into `value` [columns], which has its size.
  void sample(double time, Eigen::Ref<Eigen::VectorXd> value) const noexcept;
  /// True if it is another at `to` than at `from` without anything between.
  bool jumps(double from, double to) const noexcept;

 private:
  Eigen::Index segment(double time) const noexcept;

  std::vector<double> times_;
  RowMatrix values_;
  Interpolation interpolation_ = Interpolation::kLinear;
};

/// Those of one example force; empty ones leave the setting alone.
struct ExampleKeys {
  KeyedSetting stiffness, damping, bias, weights;

  bool empty() const noexcept { return stiffness.empty() && damping.empty() && bias.empty() && weights.empty(); }
};

/// The settings of a scene that change in time. What steps read of them: those that jump, as scripted forces, the value
/// of the middle of the step; others that of its end, where the step balances forces, but gravity of a free body that
/// of its middle, which makes its momentum exact.
struct SceneKeys {
  KeyedSetting gravity;
  std::vector<ExampleKeys> examples;  ///< one for each of the scene's, or none

  bool empty() const noexcept;

  /// Puts a scene into what the step after `steps` of them reads, and lets it begin anew where something jumps. No
  /// allocation, no exception.
  void apply(const Model& model, std::int64_t steps, StepScene& scene) const noexcept;
  /// The values at time 0, for what is shown of a start.
  void apply_start(const Model& model, StepScene& scene) const noexcept;

  /// The same for a body without a Model: sets its gravity [m/s^2] and its example forces, one for each of `examples`,
  /// for a step of `time_step` [s]. True if a setting jumps in it. `is_free`: nothing holds or carries the body.
  bool apply(bool is_free, std::int64_t steps, double time_step, Eigen::Vector3d& gravity_now,
             std::span<ExampleSettings> examples_now) const noexcept;
  void apply_start(Eigen::Vector3d& gravity_now, std::span<ExampleSettings> examples_now) const noexcept;

 private:
  void set(bool is_free, double midpoint, double end, Eigen::Vector3d& gravity_now,
           std::span<ExampleSettings> examples_now) const noexcept;
  void set_gravity_force(const Model& model, StepScene& scene) const noexcept;
  bool jumps(double from, double to) const noexcept;
};

}  // namespace exmat::runtime

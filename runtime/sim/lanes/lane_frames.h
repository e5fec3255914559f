#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "runtime/sim/lanes/lane_rotation.h"
#include "runtime/sim/step/model.h"
#include "runtime/sim/step/workspace.h"

namespace exmat::runtime {

/// The frames of kLanes bodies of one model, whose workspaces come with each call: those of free bodies side by side,
/// others one after the other. What is asked of frames: BodyFrame. Sized once. No call allocates or throws.
class LaneFrames {
 public:
  explicit LaneFrames(const Model& model);

  bool exert_forces() const noexcept { return exert_forces_; }

  /// After its frame began a step; `lane` may be one without a body, which repeats another.
  void set_problem(Eigen::Index lane, const Workspace& body) noexcept;
  /// Once the problems are set; velocities are c_v (q - q_v), numbers and vectors that stay.
  void begin(const LaneNumbers& velocity_factor, const LaneVectors& velocity_centre) noexcept;

  // Functions of the lanes that are chosen (not zero).

  /// `gradient` [r] = minus the forces at q; 1 where a frame has a motion for it, else 0.
  LaneNumbers update(std::span<Workspace* const> bodies, const LaneNumbers& chosen, const LaneVectors& q,
                     LaneVectors& gradient) noexcept;
  void add_stiffness(std::span<Workspace* const> bodies, const LaneNumbers& chosen, AlignedArray& hessian) noexcept;
  LaneNumbers gyroscopic_ratios(std::span<Workspace* const> bodies) const noexcept;
  void gyroscopic_products(std::span<Workspace* const> bodies, const LaneNumbers& chosen, const LaneVectors& x,
                           LaneVectors& products) noexcept;

  /// Hands a lane's results to the end of its body's step.
  void take(Eigen::Index lane, Workspace& body) const noexcept;

 private:
  const BodyFrame* frame_;
  bool exert_forces_;
  std::optional<LaneRotation> rotation_;  // of free bodies
  Eigen::MatrixXd stiffness_;             // of one body, of the others
};

}  // namespace exmat::runtime

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

  /// A body near obstacles, after BodyFrame::begin_contact().
  void begin_contact(Eigen::Index lane) noexcept;

  // Functions of the lanes that are chosen (not zero). `meeting`: not zero for bodies near obstacles, which
  // BodyFrame::place() has put where they are; what rigid_gradient() and end_contact() take is in their workspaces
  // after update().

  /// `gradient` [r] = minus the forces at q; 1 where a frame has a motion for it, else 0.
  LaneNumbers update(std::span<Workspace* const> bodies, const LaneNumbers& chosen, const LaneNumbers& meeting,
                     const LaneVectors& q, LaneVectors& gradient) noexcept;
  void add_stiffness(std::span<Workspace* const> bodies, const LaneNumbers& chosen, const LaneNumbers& meeting,
                     AlignedArray& hessian) noexcept;
  /// Sets the rows of rigid unknowns behind the modes, as add_rigid_hessian() without contacts; 1 in lanes that are not
  /// near obstacles.
  void set_rigid_rows(std::span<Workspace* const> bodies, const LaneNumbers& meeting,
                      AlignedArray& hessian) const noexcept;
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

#pragma once

#include <Eigen/Core>

#include "runtime/sim/frame/free_motion.h"
#include "runtime/sim/lanes/lane_numbers.h"

namespace exmat::runtime {

/// The rotation of kLanes free bodies within one step, side by side: what free_motion.h does for one. Sized once;
/// refers to the inertia. A body that turns by a radian or more in a step has no spin here. No call allocates or
/// throws.
class LaneRotation {
 public:
  explicit LaneRotation(const DeformingInertia& inertia);

  /// The problem of one body, as begin_rotation() set it.
  void set_problem(Eigen::Index lane, const FreeMotionWorkspace& body) noexcept;
  /// Once the problems are set; velocities are c_v (q - q_v), numbers [kLanes] and vectors [r] that stay.
  void begin(const LaneNumbers& velocity_factor, const LaneVectors& velocity_centre) noexcept;

  /// A body whose spin is given, as near obstacles: it is active in no update.
  void begin_given(Eigen::Index lane) noexcept;
  /// Its turn and spin, before each update.
  void give(Eigen::Index lane, const FreeMotionWorkspace& body) noexcept;

  /// force [r] of the poses q. Spins of the lanes that are active (not zero) are found anew from the last ones; 1 where
  /// there is one, else 0.
  LaneNumbers update(const LaneNumbers& active, const LaneVectors& q, LaneVectors& force) noexcept;
  /// Adds to the Hessians [lane_triangle(r)] of the chosen (not zero), whose gyroscopic product is that of this pose
  /// from now on; to those of the others anything, but for bodies whose spin is given: what softens those.
  void add_stiffness(const LaneNumbers& chosen, AlignedArray& hessian) noexcept;
  /// About what the antisymmetric part is of inertia.
  LaneNumbers gyroscopic_ratio() const noexcept;
  /// Its product with x [r], after add_stiffness().
  void gyroscopic_product(const LaneVectors& x, LaneVectors& product) noexcept;

  /// Hands the rotation at the pose last given to the end of a body's step.
  void take(Eigen::Index lane, FreeMotionWorkspace& body) const noexcept;
  /// The inertia of a body there [kg m^2].
  Eigen::Matrix3d inertia(Eigen::Index lane) const noexcept;

 private:
  using Triples = Eigen::Array<double, kLanes, 3>;

  LaneRotationArrays arrays() noexcept;

  const DeformingInertia* inertia_;
  Triples momentum_, offset_, spin_, rotation_;
  LaneNumbers factor_, velocity_factor_;
  const double* velocity_centre_ = nullptr;
  AlignedArray inverse_inertia_, products_, centre_products_, factors_, scratch_;
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "precompute/pipeline/basis_stage.h"
#include "runtime/sim/step/scene.h"

namespace exmat::precompute {

/// Forces and gravity that hold a settled body while an example has all of the weight.
struct SettlingLoad {
  std::string file;                                   ///< whose load it is, for messages
  std::vector<runtime::ExampleSettings> examples;     ///< one for each group, in their order
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [m/s^2]; a body that is not clamped only falls by it
  bool compensate = false;                            ///< shift targets so that the body settles as it would at best
};

/// Distance of a settled body from an example's pose as it was given. Errors are relative to the pose's displacement,
/// by mass; those of a region are of what the region sees.
struct SettledPose {
  std::string region, example;
  bool settles = true;           ///< else all errors are those of the rest pose
  double best = 0;               ///< least error under an example force of any strength, without gravity
  std::optional<double> loaded;  ///< error under the load, where its force acts on these examples
  double distance = 0;           ///< largest of a vertex [m], of `loaded` or else of `best`
  Eigen::Index vertex = 0;       ///< vertex at that distance
  /// Parts: from the pose to what of it the basis can hold, from there to where the body settles at best, since
  /// elasticity decides what eigenfunctions do not see, and from there to where it settles. They add up to no less than
  /// the error.
  double basis = 0, eigenfunctions = 0, force = 0;
  double clamp = 0;  ///< within that of the basis: what putting the fixed vertices back changes
  std::optional<double>
      stronger;  ///< error under the load with ten times the stiffness, where that is the largest part

  bool unheld = false;       ///< that is the largest part although targets are compensated
  bool compensable = false;  ///< examples.compensate would bring the error to about the best, and is off

  double error() const { return loaded.value_or(best); }
};

/// Settles the body of a model by the run time's own step, of one on bones that in all vertices, with each example but
/// the rest pose, and puts the errors into the examples. `load`: absent, only the best is looked for. Where the load is
/// to be compensated, the targets of the whole body's examples are shifted first. A force of another stiffness k
/// settles at q with the force k (g - P_s q), g the target's pull and P_s the filter; with g' = P_s q + k/kappa (g -
/// P_s q) the stiffness kappa has the same force there. k is, of each example, what leaves the least error. Throws
/// InputError where there is no table to shift.
std::vector<SettledPose> settle_examples(const BodyStages& stages, const std::optional<SettlingLoad>& load,
                                         ReducedModel& model);

/// A pose from which the settled body is farther deserves a warning.
inline constexpr double kFarFromPose = 0.25;

/// A sentence: what was found, the parts and, where that is much, what would help. `model` has /object.
std::string to_string(const SettledPose& pose, const ReducedModel& model);

}  // namespace exmat::precompute

#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "common/config/asset_config.h"
#include "common/config/scene_config.h"
#include "runtime/sim/step/scene.h"

namespace exmat::precompute {

/// Law of the plane that a body is thrown at. Per area, as runtime::Obstacle.
struct TrainingObstacle {
  double stiffness = 0, damping = 0, friction = 0;
};

/// Loads on a body in the runs that its basis and cubature learn from: of a scene, of the asset, or of neither.
/// Runs vary all of it (training_segments.h).
struct TrainingLoads {
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();   ///< [m/s^2]
  bool any_gravity = false;                            ///< it may point anywhere
  std::vector<VertexForceConfig> forces;               ///< act on vertices of the object; those with an end may cease
  bool any_direction = false;                          ///< forces may point anywhere
  bool patches = false;                                ///< forces on patches of the surface chosen at random, too
  std::vector<runtime::ExampleSettings> examples;      ///< settings of the model's example forces
  bool any_stiffness = false;                          ///< examples may be much weaker or stronger than these
  std::optional<TrainingObstacle> obstacle;            ///< a free body is thrown at it
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< velocity of the throw; its speed may come of a fall
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();      ///< [rad/s]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  std::optional<double> mass_damping, stiffness_damping;  ///< alpha [1/s], beta [s], where they are known
  double duration = 0;  ///< [s] for which one run has these very loads, forces from their start to their end; 0: none

  /// True if any of it deforms a body: gravity does not where it is free.
  bool deforms(bool free) const;
};

/// A body as far as loads depend on it.
struct TrainingBody {
  bool free = false;
  double size = 0;                    ///< L [m]
  double angular_frequency = 0;       ///< omega_1, of the lowest linear mode [rad/s]
  std::vector<std::string> groups{};  ///< regions of its example forces by name; empty: the whole body
};

/// The loads of a scene. A body that a motion carries feels gravity that points anywhere, for its inertia.
TrainingLoads scene_loads(const SceneConfig& scene, const TrainingBody& body);

/// The loads that the asset declares, and where it leaves them open what `unknown_loads` takes; `forces` are the
/// vertices of the declared forces.
TrainingLoads declared_loads(const LoadsConfig& loads, const std::vector<std::vector<std::int64_t>>& forces,
                             const TrainingBody& body);

/// Examples of all strengths, gravity and patches of the surface: what is taken where nothing is known.
TrainingLoads unknown_loads(const TrainingBody& body);

/// Loads that a build learns from, and why.
struct TrainingPlan {
  TrainingLoads loads;
  bool general = false;  ///< the basis is to serve other loads, too
  std::string reason;    ///< whose loads these are, or why there are none
};

/// As basis.training says; `scene` may be none. Throws InputError (without a file) where it names a scene and there is
/// none.
TrainingPlan plan_training(const TrainingConfig& config, const SceneConfig* scene,
                           const std::vector<std::vector<std::int64_t>>& forces, const TrainingBody& body);

/// Largest logarithm of the ratio of the runs' stiffness to that of TrainingLoads::examples, either way, and largest
/// difference of their bias.
constexpr double stiffness_spread(const TrainingLoads& loads) { return loads.any_stiffness ? 2.0 : 0.7; }
inline constexpr double kBiasSpread = 0.3;

/// LoadKind::name of gravity.
inline constexpr const char* kGravity = "gravity";

/// One kind of the loads on a body, without the others.
struct LoadKind {
  std::string name;
  TrainingLoads loads;
};
/// The kinds that act on a body: gravity unless it is free, example forces, pushes, throws of a free one.
std::vector<LoadKind> kinds_of(const TrainingLoads& loads, bool free);

/// All of it, for hashes.
std::string text_of(const TrainingLoads& loads);

}  // namespace exmat::precompute

#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/study/stability/checks.h"
#include "runtime/sim/step/scene.h"
#include "tests/stability/suite_bodies.h"

namespace exmat::precompute {

/// Start of a run. All but the first two are the reduced poses nearest to a field on the vertices.
enum class Start {
  kRest,
  kImpulse,    ///< at rest in shape, the free end struck
  kFlattened,  ///< all vertices in one plane across the bar
  kCollapsed,  ///< all vertices in one point
  kInverted,   ///< mirrored in that plane
  kTangled,    ///< random reduced coordinates
};

/// Obstacle that a body may touch.
enum class Ground {
  kNone,
  kPlane,    ///< below it
  kPress,    ///< a plane below and one above that comes down to it, and goes up again
  kMesh,     ///< a slab of triangles below it, a tenth of L thick
  kHills,    ///< a height field below it
  kSphere,   ///< one of radius 2 L below it
  kCapsule,  ///< one of radius 2 L, which lies across it, below it
  kBox,      ///< a box a tenth of L thick below it
};

/// Company of the body, which touches it.
enum class Company {
  kNone,
  kPile,     ///< two more of its kind, across each other above it
  kPair,     ///< another that it meets head on, off the centre
  kCarried,  ///< one that a motion swings through it, and back
  kItself,   ///< parts of its own surface
};

/// One run. L is the diagonal of the body's bounding box, w_1 its lowest frequency.
struct StabilityCase {
  std::string group{};
  std::string extreme{};  ///< the extreme in it, in words
  BodySpec body{};
  Integrator integrator = Integrator::kBdf2;
  Precision precision = Precision::kDouble;  ///< mixed: it steps as instances do, in lanes
  Space space = Space::kReduced;             ///< full: all vertices of its mesh; auto: these where something acts
  double time_step = 1e-3;                   ///< [s]
  double gravity = 0;                        ///< along -z [m/s^2]
  /// Force on the free end in the first kLoadSteps steps, in units of what would move it by L in linear elasticity.
  Eigen::Vector3d tip_load = Eigen::Vector3d::Zero();
  Start start = Start::kRest;
  Eigen::Vector3d impulse =
      Eigen::Vector3d::Zero();          ///< kImpulse's; in units of what moves a vertex by L in linear elasticity
  double reach = 1;                     ///< kTangled's: largest displacement over L
  bool principal_axis = false;          ///< the spin is about the axis of the largest inertia
  double spin = 0;                      ///< a free body's, about an axis at 30 degrees to y and z [rad/s]
  double velocity = 0;                  ///< a free body's, along -z [m/s]
  double damping = 1;                   ///< alpha over 2 w_1
  double stiffness_damping = 0;         ///< beta w_1
  runtime::ExampleSettings examples{};  ///< settings of a body with examples
  Ground ground = Ground::kNone;
  Company company = Company::kNone;
  double contact_stiffness = 1e6;  ///< [N/m^3]
  double friction = 0;
};

inline constexpr int kLoadSteps = 60;

/// A check that a class of runs fails for a reason that is understood.
struct KnownLimit {
  std::string_view id;
  Check check;
  bool (*covers)(const StabilityCase&, const StudyBody&);
  double most;            ///< largest value of the check that it explains
  std::string_view what;  ///< which runs
  std::string_view reason;
  std::string_view message;  ///< message to the user
};
const std::vector<KnownLimit>& known_limits();

/// The suite of the tests: some hundred runs that reach every extreme, and those of them that lanes take in mixed
/// precision too, each in a group of its own.
std::vector<StabilityCase> short_stability_suite();

/// That, and the full product of E, nu, density, time step, material, integrator and constraint.
std::vector<StabilityCase> long_stability_suite();

/// One line that says all of a case.
std::string describe(const StabilityCase& test);

}  // namespace exmat::precompute

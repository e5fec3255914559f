#pragma once

#include <Eigen/Core>
#include <memory>

#include "tests/support/synthetic_model.h"

namespace exmat::benchmarks {

/// Bodies of one mesh in a world of Bullet's, as btReducedDeformableBody has them: linear modes about a rigid frame.
/// Their modes are those of the bar's basis, which K makes diagonal within it, so both move in the same space.
class BulletBodies {
 public:
  struct Settings {
    double time_step = 0, gravity = 0, mass_damping = 0, stiffness_damping = 0, friction = 0;
    bool floor = true;  ///< solid below z = 0
  };

  BulletBodies(const test::Bar& bar, const Settings& settings);
  ~BulletBodies();

  /// Another body, moved from where it was meshed, turning about its centre of mass.
  void add(const Eigen::Vector3d& by, const Eigen::Vector3d& spin);
  void step();

  /// Frequency of the stiffest mode [rad/s]: a step that is explicit holds up to 2 over this.
  double highest_frequency() const;
  /// Lowest vertex of a body, and its centre of mass [m].
  double lowest(int body) const;
  Eigen::Vector3d centre(int body) const;
  /// Vertices of all bodies that touched the floor in the last step.
  int touching() const;

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace exmat::benchmarks

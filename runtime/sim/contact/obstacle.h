#pragma once

#include <Eigen/Core>
#include <variant>

#include "runtime/sim/frame/motion.h"

namespace exmat::runtime {

// Shapes in the frame of their obstacle [m].

struct Plane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, away from the solid half space
};
struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 1;  ///< > 0
};
struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extents = Eigen::Vector3d::Ones();  ///< > 0
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< of its axes
};
struct Capsule {
  Eigen::Vector3d start = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::UnitZ();  ///< of its axis
  double radius = 1;                                                                ///< > 0
};
using Shape = std::variant<Plane, Sphere, Box, Capsule>;

/// The point of a surface nearest to a given one.
struct SurfacePoint {
  double distance = 0;                                ///< to the given point, negative inside [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, outward: the gradient of the distance; where there is
                                                      ///< none (edges, centres), the same one of several each time
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

/// Exact outside and inside.
SurfacePoint nearest_surface_point(const Shape& shape, const Eigen::Vector3d& point) noexcept;

/// Its distance alone. It is 1-Lipschitz: no point of a ball is nearer than that of its centre minus its radius.
double signed_distance(const Shape& shape, const Eigen::Vector3d& point) noexcept;

/// What a body may touch. Per area of the body's surface, so that results do not depend on its tessellation.
struct Obstacle {
  Shape shape;
  RigidMotion motion;    ///< of the shape's frame
  double stiffness = 0;  ///< pressure per depth, > 0 [N/m^3]
  double damping = 0;    ///< pressure per approach velocity, >= 0 [N s/m^3]
  double friction = 0;   ///< Coulomb's coefficient, >= 0
};

/// An obstacle at the end of a step.
struct PlacedObstacle {
  const Obstacle* obstacle = nullptr;
  MotionSample start, pose;  ///< at the beginning and at the end

  PlacedObstacle() = default;
  PlacedObstacle(const Obstacle& placed, double end_time, double time_step) noexcept
      : obstacle(&placed), start(placed.motion.sample(end_time - time_step)), pose(placed.motion.sample(end_time)) {}

  /// Where its material point at this world position goes in the step.
  Eigen::Vector3d carried(const Eigen::Vector3d& point) const noexcept { return pose.to_world(start.to_frame(point)); }

  /// As above, world positions.
  SurfacePoint nearest_surface_point(const Eigen::Vector3d& point) const noexcept;
  double signed_distance(const Eigen::Vector3d& point) const noexcept;
};

}  // namespace exmat::runtime

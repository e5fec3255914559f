#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "common/model/meeting_group.h"
#include "runtime/sim/contact/height_field.h"
#include "runtime/sim/contact/rigid_mesh.h"
#include "runtime/sim/contact/surface_point.h"
#include "runtime/sim/frame/motion.h"

namespace exmat::runtime {

inline constexpr double kContactMarginSteps = 2;  ///< way of a vertex that candidates are looked for in
inline constexpr double kSweep = 0.5;             ///< share of the thickness: an obstacle that goes farther sweeps

// Shapes in the frame of their obstacle [m].

struct Plane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, away from the solid half space

  double distance(const Eigen::Vector3d& x) const noexcept { return normal.dot(x - point); }  ///< signed [m]
};
struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 1;  ///< > 0
};
struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extents = Eigen::Vector3d::Ones();  ///< > 0
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< rotation of its axes
};
struct Capsule {
  Eigen::Vector3d start = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::UnitZ();  ///< ends of its axis
  double radius = 1;                                                                ///< > 0
};
struct MeshShape {
  std::shared_ptr<const RigidMesh> mesh;                   ///< in axes of its own; any number of obstacles share it
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< origin of these axes
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< rotation of these axes
};
struct HeightFieldShape {
  std::shared_ptr<const HeightField> field;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
};
using Shape = std::variant<Plane, Sphere, Box, Capsule, MeshShape, HeightFieldShape>;

/// Exact outside and inside. With a hint, of points near each other.
SurfacePoint nearest_surface_point(const Shape& shape, const Eigen::Vector3d& point, NearestHint& hint) noexcept;
SurfacePoint nearest_surface_point(const Shape& shape, const Eigen::Vector3d& point) noexcept;

/// Its distance alone. It is 1-Lipschitz: no point of a ball is nearer than that of its centre minus its radius.
double signed_distance(const Shape& shape, const Eigen::Vector3d& point) noexcept;

/// False only where it is above `radius`.
bool may_be_within(const Shape& shape, const Eigen::Vector3d& point, double radius) noexcept;

/// Distance within `most` at which a ray enters the solid [m]; none where it begins in it.
std::optional<double> entry(const Shape& shape, const Ray& ray, double most) noexcept;

/// Largest distance of a point inside from the surface; infinite for half spaces and ground [m].
double deepest(const Shape& shape) noexcept;

/// The shortest way that may lead through it: 0 where it is not known, as of meshes [m].
double shortest_passage(const Shape& shape) noexcept;

inline constexpr double kRelease = 1;  ///< [m/s] of overlaps at the start, where nothing else is said

/// Obstacle that bodies may touch. Its law is per area of a body's surface, so that results do not depend on the mesh.
struct Obstacle {
  Shape shape;
  RigidMotion motion;    ///< motion of the shape's frame
  double stiffness = 0;  ///< pressure per depth, > 0 [N/m^3]
  double damping = 0;    ///< pressure per approach velocity, >= 0 [N s/m^3]
  double friction = 0;   ///< Coulomb's coefficient, >= 0
  MeetingGroup meeting{};
  double release = kRelease;  ///< speed at which a body that overlaps it at the start is let out, > 0 [m/s]
};

/// An obstacle that any number of bodies may touch. Whoever made it may change it between steps.
class SharedObstacle {
 public:
  SharedObstacle(Obstacle obstacle)  // NOLINT(google-explicit-constructor): an obstacle serves as one of a list
      : obstacle_(std::make_shared<Obstacle>(std::move(obstacle))) {}
  SharedObstacle(std::shared_ptr<const Obstacle> obstacle)  // NOLINT(google-explicit-constructor)
      : obstacle_(std::move(obstacle)) {}

  const Obstacle& operator*() const noexcept { return *obstacle_; }
  const Obstacle* operator->() const noexcept { return obstacle_.get(); }
  /// Its motion, which keeps it alive.
  std::shared_ptr<const RigidMotion> motion() const noexcept { return {obstacle_, &obstacle_->motion}; }

 private:
  std::shared_ptr<const Obstacle> obstacle_;
};
using Obstacles = std::vector<SharedObstacle>;

/// An obstacle at the end of a step.
struct PlacedObstacle {
  const Obstacle* obstacle = nullptr;
  MotionSample start, pose;  ///< at the beginning and at the end
  double turn = 0;           ///< bound on how far its points move beside each other in the step, over how far apart
  bool sweeps = false;       ///< it goes so far in the step that the way to it counts, not where it ends alone
  bool is_fixed = false;     ///< its frame is the world's
  /// The shape if it is a plane at rest, which most obstacles are, else null; quicker than to ask for the kind of a
  /// shape.
  const Plane* plane = nullptr;

  PlacedObstacle() = default;
  PlacedObstacle(const Obstacle& placed, double end_time, double time_step) noexcept
      : obstacle(&placed), start(placed.motion.sample(end_time - time_step)), pose(placed.motion.sample(end_time)) {
    if (placed.motion.moves()) turn = (pose.rotation - start.rotation).norm();
    is_fixed = !placed.motion.moves() && pose.position.isZero(0) && pose.rotation.isIdentity(0);
    if (is_fixed) plane = std::get_if<Plane>(&placed.shape);
  }

  /// End of the step of its material point at this world position.
  Eigen::Vector3d carried(const Eigen::Vector3d& point) const noexcept {
    return is_fixed ? point : pose.to_world(start.to_frame(point));
  }

  /// Longest way of its material points in a ball in the step [m].
  double sweep(const Eigen::Vector3d& centre, double radius) const noexcept {
    return (carried(centre) - centre).norm() + turn * radius;
  }

  /// True if anything in a ball at the beginning of the step, which moves by no more than half of `margin` in it, may
  /// touch the obstacle in the step.
  bool may_meet(const Eigen::Vector3d& centre, double radius, double margin) const noexcept;

  /// As above, world positions.
  SurfacePoint nearest_surface_point(const Eigen::Vector3d& point, NearestHint& hint) const noexcept;
  SurfacePoint nearest_surface_point(const Eigen::Vector3d& point) const noexcept;
  double signed_distance(const Eigen::Vector3d& point) const noexcept;
};

}  // namespace exmat::runtime

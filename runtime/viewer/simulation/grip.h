#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "exmat/exmat.hpp"
#include "runtime/viewer/simulation/body_shape.h"
#include "runtime/viewer/view/picking.h"

namespace exmat::viewer {

/// Radius of a hand over the body's size.
inline constexpr double kHandSize = 0.06;

/// A corner of a triangle of a surface.
struct Corner {
  std::int64_t triangle = 0;
  int corner = 0;
};

/// The points of the surface that a hand covers which takes it at `place`, each once; none where the mesh is too
/// coarse.
std::vector<Corner> covered_points(const BodyShape& shape, const SurfaceHit& place);

/// Points for a hand or a pin: those that it covers, or the picked one alone.
Points patch_of(const Surface& surface, const BodyShape& shape, const SurfaceHit& place);

/// The inverse of how much an impulse on the points, shared by them, moves their mean, by the modes and by rigid motion
/// [kg].
double effective_mass(const Points& points, const BodyShape& shape);

/// A damped spring from a point of a body's surface to where a hand is.
class Grip {
 public:
  /// At a place of the surface of `body`, which is not moved by that.
  Grip(int id, std::size_t body, const BodyShape& shape, const Surface& surface, const SurfaceHit& place,
       BodyRef& held);

  int id() const { return id_; }
  std::size_t body() const { return body_; }
  const SurfaceHit& place() const { return place_; }
  const Eigen::Vector3d& point() const { return point_; }
  const Eigen::Vector3d& target() const { return target_; }
  const Eigen::Vector3d& force() const { return force_; }

  /// Sets where the hand is, world [m].
  void set_target(const Eigen::Vector3d& target) { target_ = target; }

  /// After the body was put elsewhere: where it is held stays, and the hand goes there.
  void follow(BodyRef& held);

  /// Pulls at the body for one step; `strength` scales the spring.
  void pull(double time_step, double strength, BodyRef& held);

  /// Share of its force's work that the body cannot answer.
  double lost(const Capacity& capacity, const BodyRef& held) const;

 private:
  Eigen::Vector3d read_point(BodyRef& held) const;
  std::vector<double> shared_force() const;

  int id_;
  std::size_t body_;
  SurfaceHit place_;
  Points points_, patch_;                  ///< points where it was taken, and those that the hand covers there
  double effective_mass_;                  ///< mass of the patch alone, by the modes [kg]
  double longest_;                         ///< that the spring gets [m]
  Eigen::Vector3d point_, target_, hand_;  ///< hand: the target, smoothed
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();
};

}  // namespace exmat::viewer

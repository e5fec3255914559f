#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "runtime/sim/contact/movement_bound.h"
#include "runtime/sim/contact/obstacle.h"
#include "runtime/sim/frame/placement.h"

namespace exmat::runtime {

/// Vertices of a body near planes that stand, by a search that went farther than one step needs: until the body has
/// come nearer to one of them by what it went farther, no step has to search again. Of a body whose obstacles are all
/// such planes; what is found is the same without.
class NearPlanes {
 public:
  NearPlanes() = default;
  /// Allocates for a body of so many vertices and modes, once.
  NearPlanes(Eigen::Index vertices, Eigen::Index modes, std::size_t obstacles);

  /// True if every obstacle is a plane that stands.
  static bool serve(std::span<const PlacedObstacle> obstacles) noexcept;

  /// Pose of a body: its frame and q [r]; its points are at most `reach` from the frame's origin at rest [m], and q
  /// moves them as `movement` allows.
  struct Pose {
    const Placement& placement;
    const Eigen::VectorXd& q;
    double reach;
    const MovementBound& movement;
  };

  /// True if all vertices that are at most `margin` [m] away are known. Counts the steps that a search serves.
  bool knows(std::span<const PlacedObstacle> obstacles, const Pose& pose, double margin) noexcept;

  /// After that: whether a search is to go farther, and be remembered.
  bool is_worthwhile() noexcept;

  /// Begins to remember one that goes to radius().
  void begin(std::span<const PlacedObstacle> obstacles, const Pose& pose, double margin) noexcept;
  double radius() const noexcept { return radius_; }  ///< [m]; negative: nothing is remembered

  /// A vertex at `point`, world [m], if it is within the radius; in ascending order.
  void add(int vertex, std::span<const PlacedObstacle> obstacles, const Eigen::Vector3d& point) noexcept;

  std::size_t count() const noexcept { return count_; }
  int vertex(std::size_t index) const noexcept { return vertices_[index]; }

  /// True if one of them may be at most `margin` away from a plane.
  bool may_be_near(std::size_t index, double margin) const noexcept;

 private:
  std::size_t obstacles_ = 0, count_ = 0;
  std::vector<Plane> planes_;      // as they were
  std::vector<double> ways_;       // how much nearer to each the body may have come [m]
  std::vector<int> vertices_;      // the first count_
  std::vector<double> distances_;  // count_ x obstacles
  Placement placement_;
  Eigen::VectorXd q_;
  double radius_ = -1;  // all that were nearer are known [m]; negative: none is
  int served_ = 0;      // steps, by the last search
  int without_ = 0;     // so many more steps look for themselves: the last search did not serve enough
};

}  // namespace exmat::runtime

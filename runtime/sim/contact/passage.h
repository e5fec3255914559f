#pragma once

#include <Eigen/Core>
#include <optional>

#include "runtime/sim/contact/obstacle.h"

namespace exmat::runtime {

// Continuous collision detection of vertices: docs/step_in_detail.md, "Fast bodies".

inline constexpr double kFast = 0.125;  ///< share of the shortest passage, or of a body's radius: less passes nothing
inline constexpr double kOtherSide = -0.1;  ///< cosine of normals that look apart by more than those beside an edge

/// A plane in place of an obstacle's surface, world.
struct SidePlane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();  ///< normal: unit, outward

  SurfacePoint nearest(const Eigen::Vector3d& from) const noexcept {
    const double distance = normal.dot(from - point);
    return {distance, normal, from - distance * normal};
  }
};

/// Way of a vertex in a step, as the obstacle sees it at the end of the step; world.
struct VertexWay {
  Eigen::Vector3d carried = Eigen::Vector3d::Zero();    ///< place that the obstacle would carry it to from its own [m]
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();  ///< place that its velocity leads to
  Eigen::Vector3d heading = Eigen::Vector3d::Zero();    ///< farther than it may go
};

/// Which surface a vertex feels in a step.
struct Passage {
  enum class Kind {
    kNearest,  ///< the nearest
    kWatched,  ///< the nearest, but the side plane where that looks away from it
    kThrough,  ///< the side plane alone: it would leave the obstacle somewhere else than it came in
  };
  Kind kind = Kind::kNearest;
  SidePlane side;
};

/// First meeting of a way from outside with the surface, to a thousandth of the way; nothing where there is none.
std::optional<SidePlane> first_entry(const PlacedObstacle& placed, const Eigen::Vector3d& from,
                                     const Eigen::Vector3d& to) noexcept;

/// The passage of a vertex whose nearest point, from `way.carried`, is `nearest`. `way_out` is what it remembers: the
/// way to the surface that it came in by, world, or 0.
Passage find_passage(const PlacedObstacle& placed, const VertexWay& way, const SurfacePoint& nearest,
                     const Eigen::Vector3d& way_out) noexcept;

/// The way out of a vertex that was put inside, at `carried` with its nearest surface point `nearest`, [m], world: what
/// is deep there leaves by the side that the `centre` of its body is nearest to, so that no body is pulled apart; 0
/// where the nearest way serves.
Eigen::Vector3d way_out_with(const Eigen::Vector3d& centre, const PlacedObstacle& placed,
                             const Eigen::Vector3d& carried, const SurfacePoint& nearest) noexcept;

/// The surface point that pushes a vertex at `point`; `by_plane` says whether it is the side plane.
SurfacePoint felt_surface(const PlacedObstacle& placed, const Passage& passage, const Eigen::Vector3d& point,
                          NearestHint& hint, bool& by_plane) noexcept;

}  // namespace exmat::runtime

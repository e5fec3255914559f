#pragma once

#include <Eigen/Core>
#include <optional>

namespace exmat::runtime {

struct Ray {
  Eigen::Vector3d origin, direction;  ///< [m], unit

  Eigen::Vector3d at(double distance) const noexcept { return origin + distance * direction; }
};

/// The point of a triangle that a ray meets.
struct TriangleHit {
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();  ///< shares of its corners, sum 1
  double distance = 0;                               ///< along the ray, >= 0 [m]
};

/// From either side.
std::optional<TriangleHit> triangle_hit(const Ray& ray, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                        const Eigen::Vector3d& c) noexcept;

// Distance at which a ray enters a solid [m]; none where it misses it, or has left it behind.

/// 0 where it begins in the box, which has the corners `low` and `high`.
std::optional<double> box_entry(const Ray& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) noexcept;
/// None where it begins in the ball.
std::optional<double> ball_entry(const Ray& ray, const Eigen::Vector3d& centre, double radius) noexcept;
/// Likewise.
std::optional<double> capsule_entry(const Ray& ray, const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                                    double radius) noexcept;

/// The lesser of two distances that may be none.
std::optional<double> nearer(std::optional<double> a, std::optional<double> b) noexcept;

}  // namespace exmat::runtime

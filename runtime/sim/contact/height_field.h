#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/sim/contact/nearest_on_triangle.h"
#include "runtime/sim/contact/ray.h"
#include "runtime/sim/contact/surface_point.h"

namespace exmat::runtime {

/// Ground given by heights z at the points of a grid, from its own origin along x and y. Two triangles to a cell, along
/// its diagonal from the lower x and y; solid below, however deep, and nothing beyond the border. Distances are exact,
/// by a pyramid of the lowest and highest of each block. No call but the constructor allocates.
class HeightField {
 public:
  /// `heights` [rows x columns] [m], 2 or more of each: a row for each y, a column for each x; `spacing` > 0 along x
  /// and y [m].
  HeightField(RowMatrix heights, const Eigen::Vector2d& spacing);

  const RowMatrix& heights() const noexcept { return heights_; }
  const Eigen::Vector2d& spacing() const noexcept { return spacing_; }

  int triangles() const noexcept { return 2 * levels_.front().columns * levels_.front().rows; }
  /// Corners of a triangle, 0 <= triangle < triangles(), counter-clockwise from above.
  std::array<Eigen::Vector3d, 3> corners(Eigen::Index triangle) const noexcept;

  SurfacePoint nearest(const Eigen::Vector3d& point) const noexcept;
  /// The same, at once where the hint of a point nearby holds.
  SurfacePoint nearest(const Eigen::Vector3d& point, NearestHint& hint) const noexcept;

  /// False only where the signed distance is above `radius`.
  bool may_be_within(const Eigen::Vector3d& point, double radius) const noexcept;

  /// Distance within `most` at which a ray from above meets the surface [m].
  std::optional<double> entry(const Ray& ray, double most) const noexcept;

  /// Height of the surface; beyond the border that of its nearest point.
  double height_at(double x, double y) const noexcept;

 private:
  struct Level {
    int columns = 0, rows = 0;  // blocks
    std::vector<double> lowest, highest;
  };
  struct Found {
    int triangle = -1;  // 2 to a cell
    TrianglePoint on;
    double second = 0;  // squared distance of the second nearest
  };
  Eigen::Vector3d corner(int column, int row) const noexcept {
    return {column * spacing_[0], row * spacing_[1], heights_(row, column)};
  }
  double squared_distance(int level, int column, int row, const Eigen::Vector3d& point) const noexcept;
  TrianglePoint nearest_on(int triangle, const Eigen::Vector3d& point) const noexcept;
  enum class Search { kNearest, kTwoNearest, kAny };
  template <Search kSearch>
  Found search(const Eigen::Vector3d& point, double reach) const noexcept;
  SurfacePoint surface_of(const Eigen::Vector3d& point, const Found& found) const noexcept;
  Eigen::Vector3d normal_of(int triangle) const noexcept;
  bool is_below(const Eigen::Vector3d& point) const noexcept;

  RowMatrix heights_;
  Eigen::Vector2d spacing_;
  double width_ = 0, depth_ = 0;  // of the area, along x and y
  std::vector<Level> levels_;     // of single cells first, of one block last
};

}  // namespace exmat::runtime

#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// Side of a picture of a surface [px].
inline constexpr int kPictureSide = 300;

/// A surface whose triangles have colours, red, green, blue from 0 to 255.
struct PaintedSurface {
  const VertexArray& vertices;
  const TriangleArray& triangles;
  std::vector<Eigen::Vector3d> colours;

  PaintedSurface(const VertexArray& its_vertices, const TriangleArray& its_triangles, const Eigen::Vector3d& colour)
      : vertices(its_vertices),
        triangles(its_triangles),
        colours(static_cast<std::size_t>(its_triangles.rows()), colour) {}
};

/// A direction to look from, and the square that is seen.
struct PictureView {
  Eigen::Matrix3d axes;  ///< rows to the right, up and to the viewer
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double scale = 1;

  /// Shows all of the points.
  PictureView(const Eigen::Matrix3d& its_axes, const std::vector<const VertexArray*>& shown);

  /// Pixels to the right and down from the middle of the picture, and the depth to the viewer.
  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const;
};

/// Elements of an SVG, the middle of the picture at 0: the triangles that face the viewer, shaded by their slope, the
/// nearest last. A surface of many triangles becomes runs of pixels.
std::string surface_paths(const PaintedSurface& surface, const PictureView& view);

/// An <svg> element.
std::string surface_svg(const PaintedSurface& surface, const PictureView& view);

/// Two poses of one surface [n x 3], [n_f x 3]: the first, the second, and both on one another, seen from a little
/// above. `id` is unique on the page.
std::string poses_svg(const TriangleArray& surface, const VertexArray& first, const VertexArray& second,
                      const Eigen::Vector3d& up, const std::string& id);

}  // namespace exmat::precompute

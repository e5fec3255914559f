#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "precompute/alignment/surface_tree.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// A body at centroid 0 and volume 1 by its surface.
struct BodySurface {
  VertexArray vertices;
  TriangleArray triangles;
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< columns: principal axes
  double radius = 1;                                   ///< RMS, of the body
};
BodySurface body_surface(const LaplaceBasis& basis, const TetArray& tets);

/// One body turned, and perhaps mirrored, over another.
struct RigidFit {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< determinant -1 for a mirror image
  double gap = 0;  ///< RMS distance of the surfaces, both ways, over the RMS radius of the fixed body
};

/// Lays one body over another without bending it. Rotations come from those of a cube, about the axes of space and
/// about the principal axes, by iterated closest points.
class RigidFitter {
 public:
  RigidFitter(const BodySurface& moving, const BodySurface& fixed);

  /// By all of both surfaces.
  RigidFit at(const Eigen::Matrix3d& rotation) const;

  /// Different rotations, best first, their gaps by samples; of the moving body's mirror image instead. A turn by right
  /// angles about the axes of space is kept as it is where iterating gains nothing on it.
  std::vector<RigidFit> fits(bool mirrored) const;

  /// Share of the area of each body that is farther than `distance`, over the RMS radius, from the other.
  struct Uncovered {
    double moving = 0, fixed = 0;
  };
  Uncovered uncovered(const Eigen::Matrix3d& rotation, double distance) const;

 private:
  // A surface and points on it; of these a few for iterating.
  struct Sampled {
    SurfaceTree tree;
    VertexArray points, few;
    explicit Sampled(const BodySurface& body);
    double mean_squared_distance(const VertexArray& from) const;
  };
  Eigen::Matrix3d settle(Eigen::Matrix3d rotation) const;
  RigidFit sampled_fit(const Eigen::Matrix3d& rotation) const;

  Eigen::Matrix3d moving_axes_, fixed_axes_;
  Sampled moving_, fixed_;
  double radius_ = 0;
};

/// Rotations farther apart than this are different [rad].
constexpr double kDifferentRotation = 0.5;

/// "turned by 90 degrees about x": how a body stands that `rotation` turns back.
std::string describe_turn(const Eigen::Matrix3d& rotation);

}  // namespace exmat::precompute

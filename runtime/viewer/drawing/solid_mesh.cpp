#include "runtime/viewer/drawing/solid_mesh.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace exmat::viewer {
namespace {

constexpr int kRings = 24, kSlices = 48;

void add_point(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, SolidMesh& mesh) {
  for (const Eigen::Vector3d& v : {point, normal})
    for (const double number : v) mesh.points.push_back(static_cast<float>(number));
}

void add_quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d, SolidMesh& mesh) {
  mesh.indices.insert(mesh.indices.end(), {a, b, c, a, c, d});
}

Eigen::Matrix3d axes_along(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d third = axis.stableNormalized();
  const Eigen::Vector3d hint = std::abs(third.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  Eigen::Matrix3d axes;
  axes.col(0) = hint.cross(third).normalized();
  axes.col(1) = third.cross(axes.col(0));
  axes.col(2) = third;
  return axes;
}

}  // namespace

SolidMesh make_capsule(const Eigen::Vector3d& start, const Eigen::Vector3d& axis, double radius) {
  const Eigen::Matrix3d axes = axes_along(axis.isZero(0) ? Eigen::Vector3d::UnitZ() : axis);
  SolidMesh mesh;
  for (int ring = 0; ring <= kRings + 1; ++ring) {
    // The middle ring is there twice, at either end of the axis.
    const int of_half = ring <= kRings / 2 ? ring : ring - 1;
    const double height = std::numbers::pi * (static_cast<double>(of_half) / kRings - 0.5);
    const Eigen::Vector3d centre = ring <= kRings / 2 ? start : Eigen::Vector3d(start + axis);
    for (int slice = 0; slice <= kSlices; ++slice) {
      const double turn = 2 * std::numbers::pi * slice / kSlices;
      const Eigen::Vector3d normal = axes * Eigen::Vector3d(std::cos(height) * std::cos(turn),
                                                            std::cos(height) * std::sin(turn), std::sin(height));
      add_point(centre + radius * normal, normal, mesh);
    }
  }
  for (std::uint32_t ring = 0; ring <= kRings; ++ring)
    for (std::uint32_t slice = 0; slice < kSlices; ++slice) {
      const std::uint32_t a = ring * (kSlices + 1) + slice, b = a + kSlices + 1;
      add_quad(a, a + 1, b + 1, b, mesh);
    }
  return mesh;
}

SolidMesh make_ball(const Eigen::Vector3d& centre, double radius) {
  return make_capsule(centre, Eigen::Vector3d::Zero(), radius);
}

SolidMesh make_box(const Eigen::Vector3d& centre, const Eigen::Vector3d& half, const Eigen::Matrix3d& axes) {
  SolidMesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const auto first = static_cast<std::uint32_t>(mesh.points.size() / 6);
      const Eigen::Vector3d normal = side * axes.col(axis);
      const Eigen::Vector3d u = half[(axis + 1) % 3] * axes.col((axis + 1) % 3);
      const Eigen::Vector3d v = side * half[(axis + 2) % 3] * axes.col((axis + 2) % 3);
      const Eigen::Vector3d middle = centre + half[axis] * normal;
      for (const auto& [s, t] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
        add_point(middle + s * u + t * v, normal, mesh);
      add_quad(first, first + 1, first + 2, first + 3, mesh);
    }
  return mesh;
}

SolidMesh make_sheet(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double half) {
  const Eigen::Matrix3d axes = axes_along(normal);
  SolidMesh mesh;
  for (const auto& [s, t] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
    add_point(point + half * (s * axes.col(0) + t * axes.col(1)), axes.col(2), mesh);
  add_quad(0, 1, 2, 3, mesh);
  return mesh;
}

SolidMesh make_triangles(std::span<const double> corners) {
  SolidMesh mesh;
  for (std::size_t i = 0; i + 8 < corners.size(); i += 9) {
    const auto corner = [&](std::size_t c) { return Eigen::Vector3d(corners.data() + i + 3 * c); };
    const Eigen::Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).stableNormalized();
    for (std::size_t c = 0; c < 3; ++c) {
      mesh.indices.push_back(static_cast<std::uint32_t>(mesh.points.size() / 6));
      add_point(corner(c), normal, mesh);
    }
  }
  return mesh;
}

SolidMesh make_obstacle(const exmat_obstacle& obstacle, std::span<const double> corners, double sheet) {
  const Eigen::Vector3d point(obstacle.point), direction(obstacle.direction);
  switch (obstacle.shape) {
    case EXMAT_SPHERE:
      return make_ball(point, obstacle.radius);
    case EXMAT_CAPSULE:
      return make_capsule(point, direction, obstacle.radius);
    case EXMAT_BOX: {
      const Eigen::Quaterniond turn(obstacle.orientation[0], obstacle.orientation[1], obstacle.orientation[2],
                                    obstacle.orientation[3]);
      return make_box(point, Eigen::Vector3d(obstacle.half_extents), turn.toRotationMatrix());
    }
    case EXMAT_PLANE:
      return make_sheet(point, direction, sheet);
    default:
      return make_triangles(corners);
  }
}

}  // namespace exmat::viewer

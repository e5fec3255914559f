#pragma once

#include <Eigen/Geometry>
#include <ostream>

#include "runtime/sim/contact/obstacle.h"

namespace exmat::test {

/// An obstacle's shape as a test's parameter.
struct NamedShape {
  const char* name;
  runtime::Shape shape;
};
inline void PrintTo(const NamedShape& shape, std::ostream* stream) { *stream << shape.name; }

// One of each solid shape, about the origin and turned.
inline const Eigen::Matrix3d kTurn =
    Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
inline const runtime::Box kBox{{0.1, -0.2, 0.3}, {0.5, 0.2, 0.8}, kTurn};
inline const runtime::Capsule kCapsule{{-0.3, 0.1, 0}, {0.5, 0.4, -0.2}, 0.25};
inline const runtime::Sphere kSphere{{0.1, 0.2, -0.1}, 0.6};
inline const runtime::Plane kPlane{{0, 0.1, 0}, Eigen::Vector3d(1, 2, -1).normalized()};

}  // namespace exmat::test

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "exmat/exmat.hpp"
#include "runtime/viewer/view/camera.h"
#include "runtime/viewer/view/picking.h"

namespace exmat::viewer {

/// An example as it is shown.
struct ShownExample {
  std::string region;  ///< empty: of the whole body
  std::string name;
  std::vector<float> pose;  ///< r
};

/// Drawn shape of bodies of one kind, whatever they do. k points, f triangles, r modes, s elements.
struct BodyShape {
  std::size_t modes = 0;
  std::vector<double> rest;             ///< 3k
  std::vector<float> basis;             ///< 3k x r
  std::vector<std::int32_t> triangles;  ///< 3f
  std::vector<std::int64_t> vertices;   ///< k, of the object
  bool render_mesh = false;
  std::vector<float> element_sizes;  ///< s, of the cubature: cube roots of weights, the largest 1
  std::vector<ShownExample> examples;
  Bounds bounds;                           ///< at rest
  std::vector<std::string> bones;          ///< names, of a body on a skeleton
  std::vector<std::int64_t> bone_parents;  ///< one for each bone, -1 of a root
  double mass = 0;                         ///< mass of a free body [kg]; 0 with fixed vertices

  bool on_bones() const { return !bones.empty(); }
  std::int32_t point(std::int64_t triangle, int corner) const {
    return triangles[static_cast<std::size_t>(3 * triangle + corner)];
  }
  Eigen::Vector3d rest_corner(std::int64_t triangle, int corner) const {
    return Eigen::Map<const Eigen::Vector3d>(rest.data() + 3 * static_cast<std::ptrdiff_t>(point(triangle, corner)));
  }
  Eigen::Vector3d rest_place(const SurfaceHit& place) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int c = 0; c < 3; ++c) sum += place.shares[c] * rest_corner(place.triangle, c);
    return sum;
  }
};

/// Shape of a model's bodies, from its surface.
BodyShape make_shape(const Model& model, const Surface& surface);

}  // namespace exmat::viewer

#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "tests/support/box_mesh.h"

namespace exmat::test {

/// Moves the vertices of a box_mesh at random by up to `share` of a cell, those of the surface within it: another
/// tessellation of the same box.
inline TetMesh shaken_box(const std::array<int, 3>& cells, const std::array<double, 3>& lengths, std::uint32_t seed,
                          double share = 0.2) {
  TetMesh mesh = box_mesh(cells, lengths);
  std::mt19937 generator(seed);
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::size_t>(axis);
      const double cell = lengths[at] / cells[at], x = mesh.vertices(v, axis);
      const double shift = share * cell * (2 * (static_cast<double>(generator()) / 4294967295.0) - 1);
      if (x > 0.5 * cell && x < lengths[at] - 0.5 * cell) mesh.vertices(v, axis) += shift;
    }
  return mesh;
}

/// The vertices of a box_mesh at its corners, the first axis fastest.
inline std::vector<std::int32_t> box_corners(const std::array<int, 3>& cells) {
  std::vector<std::int32_t> ids;
  for (int k = 0; k < 8; ++k)
    ids.push_back(((k >> 2 & 1) * cells[2] * (cells[1] + 1) + (k >> 1 & 1) * cells[1]) * (cells[0] + 1) +
                  (k & 1) * cells[0]);
  return ids;
}

/// Centred at the origin.
inline TetMesh centred(TetMesh mesh) {
  const Eigen::RowVector3d middle = 0.5 * (mesh.vertices.colwise().maxCoeff() + mesh.vertices.colwise().minCoeff());
  mesh.vertices.rowwise() -= middle;
  return mesh;
}

/// A cylinder along x about the origin, from a box of square section whose squares become circles.
inline TetMesh cylinder_mesh(int along, int across, double length, double radius, std::uint32_t seed) {
  TetMesh mesh = centred(shaken_box({along, across, across}, {length, 2, 2}, seed, 0.15));
  for (auto x : mesh.vertices.rowwise()) {
    const double y = x[1], z = x[2];
    x[1] = radius * y * std::sqrt(1 - z * z / 2);
    x[2] = radius * z * std::sqrt(1 - y * y / 2);
  }
  return mesh;
}

/// Without the tets whose centre is in the hole.
inline TetMesh without(const TetMesh& mesh, const std::function<bool(const Eigen::RowVector3d&)>& hole) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
    for (const auto v : mesh.tets.row(t)) centre += mesh.vertices.row(v) / 4;
    if (!hole(centre)) kept.push_back(t);
  }
  TetMesh result;
  result.tets = mesh.tets(kept, Eigen::all);
  std::vector<std::int32_t> index(static_cast<std::size_t>(mesh.vertex_count()), -1);
  std::vector<Eigen::Index> vertices;
  for (auto& corner : result.tets.reshaped<Eigen::RowMajor>()) {
    auto& at = index[static_cast<std::size_t>(corner)];
    if (at < 0) {
      at = static_cast<std::int32_t>(vertices.size());
      vertices.push_back(corner);
    }
    corner = at;
  }
  result.vertices = mesh.vertices(vertices, Eigen::all);
  return result;
}

/// A bar of 4 x 0.8 x 0.6 along x with an arm on one side, of half its thickness and 13 % of the volume: no rotation
/// and no mirror lays it upon itself. `cells` of a box of 4 x 2 x 0.6: multiples of 10, 5 and 2.
inline TetMesh armed_bar(const std::array<int, 3>& cells) {
  return without(box_mesh(cells, {4, 2, 0.6}),
                 [](const Eigen::RowVector3d& x) { return x[1] > 0.8 && (x[0] < 2.4 || x[0] > 3.2 || x[2] > 0.3); });
}

/// Poses of a body along x about the origin, between x = -length/2 and length/2.
using Pose = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// The x axis becomes a circular arc of `angle` in the plane of x and z; sections stay plane.
inline Pose bend(double length, double angle) {
  return [=](const Eigen::Vector3d& x) {
    const double radius = length / angle, turn = x[0] / radius;
    return Eigen::Vector3d((radius - x[2]) * std::sin(turn), x[1], radius - (radius - x[2]) * std::cos(turn));
  };
}

/// Sections turn about the x axis, by -angle/2 to angle/2.
inline Pose twist(double length, double angle) {
  return [=](const Eigen::Vector3d& x) {
    return Eigen::Vector3d(Eigen::AngleAxisd(angle * x[0] / length, Eigen::Vector3d::UnitX()) * x);
  };
}

/// The x axis becomes an S in the plane of x and z whose slope is zero at the ends and `angle` in the middle; sections
/// stay plane.
inline Pose s_bend(double length, double angle) {
  return [=](const Eigen::Vector3d& x) {
    const auto slope = [&](double s) { return angle * (1 + std::cos(2 * std::numbers::pi * s / length)) / 2; };
    constexpr int kSteps = 64;
    const double step = x[0] / kSteps;
    double along = 0, up = 0;  // Simpson
    for (int k = 0; k < kSteps; ++k)
      for (const auto& [place, weight] : {std::pair{0.0, 1.0}, {0.5, 4.0}, {1.0, 1.0}}) {
        const double at = slope((k + place) * step);
        along += weight * step / 6 * std::cos(at);
        up += weight * step / 6 * std::sin(at);
      }
    const double at = slope(x[0]);
    return Eigen::Vector3d(along - x[2] * std::sin(at), x[1], up + x[2] * std::cos(at));
  };
}

inline VertexArray posed(const VertexArray& vertices, const Pose& pose) {
  VertexArray result(vertices.rows(), 3);
  for (Eigen::Index v = 0; v < vertices.rows(); ++v) result.row(v) = pose(vertices.row(v).transpose()).transpose();
  return result;
}

inline TetMesh posed(const TetMesh& mesh, const Pose& pose) { return {posed(mesh.vertices, pose), mesh.tets}; }

}  // namespace exmat::test

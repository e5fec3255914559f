#include "tests/paper/surface_energy.h"

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <utility>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

Eigen::Vector3d corner(const VertexArray& positions, std::int32_t vertex) { return positions.row(vertex).transpose(); }

double enclosed_volume(const TriangleArray& triangles, const VertexArray& positions) {
  double six = 0;
  for (const auto& triangle : triangles.rowwise())
    six += corner(positions, triangle[0]).dot(corner(positions, triangle[1]).cross(corner(positions, triangle[2])));
  return six / 6;
}

// sum_k w_k f_k (x - x_k)^2 = f (x - x_0)^2 + constant.
struct Square {
  double factor = 0, centre = 0, constant = 0;

  void add(double weighted_factor, double at) {
    factor += weighted_factor;
    centre += weighted_factor * at;
    constant += weighted_factor * at * at;
  }
  void finish() {
    if (factor == 0) return;
    centre /= factor;
    constant -= factor * centre * centre;
  }
};

}  // namespace

// Two triangles at an edge: length, angle and what their derivatives need.
struct SurfaceEnergy::Hinge {
  Hinge(const Edge& edge, const VertexArray& x)
      : from(corner(x, edge.from)),
        along(corner(x, edge.to) - from),
        left(corner(x, edge.left) - from),
        right(corner(x, edge.right) - from),
        length(along.norm()),
        left_normal(along.cross(left)),
        right_normal(right.cross(along)) {
    const double sine = left_normal.cross(right_normal).dot(along) / length;
    angle = std::atan2(sine, left_normal.dot(right_normal));
  }

  double area() const { return 0.5 * (left_normal.norm() + right_normal.norm()); }

  // Adds `slope` times the derivative of the angle: the tips turn about the edge, its ends balance them.
  void add_angle_gradient(const Edge& edge, double slope, VertexArray& gradient) const {
    const Eigen::RowVector3d at_left = -slope * length / left_normal.squaredNorm() * left_normal.transpose();
    const Eigen::RowVector3d at_right = -slope * length / right_normal.squaredNorm() * right_normal.transpose();
    const double left_share = left.dot(along) / (length * length), right_share = right.dot(along) / (length * length);
    gradient.row(edge.left) += at_left;
    gradient.row(edge.right) += at_right;
    gradient.row(edge.to) -= left_share * at_left + right_share * at_right;
    gradient.row(edge.from) -= (1 - left_share) * at_left + (1 - right_share) * at_right;
  }

  Eigen::Vector3d from, along, left, right;
  double length, angle = 0;
  Eigen::Vector3d left_normal, right_normal;
};

SurfaceEnergy::SurfaceEnergy(const TriangleArray& triangles, const SurfaceWeights& weights)
    : triangles_(triangles), weights_(weights) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> tips;  // of the triangle that runs along an edge
  for (const auto& triangle : triangles.rowwise())
    for (int i = 0; i < 3; ++i) tips[{triangle[i], triangle[(i + 1) % 3]}] = triangle[(i + 2) % 3];
  for (const auto& [ends, left] : tips) {
    const auto other = tips.find({ends.second, ends.first});
    if (other == tips.end())
      throw InputError({"", "/object/surface", "a closed surface, outward", "an edge of one triangle", ""});
    if (ends.first < ends.second) edges_.push_back({ends.first, ends.second, left, other->second});
  }
}

SurfaceEnergy::Shape SurfaceEnergy::shape(const VertexArray& positions) const {
  Shape shape;
  for (auto* values : {&shape.lengths, &shape.length_factors, &shape.angles, &shape.angle_factors})
    values->resize(edge_count());
  for (Eigen::Index e = 0; e < edge_count(); ++e) {
    const Hinge hinge(edges_[static_cast<std::size_t>(e)], positions);
    shape.lengths[e] = hinge.length;
    shape.length_factors[e] = weights_.stretching / (hinge.length * hinge.length);
    shape.angles[e] = hinge.angle;
    shape.angle_factors[e] = weights_.bending * hinge.length * hinge.length / hinge.area();
  }
  shape.volume = enclosed_volume(triangles_, positions);
  shape.volume_factor = weights_.volume / (shape.volume * shape.volume);
  return shape;
}

SurfaceEnergy::Blend SurfaceEnergy::blend(const std::vector<Shape>& shapes, const Eigen::VectorXd& weights) {
  Blend blend;
  const Eigen::Index edges = shapes.front().lengths.size();
  for (auto* values : {&blend.lengths, &blend.length_factors, &blend.angles, &blend.angle_factors})
    values->resize(edges);
  const auto blended = [&](auto factor_of, auto centre_of, double& factor, double& centre) {
    Square square;
    for (std::size_t k = 0; k < shapes.size(); ++k)
      square.add(weights[static_cast<Eigen::Index>(k)] * factor_of(shapes[k]), centre_of(shapes[k]));
    square.finish();
    factor = square.factor;
    centre = square.centre;
    blend.constant += square.constant;
  };
  for (Eigen::Index e = 0; e < edges; ++e) {
    blended([e](const Shape& shape) { return shape.length_factors[e]; },
            [e](const Shape& shape) { return shape.lengths[e]; }, blend.length_factors[e], blend.lengths[e]);
    blended([e](const Shape& shape) { return shape.angle_factors[e]; },
            [e](const Shape& shape) { return shape.angles[e]; }, blend.angle_factors[e], blend.angles[e]);
  }
  blended([](const Shape& shape) { return shape.volume_factor; }, [](const Shape& shape) { return shape.volume; },
          blend.volume_factor, blend.volume);
  return blend;
}

double SurfaceEnergy::evaluate(const Blend& blend, const VertexArray& positions, VertexArray& gradient) const {
  gradient.setZero(positions.rows(), 3);
  double energy = blend.constant;
  for (Eigen::Index e = 0; e < edge_count(); ++e) {
    const Edge& edge = edges_[static_cast<std::size_t>(e)];
    const Hinge hinge(edge, positions);
    const double stretch = hinge.length - blend.lengths[e], turn = hinge.angle - blend.angles[e];
    energy += blend.length_factors[e] * stretch * stretch + blend.angle_factors[e] * turn * turn;
    const Eigen::RowVector3d pull = 2 * blend.length_factors[e] * stretch / hinge.length * hinge.along.transpose();
    gradient.row(edge.to) += pull;
    gradient.row(edge.from) -= pull;
    hinge.add_angle_gradient(edge, 2 * blend.angle_factors[e] * turn, gradient);
  }
  const double growth = enclosed_volume(triangles_, positions) - blend.volume;
  energy += blend.volume_factor * growth * growth;
  for (const auto& triangle : triangles_.rowwise())
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d next = corner(positions, triangle[(i + 1) % 3]);
      const Eigen::Vector3d last = corner(positions, triangle[(i + 2) % 3]);
      gradient.row(triangle[i]) += blend.volume_factor * growth / 3 * next.cross(last).transpose();
    }
  return energy;
}

}  // namespace exmat::precompute

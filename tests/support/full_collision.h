#pragma once

#include <Eigen/Geometry>
#include <array>
#include <limits>

#include "common/core/decompositions.h"
#include "tests/support/mesh_distance.h"
#include "tests/support/synthetic_model.h"

namespace exmat::test {

/// The nearest point of a triangle to p, by the regions of its plane (Ericson, Real-Time Collision Detection, 5.1.5).
inline Eigen::Vector3d nearest_barycentric(const Eigen::Matrix3d& corners, const Eigen::Vector3d& p) {
  const Eigen::Vector3d a = corners.col(0), b = corners.col(1), c = corners.col(2);
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const double d1 = ab.dot(p - a), d2 = ac.dot(p - a), d3 = ab.dot(p - b), d4 = ac.dot(p - b), d5 = ab.dot(p - c),
               d6 = ac.dot(p - c);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  return Eigen::Vector3d(va, vb, vc) / (va + vb + vc);
}

/// Two bars with all their vertices, and what pushes them apart: half of the law at each vertex of one inside the
/// other, by a search over all triangles, inside and outside by the winding number.
class FullCollision {
 public:
  FullCollision(const Bar& bar, double stiffness)
      : bar_(bar),
        stiffness_(stiffness),
        mass_(bar.mass),
        rest_(bar.model.object->mesh.vertices.reshaped<Eigen::RowMajor>()) {
    const ContactData& contact = *bar.model.contact;
    areas_ = Eigen::VectorXd::Zero(rest_.size() / 3);
    for (Eigen::Index i = 0; i < contact.areas.size(); ++i) areas_[contact.vertices[i]] = contact.areas[i];
  }

  struct Motion {
    Eigen::VectorXd x, v;  ///< 3n
  };

  /// Positions and velocities of both after `time`, by the classical Runge-Kutta method.
  std::array<Motion, 2> run(std::array<Motion, 2> bodies, double time, int steps) const {
    const auto accelerations = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
      Eigen::VectorXd force_a = -full_internal_force(bar_, a - rest_), force_b = -full_internal_force(bar_, b - rest_);
      push(a, b, force_a, force_b);
      push(b, a, force_b, force_a);
      return std::array<Eigen::VectorXd, 2>{mass_.solve(force_a), mass_.solve(force_b)};
    };
    const double h = time / steps;
    for (int i = 0; i < steps; ++i) {
      auto& [a, b] = bodies;
      const auto a1 = accelerations(a.x, b.x);
      const std::array v2{Eigen::VectorXd(a.v + h / 2 * a1[0]), Eigen::VectorXd(b.v + h / 2 * a1[1])};
      const auto a2 = accelerations(a.x + h / 2 * a.v, b.x + h / 2 * b.v);
      const std::array v3{Eigen::VectorXd(a.v + h / 2 * a2[0]), Eigen::VectorXd(b.v + h / 2 * a2[1])};
      const auto a3 = accelerations(a.x + h / 2 * v2[0], b.x + h / 2 * v2[1]);
      const std::array v4{Eigen::VectorXd(a.v + h * a3[0]), Eigen::VectorXd(b.v + h * a3[1])};
      const auto a4 = accelerations(a.x + h * v3[0], b.x + h * v3[1]);
      for (std::size_t k = 0; k < 2; ++k) {
        Motion& body = bodies[k];
        body.x += h / 6 * (body.v + 2 * v2[k] + 2 * v3[k] + v4[k]);
        body.v += h / 6 * (a1[k] + 2 * a2[k] + 2 * a3[k] + a4[k]);
      }
    }
    return bodies;
  }

  const Eigen::VectorXd& rest() const { return rest_; }

 private:
  /// Adds what the vertices of a feel of the surface of b, and what that feels of them.
  void push(const Eigen::VectorXd& a, const Eigen::VectorXd& b, Eigen::VectorXd& force_a,
            Eigen::VectorXd& force_b) const {
    const TriangleArray& triangles = bar_.model.object->surface;
    const VertexArray surface = Eigen::Map<const VertexArray>(b.data(), b.size() / 3, 3);
    Eigen::AlignedBox3d box;
    for (Eigen::Index i = 0; i < b.size(); i += 3) box.extend(b.segment<3>(i));
    for (Eigen::Index i = 0; i < areas_.size(); ++i) {
      const Eigen::Vector3d p = a.segment<3>(3 * i);
      if (areas_[i] <= 0 || !box.contains(p) || winding_number(surface, triangles, p) < 0.5) continue;
      double nearest = std::numeric_limits<double>::infinity();
      Eigen::Vector3d shares = Eigen::Vector3d::Zero(), way = Eigen::Vector3d::Zero();
      Eigen::Index hit = 0;
      for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
        const Eigen::Matrix3d corners = corners_of(b, t);
        const Eigen::Vector3d at = nearest_barycentric(corners, p), offset = corners * at - p;
        if (offset.norm() >= nearest) continue;
        nearest = offset.norm();
        shares = at;
        way = offset;
        hit = t;
      }
      const Eigen::Vector3d force = 0.5 * stiffness_ * areas_[i] * way;  // its length is the depth
      force_a.segment<3>(3 * i) += force;
      for (int k = 0; k < 3; ++k) force_b.segment<3>(3 * triangles(hit, k)) -= shares[k] * force;
    }
  }

  Eigen::Matrix3d corners_of(const Eigen::VectorXd& x, Eigen::Index triangle) const {
    Eigen::Matrix3d corners;
    for (int k = 0; k < 3; ++k) corners.col(k) = x.segment<3>(3 * bar_.model.object->surface(triangle, k));
    return corners;
  }

  const Bar& bar_;
  double stiffness_;
  Eigen::LLT<Eigen::MatrixXd> mass_;
  Eigen::VectorXd rest_, areas_;
};

}  // namespace exmat::test

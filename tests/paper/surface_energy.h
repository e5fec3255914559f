#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "common/core/arrays.h"

namespace exmat::precompute {

/// Weights of the terms of SurfaceEnergy, without units.
struct SurfaceWeights {
  double stretching = 100, bending = 1, volume = 1000;
};

/// Difference between two shapes of a closed triangle mesh by stretching, bending and volume preservation, for shape k:
///   E_k(x) = stretching sum_e (l - L_k)^2 / L_k^2 + bending sum_e (theta - Theta_k)^2 L_k^2 / A_k
///            + volume (V - V_k)^2 / V_k^2
/// over the edges e, of length l and dihedral angle theta, A the area of the two triangles at e; V is the volume
/// inside. Without units, the same at any size. Grinspun et al. 2003, Froehlich and Botsch 2011.
class SurfaceEnergy {
 public:
  /// Every edge of the triangles has two of them, which run along it in opposite directions.
  SurfaceEnergy(const TriangleArray& triangles, const SurfaceWeights& weights);

  Eigen::Index edge_count() const { return std::ssize(edges_); }

  /// Parts of E_k by shape k; each term with the factor of its square.
  struct Shape {
    Eigen::VectorXd lengths, length_factors, angles, angle_factors;  ///< one for each edge
    double volume = 0, volume_factor = 0;
  };
  Shape shape(const VertexArray& positions) const;

  /// sum_k w_k E_k, in the form of one Shape and a constant.
  struct Blend : Shape {
    double constant = 0;
  };
  static Blend blend(const std::vector<Shape>& shapes, const Eigen::VectorXd& weights);

  /// Its value and, into `gradient` [n x 3], its derivative.
  double evaluate(const Blend& blend, const VertexArray& positions, VertexArray& gradient) const;

 private:
  // Triangles (from, to, left) and (to, from, right).
  struct Edge {
    std::int32_t from, to, left, right;
  };
  struct Hinge;

  TriangleArray triangles_;
  std::vector<Edge> edges_;
  SurfaceWeights weights_;
};

}  // namespace exmat::precompute

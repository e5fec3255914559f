#pragma once

#include <vector>

#include "precompute/alignment/arap_energy.h"
#include "precompute/alignment/cholesky_factor.h"
#include "precompute/alignment/surface_tree.h"

namespace exmat::precompute {

/// Points of a moving body and where they belong on a fixed one.
struct PointPairs {
  SparseMatrix points;  ///< l x n, values at the points from values at the vertices
  VertexArray targets;  ///< l x 3

  Eigen::Index count() const { return targets.rows(); }
};

/// A moving body laid over a fixed one, and how well.
struct Registered {
  VertexArray positions;    ///< n x 3, of the moving body's vertices in the frame of the fixed one
  double distortion = 0;    ///< mean |F - R|^2
  double chamfer = 0;       ///< two-way, mean squared distance of the surfaces
  double inverted = 0;      ///< share of the volume with det F < 0
  double landmark_rms = 0;  ///< distance of the pairs

  /// Misfit of the shapes: E_ARAP + 20 Chamfer^2 + 2 inverted.
  double misfit() const { return distortion + 20 * chamfer + 2 * inverted; }
  /// F of docs/alignment.md: that and 2 landmark RMS.
  double objective() const { return misfit() + 2 * landmark_rms; }
};

/// As-rigid-as-possible registration of one body's surface to another's, both of volume 1 at centroid 0. Each round
/// pairs samples of both surfaces with the nearest points that face the same way, then takes local and global steps
/// of E_ARAP + w (point-to-plane + a little point-to-point) + pairs given. Surfaces that are staircases are smoothed
/// (surface_smoothing) before they are compared. The global step is solved by conjugate
/// gradients, preconditioned by prefactored sparse Cholesky. docs/alignment.md, "How a pose on another mesh is
/// registered".
class Registration {
 public:
  Registration(const TetMesh& moving, const TetMesh& fixed, PointPairs pairs = {});

  /// From a start [n x 3], the weight growing from 20 to 400; to 80 where a surface is a staircase, which is
  /// no better known than that. Several may run at once.
  Registered run(const VertexArray& start) const;

  /// The first third of a run, which shows what it leads to, and the rest of it.
  Registered begin(const VertexArray& start) const;
  Registered finish(const VertexArray& begun) const;

  /// From a start that is nearly there, at the last weight.
  Registered refine(const VertexArray& start) const;

  /// Brings a registered body as near to the surface as the two surfaces agree, and no nearer, by lowering the weight
  /// to 1e-3 / Chamfer^2 while that grows fivefold at most. What tessellations have wrong is followed before; here the
  /// body's stiffness evens it out.
  VertexArray relaxed(const Registered& registered) const;

  Registered assess(const VertexArray& positions) const;

  const ArapEnergy& arap() const { return arap_; }
  const SurfaceTree& fixed_surface() const { return fixed_; }
  const TriangleArray& moving_triangles() const { return triangles_; }
  /// The moving surface as it is compared: without the steps of a staircase.
  SurfaceTree moved_surface(const VertexArray& positions) const { return {smoothing_ * positions, triangles_}; }

 private:
  struct SurfacePair;

  void rounds(int first, int end, VertexArray& positions) const;
  void round(double weight, VertexArray& positions) const;
  std::vector<SurfacePair> surface_pairs(const VertexArray& positions) const;
  const CholeskyFactor& preconditioner(double weight) const;

  ArapEnergy arap_;
  TriangleArray triangles_;
  Eigen::VectorXd areas_;   // of the moving triangles at rest, of sum 1
  SparseMatrix smoothing_;  // n x n
  SurfaceTree fixed_;
  double last_weight_;
  PointPairs pairs_;
  std::vector<CholeskyFactor> factors_;
};

}  // namespace exmat::precompute

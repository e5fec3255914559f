#pragma once

#include <cstddef>
#include <optional>

#include "common/mesh/assembly.h"
#include "precompute/study/measure/frames.h"

namespace exmat::precompute {

/// Distances of two motions over the root mean square of a size, in the norm |x|_M = sqrt(sum x^T M x): root mean
/// square, largest and last of all frames, and root mean square of those of the last tenth of the time. 0 where both
/// vanish, infinite where the size alone does.
struct RelativeError {
  double mean = 0, max = 0, end = 0, settled = 0;
};

/// docs/error_metrics.md.
struct TrajectoryErrors {
  RelativeError position;  ///< over the displacement from rest, world
  RelativeError velocity;  ///< over the velocity, world
  double energy = 0;       ///< largest difference of the total energy over the largest kinetic + elastic one
  std::optional<RelativeError> shape;  ///< free bodies: both without their rigid motion, over the deformation
  RelativeError nearest_phase;         ///< headline by nearest_distances(): a small delay does not count
  std::optional<double> rebound;       ///< error of the centre of mass's velocity after contact, where both had one
  std::size_t worst_frame = 0;         ///< frame where the distances of the headline are largest

  /// Error that points are chosen by: shape, where it is there, else position.
  const RelativeError& headline() const { return shape ? *shape : position; }
};

/// Errors of `frames` against those of the reference at the same times. `rest` [n x 3]; `mass` [n x n], weighted by
/// density.
TrajectoryErrors trajectory_errors(const BodyFrames& frames, const BodyFrames& reference, const VertexArray& rest,
                                   const SparseMatrix& mass, bool free_body);

/// Distance of two motions by the headline, over its size for a third: what parts of an error add up in. The distance
/// of A and C is at most that of A and B plus that of B and C.
RelativeError headline_distance(const BodyFrames& frames, const BodyFrames& other, const BodyFrames& sized_by,
                                const VertexArray& rest, const SparseMatrix& mass, bool free_body);

/// |x|_M of [n x 3] rows.
double mass_norm(const SparseMatrix& mass, const VertexArray& field);

/// [n x 3] `moved` turned and shifted so that it comes nearest to `fixed` in the mass. Kabsch 1976.
VertexArray fitted(const SparseMatrix& mass, const VertexArray& moved, const VertexArray& fixed);

}  // namespace exmat::precompute

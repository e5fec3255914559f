#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/core/arrays.h"
#include "runtime/kernels/kernels.h"

namespace exmat::runtime {

/// Positions rest + U q of k points of a constrained body, for drawing, in single precision. One pass over the basis,
/// 4 (r + 1) bytes a coordinate, as fast as memory delivers it. Immutable.
///
/// The displacement is summed first and added to the rest position last: with u = 2^-24,
///   |error| <= 2 u |x| + (r + 3) u sum_c |U_c q_c|,
/// two roundings of the coordinate itself (1.2e-7 m one metre from the origin); the rest shrinks with the displacement.
class VertexPositions {
 public:
  struct Workspace {
    std::vector<float> amplitudes;  ///< r + 1: q, then 1 for the rest positions
  };

  VertexPositions() = default;

  /// `rest` [k x 3] [m], `basis_rows` [3k x r], both rounded to single precision.
  VertexPositions(const VertexArray& rest, const RowMatrix& basis_rows);

  /// For any points of a model with r modes.
  static Workspace make_workspace(Eigen::Index modes);

  Eigen::Index points() const { return points_; }  ///< k
  Eigen::Index modes() const { return modes_; }    ///< r
  double bytes() const;                            ///< that one evaluation reads

  /// xyz [3k] [m] at q [r]. Writes those 3k floats and no more.
  void evaluate(const Eigen::VectorXd& q, Workspace& workspace, float* xyz,
                const Kernels& instructions = kernels()) const noexcept;

 private:
  static constexpr Eigen::Index kBlock = 16;  ///< floats, see Kernels::positions
  struct alignas(kAlignment) Block {
    float values[kBlock] = {};
  };

  Eigen::Index points_ = 0, modes_ = 0;
  std::vector<Block> basis_;  ///< blocks x (r + 1): the modes, then the rest positions
};

}  // namespace exmat::runtime

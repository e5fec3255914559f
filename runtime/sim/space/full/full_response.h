#pragma once

#include <Eigen/Core>

#include "common/core/arrays.h"
#include "runtime/sim/space/full/full_body.h"

namespace exmat::runtime {

/// k material points of a mesh: `shares` [k x c] of its vertices `corners` [k x c], each row of sum 1.
struct VertexPoints {
  const IndexMatrix& corners;
  const RowMatrix& shares;
};

/// ImpulseResponse of a body in full space, by conjugate gradients to 1e-5 of the velocities: c of them for c columns.
/// Refers to all that it is made of; the state changes by apply() alone.
class FullImpulseResponse {
 public:
  FullImpulseResponse(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                      Workspace& workspace, FullWorkspace& own);

  /// [3k] of the points, world [m/s].
  Eigen::VectorXd velocity(const VertexPoints& points) const;
  /// [3k x 3k] W, world [1/kg]. Vertices that something else moves have none.
  Eigen::MatrixXd compliance(const VertexPoints& points);
  /// ImpulseResponse::apply().
  void apply(const VertexPoints& points, const Eigen::VectorXd& impulses);

 private:
  const FullModel& full_;
  const Model& model_;
  const State& state_;
  FullBodyStep step_;
  Eigen::VectorXd field_;
};

}  // namespace exmat::runtime

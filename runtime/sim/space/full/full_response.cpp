#include "runtime/sim/space/full/full_response.h"

namespace exmat::runtime {
namespace {

/// Calls use(i, share, place) of each corner of the points that moves by itself.
template <typename Use>
void for_corners(const FullSpace& space, const VertexPoints& points, const Use& use) {
  for (Eigen::Index i = 0; i < points.corners.rows(); ++i)
    for (Eigen::Index c = 0; c < points.corners.cols(); ++c)
      if (space.number(points.corners(i, c)) >= 0) use(i, points.shares(i, c), space.place(points.corners(i, c)));
}

}  // namespace

FullImpulseResponse::FullImpulseResponse(const FullModel& full, const Model& model, const StepScene& scene,
                                         State& state, Workspace& workspace, FullWorkspace& own)
    : full_(full),
      model_(model),
      state_(state),
      step_(full, model, scene, state, workspace, own),
      field_(Eigen::VectorXd::Zero(full.space.field_size())) {
  step_.stand();
}

Eigen::VectorXd FullImpulseResponse::velocity(const VertexPoints& points) const {
  const Placement placement = model_.frame->placement(state_.frame);
  const FrameVelocity frame = model_.frame->velocity(state_.frame);
  Eigen::VectorXd velocity = Eigen::VectorXd::Zero(3 * points.corners.rows());
  for (Eigen::Index i = 0; i < points.corners.rows(); ++i)
    for (Eigen::Index c = 0; c < points.corners.cols(); ++c)
      velocity.segment<3>(3 * i) +=
          points.shares(i, c) * full_velocity(full_, placement, frame, *state_.full, points.corners(i, c));
  return velocity;
}

Eigen::MatrixXd FullImpulseResponse::compliance(const VertexPoints& points) {
  const FullSpace& space = full_.space;
  const Eigen::Index size = 3 * points.corners.rows();
  Eigen::MatrixXd W = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index column = 0; column < size; ++column) {
    field_.setZero();
    for_corners(space, points, [&](Eigen::Index i, double share, Eigen::Index place) {
      if (i == column / 3) field_[4 * place + column % 3] += share;
    });
    step_.step().respond(field_);
    for_corners(space, points, [&](Eigen::Index i, double share, Eigen::Index place) {
      W.block<3, 1>(3 * i, column) += share * field_.segment<3>(4 * place);
    });
  }
  return W;
}

void FullImpulseResponse::apply(const VertexPoints& points, const Eigen::VectorXd& impulses) {
  field_.setZero();
  for_corners(full_.space, points, [&](Eigen::Index i, double share, Eigen::Index place) {
    field_.segment<3>(4 * place) += share * impulses.segment<3>(3 * i);
  });
  step_.push(field_);
}

}  // namespace exmat::runtime

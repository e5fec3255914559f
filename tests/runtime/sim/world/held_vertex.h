#pragma once

#include "runtime/sim/step/contact_step.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime::test {

/// Holds one vertex in a frame at the origin.
inline Attachment held_vertex(const Model& model, const exmat::test::Bar& bar, const State& state, Eigen::Index vertex,
                              AttachmentKind kind) {
  Attachment attachment;
  attachment.kind = kind;
  attachment.vertices = {static_cast<std::int32_t>(vertex)};
  attachment.shares = Eigen::VectorXd::Ones(1);
  const BodyPose pose = pose_of(model, state);
  VertexArray rest = bar.model.object->mesh.vertices.row(vertex);
  attachment.places = pose.to_world(rest.row(0).transpose());
  rest.rowwise() -= model.frame->origin().transpose();
  attachment.patch = reduce_patch(rest, bar.basis().middleRows<3>(3 * vertex), attachment.shares, attachment.places,
                                  attachment.kind == AttachmentKind::kFixed);
  attachment.mean = attachment.mean_before = mean_of(attachment, pose);
  return attachment;
}

}  // namespace exmat::runtime::test

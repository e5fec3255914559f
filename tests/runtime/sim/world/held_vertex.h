#pragma once

#include <vector>

#include "runtime/sim/step/contact_step.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime::test {

/// Holds vertices in a frame at the origin, all with the same share of the mean.
inline Attachment held_patch(const Model& model, const exmat::test::Bar& bar, const State& state,
                             const std::vector<Eigen::Index>& vertices, AttachmentKind kind) {
  const auto count = std::ssize(vertices);
  Attachment attachment;
  attachment.kind = kind;
  attachment.shares = Eigen::VectorXd::Constant(count, 1.0 / static_cast<double>(count));
  attachment.places.resize(3, count);
  const BodyPose pose = pose_of(model, state);
  VertexArray rest(count, 3);
  RowMatrix rows(3 * count, state.q.size());
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Index vertex = vertices[static_cast<std::size_t>(k)];
    attachment.vertices.push_back(static_cast<std::int32_t>(vertex));
    rest.row(k) = bar.model.object->mesh.vertices.row(vertex);
    rows.middleRows<3>(3 * k) = bar.basis().middleRows<3>(3 * vertex);
    attachment.places.col(k) = pose.to_world(rest.row(k).transpose());
  }
  rest.rowwise() -= model.frame->origin().transpose();
  attachment.patch =
      reduce_patch(rest, rows, attachment.shares, attachment.places, attachment.kind == AttachmentKind::kFixed);
  attachment.mean = attachment.mean_before = mean_of(attachment, pose);
  return attachment;
}
inline Attachment held_vertex(const Model& model, const exmat::test::Bar& bar, const State& state, Eigen::Index vertex,
                              AttachmentKind kind) {
  return held_patch(model, bar, state, {vertex}, kind);
}

}  // namespace exmat::runtime::test

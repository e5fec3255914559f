#include "runtime/scene/contact_load.h"

#include <span>

namespace exmat::runtime {

void add_contact_load(const Model& model, const State& state, const Workspace& workspace, Eigen::VectorXd& load) {
  if (!workspace.near) return;
  const ContactWorkspace& contact = workspace.near->contact;
  const Eigen::Matrix3d to_own = model.frame->placement(state.frame).rotation.transpose();
  for (const ContactCandidate& candidate : std::span(contact.candidates).first(contact.candidate_count))
    if (candidate.normal_force > 0)
      load.segment<3>(3 * static_cast<Eigen::Index>(model.contact->object_vertex(candidate.vertex))) +=
          to_own * candidate.force;
}

}  // namespace exmat::runtime

#include "runtime/sim/lanes/lane_frames.h"

namespace exmat::runtime {
namespace {

const FreeMotionWorkspace& free_motion(const Workspace& body) { return *std::get_if<FreeMotionWorkspace>(&body.frame); }
FreeMotionWorkspace& free_motion(Workspace& body) { return *std::get_if<FreeMotionWorkspace>(&body.frame); }

template <class Work>
void each(std::span<Workspace* const> bodies, const LaneNumbers& chosen, Work work) {
  for (std::size_t l = 0; l < bodies.size(); ++l)
    if (chosen[static_cast<Eigen::Index>(l)] != 0) work(*bodies[l], static_cast<Eigen::Index>(l));
}

}  // namespace

LaneFrames::LaneFrames(const Model& model) : frame_(model.frame.get()), exert_forces_(frame_->exerts_forces()) {
  if (const DeformingInertia* inertia = frame_->inertia_of_momenta())
    rotation_.emplace(*inertia);
  else if (exert_forces_)
    stiffness_.setZero(model.modes(), model.modes());
}

void LaneFrames::set_problem(Eigen::Index lane, const Workspace& body) noexcept {
  if (rotation_) rotation_->set_problem(lane, free_motion(body));
}

void LaneFrames::begin(const LaneNumbers& velocity_factor, const LaneVectors& velocity_centre) noexcept {
  if (rotation_) rotation_->begin(velocity_factor, velocity_centre);
}

void LaneFrames::begin_contact(Eigen::Index lane) noexcept {
  if (rotation_) rotation_->begin_given(lane);
}

LaneNumbers LaneFrames::update(std::span<Workspace* const> bodies, const LaneNumbers& chosen,
                               const LaneNumbers& meeting, const LaneVectors& q, LaneVectors& gradient) noexcept {
  LaneNumbers found = LaneNumbers::Ones();
  if (rotation_) {
    const LaneNumbers given = chosen * meeting;
    each(bodies, given, [&](Workspace& own, Eigen::Index lane) { rotation_->give(lane, free_motion(own)); });
    found = (given != 0).select(found, rotation_->update(chosen - given, q, gradient));
    gradient = -gradient;
    each(bodies, given, [&](Workspace& own, Eigen::Index lane) {
      FreeMotionWorkspace& free = free_motion(own);
      rotation_->take(lane, free);
      free.moments.inertia = rotation_->inertia(lane);
      own.q = q.row(lane).matrix();
      free.velocity = own.form.velocity_factor * (own.q - own.form.velocity_centre);
    });
    return found;
  }
  each(bodies, chosen, [&](Workspace& own, Eigen::Index lane) {
    own.q = q.row(lane).matrix();
    if (!frame_->update_force(own.q, own.form.velocity_factor, own.form.velocity_centre, own.frame)) found[lane] = 0;
    gradient.row(lane) = -frame_->force(own.frame)->transpose().array();
  });
  return found;
}

void LaneFrames::add_stiffness(std::span<Workspace* const> bodies, const LaneNumbers& chosen,
                               const LaneNumbers& meeting, AlignedArray& hessian) noexcept {
  if (rotation_) {
    rotation_->add_stiffness(chosen * (1 - meeting), hessian);
    return;
  }
  each(bodies, chosen, [&](Workspace& own, Eigen::Index lane) {
    stiffness_.setZero();
    frame_->add_stiffness(own.form.velocity_factor, own.frame, stiffness_);
    for (Eigen::Index j = 0; j < stiffness_.cols(); ++j)
      for (Eigen::Index i = j; i < stiffness_.rows(); ++i) hessian[lane_entry(i, j) + lane] += stiffness_(i, j);
  });
}

void LaneFrames::set_rigid_rows(std::span<Workspace* const> bodies, const LaneNumbers& meeting,
                                AlignedArray& hessian) const noexcept {
  const DeformingInertia& inertia = *frame_->inertia_of_momenta();
  const Eigen::Index modes = inertia.modes(), turn = modes + 3;
  for (Eigen::Index row = modes; row < modes + frame_->rigid_unknowns(); ++row)
    for (Eigen::Index column = 0; column <= row; ++column)
      for (Eigen::Index lane = 0; lane < kLanes; ++lane)
        hessian[lane_entry(row, column) + lane] = row == column && meeting[lane] == 0 ? 1 : 0;
  each(bodies, meeting, [&](const Workspace& own, Eigen::Index lane) {
    const FreeMotionWorkspace& free = free_motion(own);
    const double factor = free.unknowns.velocity_factor() * free.unknowns.velocity_factor();
    for (Eigen::Index c = 0; c < 3; ++c) {
      hessian[lane_entry(modes + c, modes + c) + lane] = factor * inertia.mass();
      for (Eigen::Index j = 0; j < modes; ++j)
        hessian[lane_entry(turn + c, j) + lane] = factor * free.moments.deformation()(j, c);
      for (Eigen::Index d = 0; d <= c; ++d)
        hessian[lane_entry(turn + c, turn + d) + lane] = factor * free.moments.inertia(c, d);
    }
  });
}

LaneNumbers LaneFrames::gyroscopic_ratios(std::span<Workspace* const> bodies) const noexcept {
  if (rotation_) return rotation_->gyroscopic_ratio();
  LaneNumbers ratios = LaneNumbers::Zero();
  for (std::size_t l = 0; l < bodies.size(); ++l)
    ratios[static_cast<Eigen::Index>(l)] = frame_->gyroscopic_ratio(bodies[l]->form.velocity_factor, bodies[l]->frame);
  return ratios;
}

void LaneFrames::gyroscopic_products(std::span<Workspace* const> bodies, const LaneNumbers& chosen,
                                     const LaneVectors& x, LaneVectors& products) noexcept {
  if (rotation_) {
    rotation_->gyroscopic_product(x, products);
    return;
  }
  each(bodies, chosen, [&](Workspace& own, Eigen::Index lane) {
    own.q = x.row(lane).matrix();
    products.row(lane) = frame_->gyroscopic_product(own.form.velocity_factor, own.q, own.frame)->transpose().array();
  });
}

void LaneFrames::take(Eigen::Index lane, Workspace& body) const noexcept {
  if (rotation_) rotation_->take(lane, free_motion(body));
}

}  // namespace exmat::runtime

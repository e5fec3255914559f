#include "runtime/sim/lanes/lane_frames.h"

namespace exmat::runtime {
namespace {

const FreeMotionWorkspace& free_motion(const Workspace& body) { return *std::get_if<FreeMotionWorkspace>(&body.frame); }

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

LaneNumbers LaneFrames::update(std::span<Workspace* const> bodies, const LaneNumbers& chosen, const LaneVectors& q,
                               LaneVectors& gradient) noexcept {
  LaneNumbers found = LaneNumbers::Ones();
  if (rotation_) {
    found = rotation_->update(chosen, q, gradient);
    gradient = -gradient;
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
                               AlignedArray& hessian) noexcept {
  if (rotation_) {
    rotation_->add_stiffness(chosen, hessian);
    return;
  }
  each(bodies, chosen, [&](Workspace& own, Eigen::Index lane) {
    stiffness_.setZero();
    frame_->add_stiffness(own.form.velocity_factor, own.frame, stiffness_);
    for (Eigen::Index j = 0; j < stiffness_.cols(); ++j)
      for (Eigen::Index i = j; i < stiffness_.rows(); ++i) hessian[lane_entry(i, j) + lane] += stiffness_(i, j);
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
  if (rotation_) rotation_->take(lane, *std::get_if<FreeMotionWorkspace>(&body.frame));
}

}  // namespace exmat::runtime

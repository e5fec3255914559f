#include "runtime/sim/world/full_member.h"

namespace exmat::runtime {

FullMember::FullMember(const FullModel& full, const Model& model, const StepScene& scene, State& state,
                       Workspace& workspace, FullWorkspace& own, const TouchingSurface& touching)
    : full_(full),
      model_(model),
      scene_(scene),
      state_(state),
      workspace_(workspace),
      own_(own),
      surface_(*model.contact, touching),
      gradient_(Eigen::VectorXd::Zero(full.space.field_size())) {}

/// The surface goes with the body's frame; on bones, whose frame stands still, with the mean of the flesh.
void FullMember::place_surface() {
  const Placement frame = model_.frame->placement(state_.frame);
  const FrameVelocity moves = model_.frame->velocity(state_.frame);
  const auto position = [&](int vertex) -> Eigen::Vector3d {
    return full_.rest.row(vertex).transpose() + full_displacement(full_, frame, *state_.full, vertex);
  };
  const auto velocity = [&](int vertex) { return full_velocity(full_, frame, moves, *state_.full, vertex); };
  if (!full_.skin) return surface_.place(frame, moves, position, velocity);
  const auto mean_of = [](const Eigen::VectorXd& field) -> Eigen::Vector3d {
    return Eigen::Map<const Eigen::Matrix3Xd>(field.data(), 3, field.size() / 3).rowwise().mean();
  };
  Placement mean = frame;
  mean.position += mean_of(state_.full->q);
  surface_.place(mean, FrameVelocity{.linear = mean_of(state_.full->v)}, position, velocity);
}

bool FullMember::begin(const StepScene& scene, double pushed) noexcept {
  step_.emplace(full_, model_, scene, state_, workspace_, own_);
  return step_->begin(/*touches_others=*/true, pushed);
}

void FullMember::drop_driven(BodyCandidates& candidates) const noexcept {
  for (std::size_t i = 0; i < candidates.all.size(); ++i) {
    bool is_free = false;
    for (const bool is_vertex : {true, false})
      for_places(candidates, i, is_vertex, [&](std::int32_t, double) { is_free = true; });
    if (!is_free) candidates.all[i].stiffness = 0;
  }
}

void FullMember::stay(Eigen::Ref<Eigen::VectorXd> d) noexcept {
  step_->step().stay(own_.trial);
  d = own_.trial;
}

void FullMember::start(const Eigen::VectorXd& d, Tangent tangent) noexcept {
  const auto tangents =
      tangent == Tangent::kExact ? FullPotential::Tangents::kExact : FullPotential::Tangents::kProjected;
  step_->step().potential().evaluate_elements(d, tangents, false);
}

PotentialEvaluation FullMember::evaluate(const Eigen::VectorXd& d, bool started) noexcept {
  FullPotential& potential = step_->step().potential();
  if (!started) potential.evaluate_elements(d, FullPotential::Tangents::kNone, false);
  return potential.gradient_there(d, gradient_);
}

Placement FullMember::placement() const noexcept {
  Placement placement = model_.frame->placement(state_.frame);
  if (full_.rigid) placement.position = full_.rigid->centre(own_.potential.x.data());
  return placement;
}

void FullMember::multiply(const Eigen::Ref<const Eigen::VectorXd>& x, Eigen::Ref<Eigen::VectorXd> product) noexcept {
  own_.search.vector() = x.cast<float>();
  step_->step().multiply();
  product = own_.image.vector().cast<double>();
  product.tail(4 * full_.space.driven()).setZero();
}

void FullMember::precondition(const Eigen::Ref<const Eigen::VectorXd>& residual,
                              Eigen::Ref<Eigen::VectorXd> result) noexcept {
  own_.residual.vector() = residual.cast<float>();
  step_->step().precondition();
  result = own_.solved.vector().cast<double>();
}

const StepReport& FullMember::finish(NewtonStatus status, const Eigen::VectorXd& d,
                                     const FrameMomenta& others) noexcept {
  step_->step().set_solution(status, d);
  return step_->finish(others);
}

std::optional<FrameMomenta> FullMember::expected_momenta() noexcept {
  if (!full_.rigid || is_driven()) return std::nullopt;
  return step_->step().expected_momenta();
}

}  // namespace exmat::runtime

#include "runtime/sim/space/full/full_potential.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace exmat::runtime {
namespace {

using Field = Eigen::Map<Eigen::VectorXd>;

constexpr double kFar = 1000;  // of the extent

}  // namespace

FullPotentialWorkspace::FullPotentialWorkspace(const FullModel& model)
    : start(Eigen::VectorXd::Zero(model.space.field_size())),
      offset(start),
      rate(start),
      external(start),
      frame_rate(start),
      unused(start),
      x(start.size()),
      a(x),
      w(x),
      inertia(x),
      force(x),
      beside(x),
      frozen(model.space.padded_elements() * kTangentNumbers),
      tangents(model.space.padded_elements() * kTangentNumbers),
      lines(model.space.padded_elements() * kMeshLine),
      coefficients(model.space.coefficients()),
      rate_coefficients(coefficients),
      target(Eigen::VectorXd::Zero(3 * model.space.functions())),
      raw(target),
      spring(target),
      damper(target) {
  if (std::ranges::any_of(model.examples, &FullExamples::is_elastic))
    elastic_target = model.space.make_target(std::ssize(model.examples));
  if (model.rigid) rigid = RigidWorkspace(model.space);
  if (model.skin) skin = model.skin->make_pose();
  if (model.skin || model.rigid) turned = start;
}

void FullPotential::begin(const Eigen::VectorXd& q, const Eigen::VectorXd& external) noexcept {
  FullPotentialWorkspace& work = workspace_;
  space_.to_field(form_.acceleration_centre, work.offset);
  space_.to_field(form_.velocity_centre, work.rate);
  space_.to_field(q, work.start);
  space_.to_field(external, work.external);
  work.offset = work.start - work.offset;
  work.rate = work.start - work.rate;
  external_norm_ = work.external.norm();
  reach_ = space_.extent() + work.start.lpNorm<Eigen::Infinity>();
}

MeshInertia FullPotential::terms() const noexcept {
  return {elements_at_,
          workspace_.a.data(),
          workspace_.w.data(),
          form_.acceleration_factor,
          scene_.mass_damping * form_.velocity_factor,
          scene_.stiffness_damping * form_.velocity_factor};
}

// The inertia of fixed vertices is that of their acceleration, and nothing of their rate is beside the frame's.
void FullPotential::drive(const MotionSample& from, const MotionSample& to) noexcept {
  const CarriedPart& carried = *model_.carried;
  FullPotentialWorkspace& work = workspace_;
  frame_ = to;
  carried.place_fixed(from, work.start);
  for (Eigen::Index place = space_.vertices(); place < space_.places(); ++place) {
    const Eigen::Vector3d way = carried.displacement(to, place) - carried.displacement(from, place);
    work.offset.segment<3>(4 * place) = carried.acceleration(to, place) / form_.acceleration_factor - way;
    work.rate.segment<3>(4 * place) = carried.velocity(to, place) / form_.velocity_factor - way;
  }
}

void FullPotential::hang(const SkeletonMotion& bones, const StepForm& fixed, const Eigen::VectorXd& way,
                         bool second_order) noexcept {
  FullPotentialWorkspace& work = workspace_;
  // As the form differentiates what the vertices are displaced by, so it does the bones' part of it.
  work.frame_rate = way;
  if (second_order) {
    space_.to_field(bones.way_previous, work.unused);
    work.frame_rate -= work.unused / 3;
  }
  for (Eigen::Index place = space_.vertices(), at = 0; place < space_.places(); ++place, at += 3) {
    const Eigen::Vector3d here = bones.q.segment<3>(at);
    work.offset.segment<3>(4 * place) = here - fixed.acceleration_centre.segment<3>(at);
    work.rate.segment<3>(4 * place) = here - fixed.velocity_centre.segment<3>(at);
    work.frame_rate.segment<3>(4 * place) = work.rate.segment<3>(4 * place) + way.segment<3>(4 * place);
  }
}

void FullPotential::set_attachments(std::span<Attachment> attachments) noexcept {
  attachments_ = attachments;
  const auto first = std::ranges::find_if(attachments, &Attachment::holds);
  host_ = first == attachments.end() ? nullptr : &*first;
}

// Damping acts on a held free body beside the host's motion: that of its frame where the frame holds the patch's
// vertices, else that of its anchor with the body's turn at the first iterate.
void FullPotential::remove_host_motion(bool freeze) noexcept {
  const RigidWorkspace& rigid = workspace_.rigid;
  const double per_rate = 1 / (scene_.time_step * form_.velocity_factor);
  if (freeze && host_->kind == AttachmentKind::kFixed) {
    const Eigen::AngleAxisd turn(host_->rotation * host_->rotation_before.transpose());
    host_turn_ = per_rate * turn.angle() * turn.axis();
  } else if (freeze) {
    host_turn_ = model_.rigid->spin(workspace_.w.data(), rigid);
  }
  const Eigen::Vector3d way = per_rate * (host_->anchor() - host_->anchor_before());
  const Eigen::Vector3d at_centre = way + host_turn_.cross(rigid.centre - host_->anchor());
  RigidPart::add_motion({-at_centre, -host_turn_}, rigid, workspace_.w.data());
}

double FullPotential::undamped_at(const Eigen::VectorXd& d, double elastic_energy) noexcept {
  const Eigen::Index size = space_.field_size();
  Field(workspace_.a.data(), size) = workspace_.offset + d;
  std::array<double, kMeshSums> sums{};
  kernels().mesh_inertia(space_.arrays(), terms(), workspace_.inertia.data(), workspace_.force.data(), sums.data());
  return sums[0] + elastic_energy - workspace_.external.dot(d);
}

// x, or far from the origin x less the displacement of a vertex: elements see differences alone, and products with the
// variance would lose their digits.
const double* FullPotential::near_field() noexcept {
  FullPotentialWorkspace& work = workspace_;
  const bool may_go = !space_.is_clamped() || model_.is_driven();
  if (!may_go || reach_ <= kFar * space_.extent()) return work.x.data();
  const Eigen::Map<const Eigen::Matrix4Xd> x(work.x.data(), 4, space_.places());
  Eigen::Map<Eigen::Matrix4Xd>(work.beside.data(), 4, space_.places()) = x.colwise() - Eigen::Vector4d(x.col(0));
  return work.beside.data();
}

void FullPotential::evaluate_elements(const Eigen::VectorXd& d, Tangents tangents, bool freeze) noexcept {
  const Eigen::Index size = space_.field_size();
  FullPotentialWorkspace& work = workspace_;
  coefficients_stand_ = false;
  Field(work.x.data(), size) = work.start + d;
  Field(work.a.data(), size) = work.offset + d;
  Field(work.w.data(), size) = work.rate + d;
  if (model_.rigid) {
    if (freeze) model_.rigid->place(work.x.data(), work.rigid);
    if (damps()) host_ == nullptr ? model_.rigid->remove_motion(work.rigid, work.w.data()) : remove_host_motion(freeze);
  }
  if (model_.carried && damps()) {
    if (freeze) model_.carried->frame_velocity(frame_, work.x.data(), 1 / form_.velocity_factor, work.frame_rate);
    Field(work.w.data(), size) -= work.frame_rate;
  }
  if (model_.skin && damps()) Field(work.w.data(), size) -= work.frame_rate;
  const MeshArrays mesh = space_.arrays();
  const ElementLaw law = space_.law(), pulled = has_elastic_target_ ? space_.law(work.elastic_target) : law;
  const ElementLaw* const example = has_elastic_target_ ? &pulled : nullptr;
  elements_at_ = near_field();
  const MeshInertia own = terms();
  const Kernels& run = kernels();
  run.mesh_inertia(mesh, own, work.inertia.data(), work.force.data(), sums_.data());
  if (tangents == Tangents::kExact) {
    run.mesh_force_and_tangents(mesh, law, example, own, freeze, work.frozen.data(), work.tangents.data(),
                                work.lines.data(), work.force.data(), sums_.data());
  } else {
    if (tangents == Tangents::kProjected)
      space_.projected_tangents(elements_at_, has_elastic_target_ ? &work.elastic_target : nullptr,
                                own.stiffness_damping, freeze, work.frozen.data(), work.tangents.data());
    run.mesh_force(mesh, law, example, own, work.frozen.data(), work.lines.data(), work.force.data(), sums_.data());
  }
  work_ = work.external.dot(d);
}

void FullPotential::set_elastic_target(std::size_t group, const Eigen::VectorXd& shape) noexcept {
  if (!has_elastic_target_) workspace_.elastic_target.set_none();
  space_.set_target(shape.data(), elastic_factor(scene_.examples[group]), model_.examples[group].shares, group,
                    workspace_.elastic_target);
  has_elastic_target_ = true;
}

void FullPotential::set_coefficients() noexcept {
  if (coefficients_stand_) return;
  coefficients_stand_ = true;
  const double* field = workspace_.x.data();
  if (model_.skin) {
    model_.skin->to_own(workspace_.skin, field, workspace_.turned.data());
    field = workspace_.turned.data();
  }
  kernels().mesh_coefficients(space_.filter(), field, workspace_.coefficients.data());
  if (!has_moving_frame()) return;
  if (model_.rigid) {
    turn_ = model_.rigid->turn(field);
    examples_frame_.rotation = turn_.rotation;
  } else {
    examples_frame_ = {frame_.rotation, frame_.position};
  }
  for (Eigen::Index k = 0; k < space_.functions(); ++k) {
    auto own = at(workspace_.coefficients, k);
    own = model_.functions.to_frame(k, examples_frame_, own);
  }
}

// `from`: null, or from the axes that the region sees in to those of the coefficients.
void FullPotential::see(const FullExamples& examples, AlignedArray& coefficients, const Eigen::Matrix3d* from,
                        Eigen::VectorXd& seen) noexcept {
  const Eigen::Index columns = examples.columns();
  for (Eigen::Index k = 0; k < columns; ++k) {
    const Eigen::Vector3d own = at(coefficients, examples.first + k);
    workspace_.raw.segment<3>(3 * k) = from == nullptr ? own : from->transpose() * own;
  }
  if (examples.seen.size() == 0)
    seen.head(3 * columns) = workspace_.raw.head(3 * columns);
  else
    seen.head(3 * examples.functions).noalias() = examples.seen * workspace_.raw.head(3 * columns);
}

void FullPotential::see(const FullExamples& examples, Eigen::VectorXd& seen) noexcept {
  see(examples, workspace_.coefficients, nullptr, seen);
}

// Its transpose, of a force [3m]; `to` likewise.
void FullPotential::put_force(const FullExamples& examples, Eigen::VectorXd& force, const Eigen::Matrix3d* to,
                              AlignedArray& coefficients) noexcept {
  const Eigen::Index columns = examples.columns();
  Eigen::VectorXd* from = &force;
  if (examples.seen.size() > 0) {
    from = &workspace_.raw;
    from->head(3 * columns).noalias() = examples.seen.transpose() * force.head(3 * examples.functions);
  }
  for (Eigen::Index k = 0; k < columns; ++k) {
    auto own = at(coefficients, examples.first + k);
    own = from->segment<3>(3 * k);
    if (to != nullptr) own = (*to * own).eval();
  }
}

PotentialEvaluation FullPotential::gradient_there(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) noexcept {
  const Eigen::Index size = space_.field_size();
  FullPotentialWorkspace& work = workspace_;
  const Field inertia(work.inertia.data(), size), force(work.force.data(), size);
  PotentialEvaluation evaluation;
  // A vertex is known to rounding: no residual comes below what that makes of its force.
  double times = 1;
  for (const ExampleSettings& own : scene_.examples) times += has_elastic_target_ ? elastic_factor(own) : 0;
  evaluation.force_scale = external_norm_ + inertia.norm() + force.norm() +
                           times * kPlaceRounding * reach_ * space_.stiffness() / scene_.space.newton.tolerance;
  PotentialValue& total = evaluation.potential;
  total.value = sums_[0] + sums_[1] + sums_[2] + sums_[3];
  // Elastic energies are differences of terms as large as at strains about 1.
  total.magnitude = total.value + work.external.cwiseAbs().dot(d.cwiseAbs()) + reach_ * force.lpNorm<1>() +
                    times * space_.shear_energy();
  total.value -= work_;
  gradient = force;
  if (filters()) set_filter_coefficients(total);
  if (model_.rigid && damps() && host_ == nullptr) {
    // Damping sees velocities without the rigid motion of the body; all else here has no torque.
    if (damps_filtered())
      kernels().mesh_add_functions(space_.filter(), 1, work.rate_coefficients.data(), gradient.data());
    model_.rigid->remove_rigid_force(work.x.data(), work.rigid, gradient.data());
  }
  gradient += inertia - work.external;
  gradient.tail(4 * space_.driven()).setZero();
  if (filters()) add_filter_force(gradient);
  if (contact_ != nullptr) add_contacts(evaluation, gradient);
  if (!attachments_.empty()) add_attachments(evaluation, gradient);
  return evaluation;
}

// Forces on coefficients, in `coefficients`; of the damper of a free body in `rate_coefficients`.
void FullPotential::set_filter_coefficients(PotentialValue& total) noexcept {
  FullPotentialWorkspace& work = workspace_;
  set_coefficients();
  coefficients_stand_ = false;
  if (damps_filtered()) {
    const double* rate = work.w.data();
    if (model_.skin) {
      model_.skin->turn_back(work.skin, rate, work.turned.data());
      rate = work.turned.data();
    }
    kernels().mesh_coefficients(space_.filter(), rate, work.rate_coefficients.data());
  }
  for (std::size_t group = 0; group < scene_.examples.size(); ++group) add_group(group, total);
  if (model_.rigid) return;
  for (Eigen::Index i = 0; i < work.coefficients.size(); ++i) work.coefficients[i] += work.rate_coefficients[i];
}

// Turns the group's coefficients into the forces on them.
void FullPotential::add_group(std::size_t group, PotentialValue& total) noexcept {
  FullPotentialWorkspace& work = workspace_;
  const FullExamples& examples = model_.examples[group];
  const double kappa = linear_stiffness(scene_.examples[group]);
  const double damping = scene_.examples[group].damping * form_.velocity_factor;
  auto spring = work.spring.head(3 * examples.functions), damper = work.damper.head(3 * examples.functions);
  spring.setZero();
  damper.setZero();
  if (kappa > 0) {
    see(examples, work.coefficients, nullptr, work.spring);
    spring -= work.target.segment(3 * examples.first, spring.size());
  }
  const Eigen::Matrix3d* const turn = has_moving_frame() ? &frame_rotation() : nullptr;
  if (damping > 0) see(examples, work.rate_coefficients, turn, work.damper);
  const double energy = 0.5 * (kappa * spring.squaredNorm() + damping * damper.squaredNorm());
  total.value += energy;
  total.magnitude += energy;
  spring *= kappa;
  damper *= damping;
  put_force(examples, work.spring, has_moving_frame() ? &examples_frame_.rotation : nullptr, work.coefficients);
  put_force(examples, work.damper, turn, work.rate_coefficients);
}

void FullPotential::add_filter_force(Eigen::VectorXd& gradient) noexcept {
  FullPotentialWorkspace& work = workspace_;
  const auto add = [&](const AlignedArray& coefficients, Eigen::VectorXd& field) {
    kernels().mesh_add_functions(space_.filter(), 1, coefficients.data(), field.data());
  };
  if (model_.skin) {
    work.turned.setZero();
    add(work.coefficients, work.turned);
    model_.skin->turn(work.skin, work.turned.data(), work.turned.data());
    gradient += work.turned;
  } else if (model_.rigid) {
    work.turned.setZero();
    add(work.coefficients, work.turned);
    model_.rigid->remove_torque(turn_, work.x.data(), work.turned.data());
    gradient += work.turned;
    if (host_ != nullptr) add(work.rate_coefficients, gradient);
  } else {
    add(work.coefficients, gradient);
  }
}

void FullPotential::add_contacts(PotentialEvaluation& evaluation, Eigen::VectorXd& gradient) noexcept {
  evaluation.force_scale += model_.contacts->evaluate(workspace_.x.data(), *contact_, gradient.data());
  evaluation.potential.value += contact_->potential;
  evaluation.potential.magnitude += contact_->potential;
  evaluation.force_scale += kPlaceRounding * reach_ * contact_->stiffness / scene_.space.newton.tolerance;
}

// The spring of a mean m is k/2 |m - a|^2, its damper c c_v/2 |m - m_v - (a - a_before)/(dt c_v)|^2, dt c_v that of
// backward Euler for the frame's part.
void FullPotential::add_attachments(PotentialEvaluation& evaluation, Eigen::VectorXd& gradient) noexcept {
  const double c_v = form_.velocity_factor;
  for (Attachment& attachment : attachments_) {
    attachment.force.setZero();
    attachment.torque.setZero();
    if (!attachment.holds() || attachment.kind != AttachmentKind::kSpring) continue;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero(), rate = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k) {
      const Eigen::Index vertex = attachment.vertices[k], place = 4 * space_.place(vertex);
      const double share = attachment.shares[static_cast<Eigen::Index>(k)];
      const Eigen::Vector3d x = Eigen::Map<const Eigen::Vector3d>(workspace_.x.data() + place);
      mean += share * (model_.rest.row(vertex).transpose() + x);
      rate += share * (workspace_.rate.segment<3>(place) + x - workspace_.start.segment<3>(place));
    }
    const Eigen::Vector3d stretch = mean - attachment.anchor();
    rate -= (attachment.anchor() - attachment.anchor_before()) / (scene_.time_step * c_v);
    const Eigen::Vector3d pull = attachment.stiffness * stretch + attachment.damping * c_v * rate;
    const double energy =
        0.5 * (attachment.stiffness * stretch.squaredNorm() + attachment.damping * c_v * rate.squaredNorm());
    evaluation.potential.value += energy;
    evaluation.potential.magnitude += energy;
    evaluation.force_scale += pull.norm();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k)
      gradient.segment<3>(4 * space_.place(attachment.vertices[k])) +=
          attachment.shares[static_cast<Eigen::Index>(k)] * pull;
    attachment.force = pull;
    attachment.torque = (attachment.anchor() - attachment.position).cross(pull);
  }
  project_held(space_, attachments_, gradient.data(),
               [](Attachment& attachment, Eigen::Index k, const Eigen::Vector3d& held) {
                 const bool fixed = attachment.kind == AttachmentKind::kFixed;
                 const Eigen::Vector3d at = fixed ? attachment.target(k) : attachment.anchor();
                 attachment.force -= held;
                 attachment.torque -= (at - attachment.position).cross(held);
               });
}

void FullPotential::add_springs(const float* field, float* image) const noexcept {
  for (const Attachment& attachment : attachments_) {
    if (!attachment.holds() || attachment.kind != AttachmentKind::kSpring) continue;
    const auto stiffness = static_cast<float>(attachment.stiffness + attachment.damping * form_.velocity_factor);
    Eigen::Vector3f mean = Eigen::Vector3f::Zero();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k)
      mean += static_cast<float>(attachment.shares[static_cast<Eigen::Index>(k)]) *
              Eigen::Map<const Eigen::Vector3f>(field + 4 * space_.place(attachment.vertices[k]));
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k)
      Eigen::Map<Eigen::Vector3f>(image + 4 * space_.place(attachment.vertices[k])) +=
          stiffness * static_cast<float>(attachment.shares[static_cast<Eigen::Index>(k)]) * mean;
  }
}

}  // namespace exmat::runtime

#include "runtime/sim/space/full/full_step.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {
namespace {

constexpr double kMostPredicted = 0.5;  // of an edge, that an unchecked predictor moves a vertex by
constexpr double kSlow = 0.1;           // of the residual: tangents that leave more are evaluated again
constexpr int kFarFromFrozen = 12;      // iterations after which the frame of a free body goes along with it
constexpr int kContactIterations = 60;  // of conjugate gradients near obstacles, at most
constexpr double kWeakFilter = 0.25;    // of the mass's share, that the preconditioner does without
constexpr double kLongStep = 0.008;     // [s]
constexpr double kDelicate = 0.1;       // of the accuracy, in long steps and without damping of stiffness
constexpr double kGain = 1e-6;          // of energies, to which steps are solved
constexpr FullAccuracy kResponse{1e-5, 300, 0};
constexpr double kForcing = 0.3;  // of what is left to the tolerance, that a direction is solved to

FullWorkspace::Key key_of(const StepScene& scene) {
  FullWorkspace::Key key{scene.time_step, scene.mass_damping, scene.stiffness_damping, scene.integrator, {}};
  for (const ExampleSettings& examples : scene.examples)
    key.pulls.push_back({linear_stiffness(examples), elastic_factor(examples), examples.damping});
  return key;
}

/// True if factors of the key are those of the scene; does not allocate.
bool serves(const FullWorkspace::Key& key, const StepScene& scene) noexcept {
  const auto is_same = [](const FullWorkspace::Key::Pull& own, const ExampleSettings& examples) {
    return own.stiffness == linear_stiffness(examples) && own.elasticity == elastic_factor(examples) &&
           own.damping == examples.damping;
  };
  return key.time_step == scene.time_step && key.mass_damping == scene.mass_damping &&
         key.stiffness_damping == scene.stiffness_damping && key.integrator == scene.integrator &&
         std::ranges::equal(key.pulls, scene.examples, is_same);
}

/// Product of a group's filter on the coefficients of its functions, of `stiffness`.
FullWorkspace::Filter make_filter(const FullExamples& examples, double stiffness) {
  FullWorkspace::Filter filter{examples.first, examples.columns(), static_cast<float>(stiffness), {}};
  if (examples.seen.size() > 0) filter.product = (stiffness * examples.seen.transpose() * examples.seen).cast<float>();
  return filter;
}

FullWorkspace::Linear make_linear(const FullModel& model, const FullWorkspace::Key& key, double time_scale,
                                  bool touches) {
  const FullSpace& space = model.space;
  const double c_v = 1 / time_scale;
  const double mass = c_v * c_v + key.mass_damping * c_v, stiffness = 1 + key.stiffness_damping * c_v;
  FullWorkspace::Linear linear;
  // What a region does not see of its band's motion the preconditioner takes as seen.
  Eigen::VectorXd of_functions = Eigen::VectorXd::Zero(space.functions());
  double elasticity = 0;
  for (std::size_t group = 0; group < key.pulls.size(); ++group) {
    const FullExamples& examples = model.examples[group];
    const double filter = key.pulls[group].stiffness + key.pulls[group].damping * c_v;
    elasticity += key.pulls[group].elasticity;
    linear.filters.push_back(make_filter(examples, filter));
    of_functions.segment(examples.first, examples.functions).setConstant(filter);
  }
  linear.is_filtered = !of_functions.isZero(0);
  // A weak filter beside the mass changes no more than what conjugate gradients do anyway.
  if (of_functions.size() > 0 && of_functions.maxCoeff() <= kWeakFilter * mass) of_functions.setZero();
  linear.preconditioner = FullPreconditioner(space, mass, stiffness + elasticity, of_functions, touches);
  for (Eigen::Index k = 0; k < space.entries(); ++k)
    linear.matrix.push_back(static_cast<float>(mass * space.mass_value(k) + stiffness * space.variance_value(k)));
  return linear;
}

bool jumps(const StepScene& scene, const Motion& state) {
  const double midpoint = state.time + 0.5 * scene.time_step;
  const double before = midpoint - scene.time_step;
  return state.begins_anew || scene.begins_anew || scene.forces_jump(before, midpoint) ||
         (scene.carrier && scene.carrier->has_key(before, midpoint));
}

/// Frame of a carried body; the identity where nothing carries it.
MotionSample frame_at(const StepScene& scene, double time) {
  return scene.carrier ? scene.carrier->sample(time) : MotionSample();
}

}  // namespace

const char* unsupported(const FullModel& model, const StepScene& scene) noexcept {
  if (scene.integrator == Integrator::kNewmark && model.skin) return "Newmark's integrator of a body on a skeleton";
  if (!scene.obstacles.empty() && !model.contacts) return "obstacles, since the bundle has no /contact";
  if (scene.carrier && !model.carried) return "a motion that carries the body";
  if (scene.animation && !model.skin) return "an animation of bones";
  const bool acts_example = std::ranges::any_of(scene.examples, acts);
  if (acts_example && scene.examples.size() != model.examples.size())
    return "an example force, since the space has no filter of it";
  for (std::size_t group = 0; acts_example && group < scene.examples.size(); ++group) {
    if (elastic_factor(scene.examples[group]) == 0) continue;
    if (!model.examples[group].is_elastic)
      return "an elastic example force, since the bundle was made for a linear one";
    if (model.skin) return "an elastic example force of a body on a skeleton";
  }
  const bool damped = scene.mass_damping > 0 || scene.stiffness_damping > 0;
  if (!model.space.is_clamped() && !model.rigid && (damped || acts_example))
    return "damping or example force of a free body whose rigid motion is not known";
  return nullptr;
}

FullWorkspace::FullWorkspace(const FullModel& model, const StepScene& scene, const FullAccuracy& of)
    : accuracy(of),
      form{0, 0, Eigen::VectorXd::Zero(model.space.size()), Eigen::VectorXd::Zero(model.space.size())},
      fixed_form{0, 0, Eigen::VectorXd::Zero(3 * model.space.driven()),
                 Eigen::VectorXd::Zero(3 * model.space.driven())},
      potential(model),
      external(form.velocity_centre),
      moved(external),
      rate(external),
      acceleration(external),
      d(Eigen::VectorXd::Zero(model.space.field_size())),
      gradient(d),
      direction(d),
      trial(d),
      trial_gradient(d),
      residual(d.size()),
      solved(residual),
      search(residual),
      image(residual),
      sum(residual),
      coefficients(model.space.coefficients()),
      scaled(residual),
      turned(model.skin ? residual.size() : 0),
      field(d),
      modes(model.basis.cols()) {
  fit(model, scene);
  for (const FullExamples& of_model : model.examples) {
    Examples& own = examples.emplace_back();
    if (of_model.table) own.table = of_model.table->make_workspace();
    own.coefficients.setZero(3 * of_model.functions);
    own.target = own.coefficients;
    of_group.resize(std::max<Eigen::Index>(of_group.size(), 6 * of_model.columns()));
  }
}

void FullWorkspace::fit(const FullModel& model, const StepScene& scene) {
  const bool touches = model.contacts.has_value();
  if (touches && contact.blocks.empty()) contact = FullContactScratch(model.space.vertices());
  if (serves(key, scene)) return;
  key = key_of(scene);
  first = make_linear(model, key, scene.time_step, touches);
  second = first;
  if (key.integrator == Integrator::kBdf2) second = make_linear(model, key, 2 * scene.time_step / 3, false);
  if (key.integrator == Integrator::kNewmark) second = make_linear(model, key, 0.5 * scene.time_step, false);
}

double compliance(const FullModel& model, std::span<const std::int32_t> vertices, std::span<const double> shares,
                  FullWorkspace& workspace) noexcept {
  auto right = workspace.residual.vector(), moved = workspace.solved.vector();
  right.setZero();
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (const std::int32_t place = model.space.place(vertices[i]); place >= 0)
      right[4 * place] += static_cast<float>(shares[i]);
  workspace.first.preconditioner.solve(kernels(), workspace.residual, workspace.solved, workspace.coefficients);
  return static_cast<double>(right.dot(moved));
}

FullStep::FullStep(const FullModel& model, const StepScene& scene, Motion& state, FullWorkspace& workspace,
                   const FullMemory& memory) noexcept
    : model_(model),
      space_(model.space),
      scene_(scene),
      state_(state),
      workspace_(workspace),
      memory_(memory),
      potential_(model, scene, workspace.form, workspace.potential) {}

void FullStep::gather_external_force() noexcept {
  Eigen::VectorXd& external = workspace_.external;
  external = state_.applied_force;
  external.noalias() += space_.gravity_load() * scene_.gravity;
  const double midpoint = state_.time + 0.5 * scene_.time_step;
  for (const ScriptedForce& force : scene_.forces)
    if (force.acts_at(midpoint)) external += force.on_vertices;
}

// Takes u and v, fields in the workspace's `trial` and `field`.
bool FullStep::find_contacts(double pushed) noexcept {
  if (!model_.contacts || memory_.found == nullptr) return false;
  const double end = static_cast<double>(state_.step + 1) * scene_.time_step;
  return model_.contacts->begin(scene_.obstacles, end, scene_.time_step, scene_.gravity, pushed,
                                workspace_.trial.data(), workspace_.field.data(), *memory_.held, *memory_.found);
}

void FullStep::begin(bool touches_others, double pushed) noexcept {
  among_others_ = touches_others;
  anew_ = jumps(scene_, state_) || (memory_.bones != nullptr && memory_.bones->anew);
  gather_external_force();
  if (model_.skin) take_along();
  if (model_.rigid || model_.contacts) {
    space_.to_field(state_.q, workspace_.trial);
    space_.to_field(state_.v, workspace_.field);
  }
  near_ = find_contacts(pushed);
  potential_.set_contact(near_ ? memory_.found : nullptr);
  if (model_.rigid) {
    model_.rigid->place(workspace_.trial.data(), workspace_.potential.rigid);
    expected_momenta_ = model_.rigid->momenta(workspace_.field.data(), workspace_.potential.rigid);
  }
  const StepHistory history{state_.q, state_.v, state_.q_previous, state_.v, state_.v_previous};
  const bool newmark = scene_.integrator == Integrator::kNewmark;
  // A hold is exact at the end of steps, which Newmark's forces would oscillate about.
  const bool second_order = scene_.integrator != Integrator::kBackwardEuler && !anew_ && !near_ && !touches_others &&
                            !(newmark && is_attached());
  if (second_order && newmark)
    newmark_form(history, state_.a, scene_.time_step, workspace_.form);
  else if (second_order)
    bdf2_form(history, scene_.time_step, workspace_.form);
  else
    backward_euler_form(history, scene_.time_step, workspace_.form);
  linear_ = second_order ? &workspace_.second : &workspace_.first;
  potential_.begin(state_.q, workspace_.external);
  potential_.set_attachments(memory_.attachments);
  if (model_.carried) {
    const double end = static_cast<double>(state_.step + 1) * scene_.time_step;
    from_ = frame_at(scene_, state_.time);
    if (scene_.carrier) to_ = scene_.carrier->sample(end, -kBesideKey * scene_.time_step);
    potential_.drive(from_, to_);
  }
  if (model_.skin) hang(second_order);
  if (model_.rigid) add_external_impulse();
  choose_first_iterate();
}

// Places the skin by the bones at the end of the step. A body that was put on them takes the velocity that they make.
void FullStep::take_along() noexcept {
  const SkinnedPart& skin = *model_.skin;
  SkeletonMotion& bones = *memory_.bones;
  FullPotentialWorkspace& work = workspace_.potential;
  const double end = static_cast<double>(state_.step + 1) * scene_.time_step;
  if (scene_.animation) scene_.animation->sample(end, bones.next);
  skin.place(bones.next, bones.weights, work.skin);
  if (!bones.anew) return;
  space_.to_field(state_.q, work.start);
  stay(workspace_.trial);
  space_.from_field(workspace_.trial, state_.v);
  state_.v /= scene_.time_step;
  for (Eigen::Index at = 0; at < bones.q.size(); at += 3)
    bones.v.segment<3>(at) =
        (skin.displacement(work.skin, space_.vertices() + at / 3) - bones.q.segment<3>(at)) / scene_.time_step;
  state_.v_previous = state_.v;
  bones.v_previous = bones.v;
}

void FullStep::hang(bool second_order) noexcept {
  SkeletonMotion& bones = *memory_.bones;
  const StepHistory history{bones.q, bones.v, bones.q_previous, bones.v, bones.v_previous};
  if (second_order)
    bdf2_form(history, scene_.time_step, workspace_.fixed_form);
  else
    backward_euler_form(history, scene_.time_step, workspace_.fixed_form);
  SkinnedPart::place_fixed(bones.q, workspace_.potential.start);
  stay(workspace_.trial);
  potential_.hang(bones, workspace_.fixed_form, workspace_.trial, second_order);
  space_.from_field(workspace_.trial, bones.way_previous);
}

// After the state of the end was set.
void FullStep::end_bones() noexcept {
  SkeletonMotion& bones = *memory_.bones;
  FullPotentialWorkspace& work = workspace_.potential;
  const StepForm& form = workspace_.fixed_form;
  bones.q_previous = bones.q;
  bones.v_previous = bones.v;
  for (Eigen::Index place = space_.vertices(), at = 0; place < space_.places(); ++place, at += 3)
    bones.q.segment<3>(at) = model_.skin->displacement(work.skin, place);
  bones.v = form.velocity_factor * (bones.q - form.velocity_centre);
  bones.own_previous = bones.own;
  set_own();
  bones.bones = bones.next;
  bones.anew = false;
}

// Sets what displaces the body beside its bones, where the workspace's skin is.
void FullStep::set_own() noexcept {
  space_.to_field(state_.q, workspace_.trial);
  model_.skin->to_own(workspace_.potential.skin, workspace_.trial.data(), workspace_.field.data());
  space_.from_field(workspace_.field, memory_.bones->own);
}

/// Beside that of the frame of a carried body, in the frame; a field.
void FullStep::own_velocity(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                            Eigen::VectorXd& own) const noexcept {
  if (model_.carried) {
    model_.carried->own_velocity(frame_at(scene_, time), q, v, own);
  } else if (model_.skin) {
    workspace_.rate = (memory_.bones->own - memory_.bones->own_previous) / scene_.time_step;
    space_.to_field(workspace_.rate, own);
    own.tail(4 * space_.driven()).setZero();
  } else {
    space_.to_field(v, own);
  }
}

/// From such a way to that in the world.
void FullStep::carry(Eigen::VectorXd& d) const noexcept {
  if (model_.carried) model_.carried->carry(from_, to_, workspace_.potential.start, d);
  if (model_.skin) {
    space_.to_field(memory_.bones->own, workspace_.field);
    workspace_.field += d;
    model_.skin->to_world(workspace_.potential.skin, workspace_.field.data(), d.data());
    d -= workspace_.potential.start;
  }
  hold(d);
}

void FullStep::stay(Eigen::VectorXd& d) const noexcept {
  d.setZero();
  carry(d);
}

void FullStep::choose_first_iterate() noexcept {
  Eigen::VectorXd &d = workspace_.d, &at_rest = workspace_.trial;
  own_velocity(state_.time, state_.q, state_.v, d);
  if (!is_checked()) {
    own_velocity(state_.time - scene_.time_step, state_.q_previous, state_.v_previous, workspace_.trial);
    d = 1.5 * d - 0.5 * workspace_.trial;
  }
  d *= scene_.time_step;
  predicted_ = is_checked() || (!anew_ && largest_move(d) <= kMostPredicted * space_.edge());
  stay(at_rest);
  double at_start = 0;
  if (is_checked() && comes_unchecked()) {
    potential_.evaluate_elements(at_rest, FullPotential::Tangents::kNone, false);
    at_start = potential_.undamped();
    state_.elastic_energy = potential_.elastic_energy();
  } else if (is_checked()) {
    at_start = potential_.undamped_at(at_rest, state_.elastic_energy);
  }
  if (predicted_)
    carry(d);
  else
    d = at_rest;
  potential_.evaluate_elements(d, FullPotential::Tangents::kExact, true);
  if (!is_checked() || potential_.undamped() <= at_start || d == at_rest) return;
  ++report_.line_search_evaluations;
  predicted_ = false;
  d = at_rest;
  potential_.evaluate_elements(d, FullPotential::Tangents::kExact, true);
}

// Largest displacement of a vertex, less the mean of all for a free body.
double FullStep::largest_move(const Eigen::VectorXd& field) const noexcept {
  const Eigen::Map<const Eigen::Matrix4Xd> columns(field.data(), 4, field.size() / 4);
  Eigen::Vector4d mean = Eigen::Vector4d::Zero();
  if (model_.rigid) mean = columns.rowwise().mean();
  return std::sqrt((columns.colwise() - mean).colwise().squaredNorm().maxCoeff());
}

void FullStep::first_iterate(Eigen::VectorXd& u) const noexcept {
  space_.from_field(workspace_.d, u);
  u += state_.q;
}

void FullStep::first_coefficients() noexcept {
  potential_.set_coefficients();
  see_coefficients();
}

void FullStep::own_coefficients() noexcept {
  FullWorkspace& work = workspace_;
  work.trial.setZero();
  space_.to_field(memory_.bones->own, work.trial);
  kernels().mesh_coefficients(space_.filter(), work.trial.data(), work.potential.coefficients.data());
  see_coefficients();
}

/// What the groups of examples see of the potential's coefficients.
void FullStep::see_coefficients() noexcept {
  for (std::size_t group = 0; group < model_.examples.size(); ++group)
    potential_.see(model_.examples[group], workspace_.examples[group].coefficients);
}

void FullStep::precondition() noexcept {
  begin_preconditioning();
  end_preconditioning();
}

// Towards solved = B residual; returns residual . B residual. With contacts B = C S^-1 C, C = (I + z K)^-1/2 at each
// vertex that touches: exact of a single one.
float FullStep::begin_preconditioning() noexcept {
  FullWorkspace& work = workspace_;
  const Kernels& run = kernels();
  const bool turns = model_.skin && linear_->is_filtered;
  if (work.contact.block_count == 0 && !turns)
    return linear_->preconditioner.begin_solve(run, work.residual, work.solved, work.coefficients);
  work.scaled.vector() = work.residual.vector();
  scale_blocks(work.scaled);
  // The filter is that of the displacement in the axes of the bones.
  if (turns) model_.skin->turn_back(work.potential.skin, work.scaled.data(), work.scaled.data());
  return linear_->preconditioner.begin_solve(run, work.scaled, work.solved, work.coefficients);
}

void FullStep::end_preconditioning() noexcept {
  FullWorkspace& work = workspace_;
  linear_->preconditioner.end_solve(kernels(), work.solved, work.coefficients);
  if (model_.skin && linear_->is_filtered)
    model_.skin->turn(work.potential.skin, work.solved.data(), work.solved.data());
  scale_blocks(work.solved);
  project_held(space_, memory_.attachments, work.solved.data());
}

void FullStep::scale_blocks(AlignedFloats& field) noexcept {
  for (const auto& block : std::span(workspace_.contact.blocks).first(workspace_.contact.block_count)) {
    auto own = field.vector().segment<3>(4 * block.place);
    own = (block.scale * own).eval();
  }
}

/// Held vertices go where they are held.
void FullStep::hold(Eigen::VectorXd& d) const noexcept {
  const Eigen::VectorXd& start = workspace_.potential.start;
  for (const Attachment& attachment : memory_.attachments) {
    if (!attachment.holds() || attachment.kind == AttachmentKind::kSpring) continue;
    Eigen::Vector3d lacking = attachment.anchor();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k) {
      const Eigen::Index vertex = attachment.vertices[k], place = 4 * space_.place(vertex);
      const auto at = static_cast<Eigen::Index>(k);
      const Eigen::Vector3d here = model_.rest.row(vertex).transpose() + start.segment<3>(place);
      if (attachment.kind == AttachmentKind::kFixed) d.segment<3>(place) = attachment.target(at) - here;
      lacking -= attachment.shares[at] * (here + d.segment<3>(place));
    }
    if (attachment.kind == AttachmentKind::kFixed) continue;
    lacking /= attachment.shares.squaredNorm();
    for (std::size_t k = 0; k < attachment.vertices.size(); ++k)
      d.segment<3>(4 * space_.place(attachment.vertices[k])) +=
          attachment.shares[static_cast<Eigen::Index>(k)] * lacking;
  }
}

// Turns F^T x into the forces of the filters on it.
void FullStep::filter_coefficients() noexcept {
  Eigen::Map<Eigen::Matrix4Xf> all(workspace_.coefficients.data(), 4, space_.coefficients() / 4);
  Eigen::Matrix3f to_world = Eigen::Matrix3f::Identity();
  if (potential_.has_moving_frame()) to_world = potential_.frame_rotation().cast<float>();
  for (const FullWorkspace::Filter& filter : linear_->filters) {
    auto own = all.middleCols(filter.first, filter.columns);
    if (filter.product.size() == 0) {
      own *= filter.stiffness;
      continue;
    }
    Eigen::Map<Eigen::Matrix3Xf> numbers(workspace_.of_group.data(), 3, filter.columns);
    Eigen::Map<Eigen::Matrix3Xf> forces(workspace_.of_group.data() + numbers.size(), 3, filter.columns);
    numbers = own.topRows<3>();
    if (potential_.has_moving_frame())
      for (Eigen::Index k = 0; k < filter.columns; ++k) numbers.col(k) = (to_world.transpose() * numbers.col(k)).eval();
    Eigen::Map<Eigen::VectorXf>(forces.data(), forces.size()).noalias() =
        filter.product * Eigen::Map<const Eigen::VectorXf>(numbers.data(), numbers.size());
    if (potential_.has_moving_frame())
      for (Eigen::Index k = 0; k < filter.columns; ++k) forces.col(k) = (to_world * forces.col(k)).eval();
    own.topRows<3>() = forces;
  }
}

// Sets image = A search.
void FullStep::multiply() noexcept {
  const Kernels& run = kernels();
  FullWorkspace& work = workspace_;
  run.mesh_product(space_.arrays(), linear_->matrix.data(), work.potential.tangents.data(), work.search.data(),
                   reinterpret_cast<float*>(work.potential.lines.data()), work.image.data());
  if (linear_->is_filtered) {
    const MeshFilter<float> filter = space_.rounded_filter();
    if (model_.skin) {
      model_.skin->turn_back(work.potential.skin, work.search.data(), work.turned.data());
      run.mesh_rounded_coefficients(filter, work.turned.data(), work.coefficients.data());
      work.turned.vector().setZero();
      filter_coefficients();
      run.mesh_add_rounded_functions(filter, 1, work.coefficients.data(), work.turned.data());
      model_.skin->turn(work.potential.skin, work.turned.data(), work.turned.data());
      work.image.vector() += work.turned.vector();
    } else {
      run.mesh_rounded_coefficients(filter, work.search.data(), work.coefficients.data());
      filter_coefficients();
      run.mesh_add_rounded_functions(filter, 1, work.coefficients.data(), work.image.data());
    }
  }
  for (const auto& block : std::span(work.contact.blocks).first(work.contact.block_count))
    work.image.vector().segment<3>(4 * block.place) +=
        block.stiffness * work.search.vector().segment<3>(4 * block.place);
  potential_.add_springs(work.search.data(), work.image.data());
  project_held(space_, memory_.attachments, work.image.data());
}

void FullStep::begin_blocks() noexcept {
  workspace_.contact.clear();
  if (near_) model_.contacts->add_blocks(*memory_.found, workspace_.contact);
}

void FullStep::set_scales() noexcept { workspace_.contact.set_scales(linear_->preconditioner.inverse_diagonal()); }

// Preconditioned conjugate gradients from 0, of the gradient over its norm: forces of a body that comes to rest would
// be too small for single precision.
FullStep::Outcome FullStep::find_direction(double tolerance, int most_iterations) noexcept {
  FullWorkspace& work = workspace_;
  auto residual = work.residual.vector(), solved = work.solved.vector(), search = work.search.vector(),
       image = work.image.vector(), sum = work.sum.vector();
  begin_blocks();
  set_scales();
  const double size = work.gradient.norm();
  residual = (work.gradient * (-1 / size)).cast<float>();
  project_held(space_, memory_.attachments, work.residual.data());
  float square = begin_preconditioning();
  end_preconditioning();
  search = solved;
  sum.setZero();
  const float limit = static_cast<float>(tolerance * tolerance) * square;
  for (int iteration = 1;; ++iteration) {
    multiply();
    const float curvature = search.dot(image);
    if (!(curvature > 0)) {
      if (!projected_) return Outcome::kIndefinite;
      if (iteration == 1) sum = solved;
      break;
    }
    ++report_.cg_iterations;
    const float length = square / curvature;
    sum += length * search;
    if (iteration >= most_iterations) break;
    residual -= length * image;
    const float next = begin_preconditioning();
    if (!(next > limit)) break;
    end_preconditioning();
    search = solved + next / square * search;
    square = next;
  }
  work.direction = sum.cast<double>() * size;
  // Removes the motion that single precision leaves in held vertices.
  project_held(space_, memory_.attachments, work.direction.data());
  return Outcome::kFound;
}

// Damping by a stiffness that had to be projected would feed energy in, whichever iterate shows that it has to be: of
// an indefinite one the potential has no minimum.
void FullStep::project() noexcept {
  const bool is_first = report_.projections++ == 0;
  projected_ = tangents_are_current_ = true;
  potential_.evaluate_elements(workspace_.d, FullPotential::Tangents::kProjected, is_first);
  here_ = potential_.gradient_there(workspace_.d, workspace_.gradient);
}

// Errors that a direction leaves in stiff modes feed them where nothing damps them.
double FullStep::direction_tolerance() const noexcept {
  const bool delicate = scene_.stiffness_damping == 0 || scene_.time_step > kLongStep;
  return delicate ? kDelicate * workspace_.accuracy.tolerance : workspace_.accuracy.tolerance;
}

// True if the elastic energy may not be that of the end of the last step.
bool FullStep::comes_unchecked() const noexcept {
  return !state_.begins_anew && !is_attached() && workspace_.accuracy.unchecked_move > 0 && !is_stiff();
}

bool FullStep::is_short() const noexcept {
  return !is_checked() && predicted_ && at_first_iterate_ &&
         largest_move(workspace_.direction) <= workspace_.accuracy.unchecked_move * space_.edge();
}

// Along the direction; false where nothing lowers the potential.
bool FullStep::move() noexcept {
  FullWorkspace& work = workspace_;
  const SearchLine<Eigen::VectorXd> line{work.d, work.gradient, work.direction, here_.potential,
                                         work.gradient.dot(work.direction)};
  PotentialEvaluation there;
  const bool below_rounding = line.below_rounding();
  unchecked_from_ = below_rounding ? report_.residual : std::numeric_limits<double>::infinity();
  if (below_rounding) {
    // The potential cannot tell the two points apart, yet the gradient can: go on for as long as it falls.
    work.trial = work.d + work.direction;
    there = potential_.evaluate(work.trial, work.trial_gradient);
    if (!(work.trial_gradient.norm() <= report_.residual)) return false;
  } else if (!search_line(potential_, line, {work.trial, work.trial_gradient, there},
                          report_.line_search_evaluations)) {
    return false;
  }
  work.d.swap(work.trial);
  work.gradient.swap(work.trial_gradient);
  here_ = there;
  at_first_iterate_ = tangents_are_current_ = false;
  return true;
}

NewtonStatus FullStep::minimise() noexcept {
  FullWorkspace& work = workspace_;
  here_ = potential_.gradient_there(work.d, work.gradient);
  NewtonReport newton;
  newton.residual = report_.residual = work.gradient.norm();
  unchecked_from_ = std::numeric_limits<double>::infinity();
  // A coarse tolerance would leave the body beside its equilibrium for good.
  const NewtonSettings at_least_one{scene_.space.newton.max_iterations, 0};
  const int most = near_ ? std::max(work.accuracy.iterations, kContactIterations) : work.accuracy.iterations;
  for (;;) {
    newton.residual = report_.residual;
    newton.iterations = report_.newton_iterations;
    const bool may_stay = (is_checked() && !is_attached()) || !at_first_iterate_;
    const NewtonSettings& settings = may_stay ? scene_.space.newton : at_least_one;
    if (const auto reason = reason_to_end(newton, settings, here_, unchecked_from_)) return *reason;
    const double left = settings.tolerance * here_.force_scale / report_.residual;
    if (find_direction(std::max(direction_tolerance(), kForcing * left), most) == Outcome::kIndefinite) {
      project();
      report_.residual = work.gradient.norm();
      continue;
    }
    if (is_short()) {
      work.d += work.direction;
      ++report_.newton_iterations;
      return NewtonStatus::kConverged;
    }
    const double before = report_.residual;
    const bool moved = move();
    if (moved) {
      ++report_.newton_iterations;
      report_.residual = work.gradient.norm();
      if (report_.residual <= kSlow * before || report_.residual <= scene_.space.newton.tolerance * here_.force_scale)
        continue;
    } else if (tangents_are_current_) {
      potential_.evaluate_elements(work.d, FullPotential::Tangents::kNone, false);
      here_ = potential_.gradient_there(work.d, work.gradient);  // and what frames bear there
      const bool is_at_rest = report_.residual <= scene_.space.newton.tolerance * here_.force_scale;
      return is_at_rest ? NewtonStatus::kConverged : NewtonStatus::kStagnated;
    }
    projected_ = false;
    tangents_are_current_ = true;
    const bool is_far = model_.rigid && report_.newton_iterations >= kFarFromFrozen;
    if (is_far) potential_.place_frame(work.d);
    potential_.evaluate_elements(work.d, FullPotential::Tangents::kExact, false);
    if (moved && !is_far) continue;
    here_ = potential_.gradient_there(work.d, work.gradient);
    report_.residual = work.gradient.norm();
  }
}

// Friction follows the normal forces of the solution.
NewtonStatus FullStep::minimise_with_friction() noexcept {
  for (int round = 1;; ++round) {
    const NewtonStatus status = minimise();
    FrictionChange friction;
    memory_.found->refresh_friction(friction);
    if (status == NewtonStatus::kNonFinite || round == kFrictionRounds || friction.relative() <= kSameFriction)
      return status;
    tangents_are_current_ = false;
  }
}

void FullStep::set_elastic_target(std::size_t group, const Eigen::VectorXd& shape) noexcept {
  Eigen::VectorXd& field = workspace_.trial;
  field.setZero();
  space_.to_field(shape, field);
  potential_.set_elastic_target(group, field);
}

void FullStep::take_elastic_targets() noexcept {
  if (potential_.has_elastic_target())
    potential_.evaluate_elements(workspace_.d, FullPotential::Tangents::kExact, false);
}

void FullStep::solve() noexcept { status_ = near_ ? minimise_with_friction() : minimise(); }

// Half of what the external force does to the momenta in a step, where place() was called: once at its beginning, once
// at its end.
void FullStep::add_external_impulse() noexcept {
  const RigidWorkspace& rigid = workspace_.potential.rigid;
  const FrameMomenta impulse = model_.rigid->sums(workspace_.potential.external.data(), rigid);
  expected_momenta_.linear += 0.5 * scene_.time_step * impulse.linear;
  expected_momenta_.angular += 0.5 * scene_.time_step * impulse.angular;
}

FrameMomenta FullStep::expected_momenta() const noexcept {
  const FrameMomenta impulse = model_.rigid->sums(workspace_.potential.external.data(), workspace_.potential.rigid);
  const double half = 0.5 * scene_.time_step;
  return {expected_momenta_.linear + half * impulse.linear, expected_momenta_.angular + half * impulse.angular};
}

void FullStep::set_solution(NewtonStatus status, const Eigen::VectorXd& d) noexcept {
  status_ = status;
  workspace_.d = d;
}

// Momenta are those of the start and of the forces of the solution: damping and example force have none, and the turn
// of the step is not the integrator's to take away. Takes v, a field in the workspace's `field`.
void FullStep::correct_momenta(const FrameMomenta& others) noexcept {
  FullWorkspace& work = workspace_;
  const RigidWorkspace& rigid = work.potential.rigid;
  const double dt = scene_.time_step;
  add_external_impulse();
  FrameMomenta lacking = expected_momenta_;
  lacking.linear += dt * others.linear;
  lacking.angular += dt * others.angular;
  if (near_) {
    lacking.linear += dt * memory_.found->force;
    lacking.angular += dt * (memory_.found->torque - rigid.centre.cross(memory_.found->force));
  }
  give_momenta(lacking);
  move_centre(lacking.linear / model_.rigid->mass());
}

// A rigid motion beside v, a field in the workspace's `field`, where the workspace places the body.
void FullStep::give_momenta(const FrameMomenta& momenta) noexcept {
  const RigidWorkspace& rigid = workspace_.potential.rigid;
  Eigen::VectorXd& field = workspace_.field;
  FrameMomenta lacking = model_.rigid->momenta(field.data(), rigid);
  lacking.linear = momenta.linear - lacking.linear;
  lacking.angular = momenta.angular - lacking.angular;
  RigidPart::add_motion(model_.rigid->motion(lacking, rigid), rigid, field.data());
  space_.from_field(field, state_.v);
}

// The centre of mass goes as its velocity says: what it is beside that would turn into angular momentum.
void FullStep::move_centre(const Eigen::Vector3d& velocity) noexcept {
  FullWorkspace& work = workspace_;
  RigidWorkspace& rigid = work.potential.rigid;
  space_.to_field(work.form.velocity_centre, work.trial);
  const Eigen::Vector3d shift =
      model_.rigid->centre(work.trial.data()) + velocity / work.form.velocity_factor - rigid.centre;
  for (Eigen::Index i = 0; i < state_.q.size(); i += 3) state_.q.segment<3>(i) += shift;
  rigid.centre += shift;
}

// True if nothing but gravity and obstacles that stand still, which it touches, changes the energy of the body.
bool FullStep::is_closed() const noexcept {
  return memory_.found->loaded_count > 0 && state_.applied_force.isZero(0) && is_isolated(scene_, *memory_.found);
}

// A solution that did not converge may hold contact forces that throw the body, and springs of vertices that a step has
// brought deep, as through an edge, were paid for by nobody: the body goes no faster than `allowed` leaves it. Returns
// the energy that it has beside the springs.
double FullStep::limit_energy(double allowed, double springs, double gain) noexcept {
  const Energies now = energies_of(model_, scene_, state_, memory_.bones);
  const double held = now.elastic + now.potential + springs;
  const double rounding = gain * (std::abs(allowed) + now.kinetic + std::abs(held));
  if (!(now.kinetic > 0) || now.kinetic + held <= allowed + rounding) return now.total();
  const double kinetic = std::max(0.0, allowed - held);
  state_.v *= std::sqrt(kinetic / now.kinetic);
  space_.to_field(state_.v, workspace_.field);
  return kinetic + held - springs;
}

void FullStep::end_attachments() noexcept {
  for (Attachment& attachment : memory_.attachments) {
    attachment.rotation_before = attachment.rotation;
    attachment.position_before = attachment.position;
    if (attachment.force.norm() > attachment.break_force) attachment.broken = true;
  }
}

void FullStep::add_motion(double share, const FrameVelocity& added) noexcept {
  space_.to_field(state_.v, workspace_.field);
  workspace_.field *= share;
  if (model_.rigid) RigidPart::add_motion(added, workspace_.potential.rigid, workspace_.field.data());
  space_.from_field(workspace_.field, state_.v);
}

const FullReport& FullStep::finish(const FrameMomenta& others) noexcept {
  if (status_ == NewtonStatus::kIterationLimit) report_.status |= kStepIterationLimit;
  if (status_ == NewtonStatus::kStagnated) report_.status |= kStepStagnated;
  double energy = 0;
  Eigen::VectorXd& d = workspace_.moved;
  space_.from_field(workspace_.d, d);
  // In q - q_v the digits of d are kept.
  const StepForm& form = workspace_.form;
  workspace_.rate = form.velocity_factor * (d + (state_.q - form.velocity_centre));
  workspace_.acceleration = form.acceleration_factor * (d + (state_.q - form.acceleration_centre));
  // Squares leave room for what is made of these numbers.
  double size = workspace_.rate.squaredNorm() + others.linear.squaredNorm() + others.angular.squaredNorm();
  if (near_) size += memory_.found->force.squaredNorm() + memory_.found->torque.squaredNorm();
  if (status_ == NewtonStatus::kNonFinite || !d.allFinite() || !std::isfinite(size + potential_.elastic_energy())) {
    report_.status |= kStepNonFinite;
    return report_;
  }
  const bool unbalanced = (near_ || among_others_) && status_ != NewtonStatus::kConverged;
  // Momenta and energy of a body that something holds are its host's, too.
  const bool is_own = near_ && !among_others_ && !is_attached() && !model_.is_driven();
  const bool closed = is_own && is_closed(), limited = is_own && (closed || unbalanced);
  if (limited) energy = energies_of(model_, scene_, state_, memory_.bones).total();
  if (closed) energy += memory_.found->start_energy(*memory_.held);
  state_.q_previous = state_.q;
  state_.v_previous = state_.v;
  state_.v = workspace_.rate;
  state_.a = workspace_.acceleration;
  state_.q += d;
  state_.elastic_energy = potential_.elastic_energy();
  if (near_) {
    report_.contacts = memory_.found->touching;
    report_.contact_force = memory_.found->force;
  }
  if (model_.rigid || near_ || among_others_) {
    space_.to_field(state_.q, workspace_.trial);
    space_.to_field(state_.v, workspace_.field);
  }
  if (near_) model_.contacts->commit(workspace_.trial.data(), *memory_.found, *memory_.held);
  if (model_.rigid) model_.rigid->place(workspace_.trial.data(), workspace_.potential.rigid);
  if (model_.rigid && !unbalanced && !is_attached()) correct_momenta(others);
  const double springs = near_ ? memory_.found->end_energy(Eigen::Vector3d::Zero()) : 0;
  if (memory_.held != nullptr) memory_.held->account = springs;
  if (limited) {
    const double beside = limit_energy(energy, closed ? springs : 0, unbalanced ? 0 : kGain);
    if (closed) memory_.held->account = std::min(springs, energy - beside);
  }
  if (!state_.v.allFinite()) report_.status |= kStepNonFinite;  // by what momenta and energies make of it
  end_attachments();
  if (model_.skin) end_bones();
  if (!near_ && memory_.held != nullptr) memory_.held->count = 0;
  ++state_.step;
  state_.time = static_cast<double>(state_.step) * scene_.time_step;
  state_.begins_anew = near_ || among_others_;
  return report_;
}

void FullStep::stand() noexcept {
  FullWorkspace& work = workspace_;
  const StepHistory history{state_.q, state_.v, state_.q_previous, state_.v, state_.v_previous};
  backward_euler_form(history, scene_.time_step, work.form);
  linear_ = &work.first;
  work.external.setZero();
  potential_.begin(state_.q, work.external);
  potential_.set_attachments(memory_.attachments);
  if (model_.carried) {
    from_ = to_ = frame_at(scene_, state_.time);
    potential_.drive(from_, to_);
  }
  if (model_.skin) {
    const SkeletonMotion& bones = *memory_.bones;
    SkinnedPart::place_fixed(bones.q, work.potential.start);
    model_.skin->place(bones.bones, bones.weights, work.potential.skin);
  }
  work.d.setZero();
  potential_.evaluate_elements(work.d, FullPotential::Tangents::kExact, true);
}

// The rigid motion of a free body is that of the impulses, by the rest of which the body deforms alone: damping and
// single precision see none of it.
void FullStep::respond(Eigen::VectorXd& impulses) noexcept {
  FullWorkspace& work = workspace_;
  const RigidWorkspace& rigid = work.potential.rigid;
  FrameVelocity whole;
  if (is_free()) {
    whole = model_.rigid->motion(model_.rigid->sums(impulses.data(), rigid), rigid);
    model_.rigid->remove_rigid_force(work.potential.x.data(), rigid, impulses.data());
  }
  project_held(space_, memory_.attachments, impulses.data());
  work.gradient = -impulses;
  impulses.setZero();
  if (!work.gradient.isZero(0)) {
    if (find_direction(kResponse.tolerance, kResponse.iterations) == Outcome::kIndefinite) {
      projected_ = true;
      potential_.evaluate_elements(work.d, FullPotential::Tangents::kProjected, true);
      find_direction(kResponse.tolerance, kResponse.iterations);
    }
    impulses = work.direction / (scene_.time_step * scene_.time_step);
  }
  if (!is_free()) return;
  model_.rigid->remove_motion(rigid, impulses.data());
  RigidPart::add_motion(whole, rigid, impulses.data());
}

void FullStep::push(Eigen::VectorXd& impulses) noexcept {
  FullWorkspace& work = workspace_;
  FrameMomenta momenta;
  if (is_free()) {
    const RigidWorkspace& rigid = work.potential.rigid;
    space_.to_field(state_.v, work.field);
    const FrameMomenta own = model_.rigid->momenta(work.field.data(), rigid);
    const FrameMomenta given = model_.rigid->sums(impulses.data(), rigid);
    momenta = {own.linear + given.linear, own.angular + given.angular};
  }
  respond(impulses);
  space_.from_field(impulses, work.rate);
  state_.q += scene_.time_step * work.rate;
  state_.v += work.rate;
  energies(model_, scene_, state_, work, memory_.bones);
  if (model_.skin) set_own();
  space_.to_field(state_.v, work.field);
  if (model_.rigid) {
    space_.to_field(state_.q, work.trial);
    model_.rigid->place(work.trial.data(), work.potential.rigid);
  }
  if (is_free()) give_momenta(momenta);
  state_.begins_anew = true;
}

FullReport step(const FullModel& model, const StepScene& scene, Motion& state, FullWorkspace& workspace,
                const FullMemory& memory) noexcept {
  FullStep one(model, scene, state, workspace, memory);
  one.begin();
  one.solve();
  return one.finish();
}

State make_state(const FullModel& model, const Eigen::VectorXd& u, const Eigen::VectorXd& v, FullWorkspace& workspace) {
  State state;
  state.q = state.q_previous = u;
  state.v = state.v_previous = v;
  state.a = state.applied_force = Eigen::VectorXd::Zero(model.space.size());
  energies(model, {}, state, workspace);
  return state;
}

State make_state(const FullModel& model, FullWorkspace& workspace) {
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.space.size());
  return make_state(model, rest, rest, workspace);
}

Energies energies_of(const FullModel& model, const StepScene& scene, const Motion& state,
                     const SkeletonMotion* bones) noexcept {
  const Eigen::Vector3d weight = model.space.gravity_load().transpose() * state.q;
  const MotionSample frame = frame_at(scene, state.time);
  const auto driven = [&](Eigen::Index place) -> Eigen::Vector3d {
    if (model.carried) return model.carried->velocity(frame, place);
    return bones->v.segment<3>(3 * (place - model.space.vertices()));
  };
  const double fixed = model.carried ? model.carried->fixed_potential(frame, scene.gravity)
                       : model.skin  ? model.skin->fixed_potential(bones->q, scene.gravity)
                                     : 0;
  return {model.space.kinetic_energy(state.v, driven), state.elastic_energy, fixed - weight.dot(scene.gravity)};
}

double elastic_energy(const FullModel& model, const StepScene& scene, const Motion& state, FullWorkspace& workspace,
                      const SkeletonMotion* bones) noexcept {
  StepForm& form = workspace.form;
  form.velocity_factor = form.acceleration_factor = 0;
  form.velocity_centre = form.acceleration_centre = state.q;
  const StepScene bare;
  FullPotential potential(model, bare, form, workspace.potential);
  workspace.external.setZero();
  potential.begin(state.q, workspace.external);
  if (model.carried) model.carried->place_fixed(frame_at(scene, state.time), workspace.potential.start);
  if (model.skin) SkinnedPart::place_fixed(bones->q, workspace.potential.start);
  workspace.d.setZero();
  potential.evaluate_elements(workspace.d, FullPotential::Tangents::kNone, false);
  return potential.elastic_energy();
}

Energies energies(const FullModel& model, const StepScene& scene, Motion& state, FullWorkspace& workspace,
                  const SkeletonMotion* bones) noexcept {
  state.elastic_energy = elastic_energy(model, scene, state, workspace, bones);
  return energies_of(model, scene, state, bones);
}

}  // namespace exmat::runtime

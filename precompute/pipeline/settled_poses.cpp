#include "precompute/pipeline/settled_poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <memory>
#include <numbers>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/examples/full_space_data.h"
#include "precompute/fem/rigid_moments.h"
#include "precompute/targets/target_table.h"
#include "precompute/training/reduced_runs.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::precompute {
namespace {

using runtime::ExampleSettings;

constexpr double kPeriods = 1e4;         // of the lowest mode in one step: no inertia is left, but for its square
constexpr double kTolerance = 1e-10;     // of Newton's method, since weak modes resist little of what strong ones do
constexpr int kMostSteps = 50;           // each minimises the potential
constexpr double kSettledChange = 1e-9;  // of q in a step
constexpr double kStrongest = 1e6;       // times the stiffness of the highest mode, or the body's own
constexpr double kNextStrength = 10;     // from one strength that is tried to the next
constexpr double kWorse = 1.02;          // times the least distance: a strength is too much
constexpr int kHalvings = 4;             // between the best strength and one that is too much
constexpr double kGood = 0.05;           // an error that needs no advice

using Coordinates = std::optional<Eigen::VectorXd>;  // q [r]; nothing where the body does not settle
using Shape = std::optional<Eigen::VectorXd>;        // displacement [3n]; likewise

// A model that is stepped, and its full space where the body steps in all its vertices: one on bones.
struct SteppedBody {
  std::shared_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
};

// The whole body's, or those of a region.
template <typename Model>
auto& examples_of(Model& model, const std::string& region) {
  return region.empty() ? *model.examples : std::ranges::find(model.regions, region, &RegionData::name)->examples;
}

class PoseSettler {
 public:
  PoseSettler(const BodyStages& stages, const ReducedModel& model, const std::optional<SettlingLoad>& load);

  SettledPose settle(Eigen::Index group, Eigen::Index k) const;
  const ReducedModel& model() const { return model_; }

 private:
  /// By which the stiffness of the load has the force of another strength where that settles; a column for each
  /// example.
  struct Shifts {
    Eigen::MatrixXd pull;          // r x K; 0 of a body on bones
    Eigen::MatrixXd coefficients;  // 3m x K, of a body that may step in full space
  };
  SteppedBody stepped() const;
  void add_shift(double strength, Eigen::Index k, Shifts& shifts) const;
  void shift(const Shifts& by, const TargetTableData& plain, const RowMatrix& plain_full);
  void compensate();
  std::vector<double> strengths(Eigen::Index group) const;
  runtime::StepScene scene(const runtime::Model& model, Eigen::Index group, Eigen::Index k, double stiffness,
                           const Eigen::Vector3d& gravity) const;
  Coordinates settled(const runtime::Model& model, Eigen::Index group, Eigen::Index k, double stiffness,
                      const Eigen::Vector3d& gravity) const;
  Shape settled_in_all_vertices(const SteppedBody& body, const runtime::StepScene& scene) const;
  Shape settled_shape(const SteppedBody& body, Eigen::Index group, Eigen::Index k, double stiffness,
                      const Eigen::Vector3d& gravity) const;
  Eigen::VectorXd held(Eigen::Index group, const Eigen::VectorXd& given) const;
  bool is_elastic(Eigen::Index group) const { return load_.examples[static_cast<std::size_t>(group)].elastic; }
  Eigen::VectorXd field(Eigen::Index group, const Eigen::VectorXd& q) const {
    return stages_.fitter->seen(group, model_.modal->basis * q);
  }
  double norm(const Eigen::VectorXd& field) const { return std::sqrt(field.dot(stages_.system.full_mass * field)); }
  double error(const Eigen::VectorXd& given, const Shape& shape) const {
    return shape ? norm(*shape - given) / norm(given) : 1;
  }

  const BodyStages& stages_;
  ReducedModel model_;
  SettlingLoad load_;
  SteppedBody plain_;                  // its targets are those of the examples
  std::optional<SteppedBody> loaded_;  // compensated, if asked for
};

PoseSettler::PoseSettler(const BodyStages& stages, const ReducedModel& model, const std::optional<SettlingLoad>& load)
    : stages_(stages), model_(model), load_(load.value_or(SettlingLoad{})) {
  if (!model_.rigid && !stages.system.constrained())
    model_.rigid = rigid_moments(stages.object.mesh, stages.object.materials.density, model.modal->basis);
  load_.examples.resize(static_cast<std::size_t>(stages.fitter->groups()));
  plain_ = stepped();
  if (load_.compensate) compensate();
}

// By the targets that the model has now.
SteppedBody PoseSettler::stepped() const {
  SteppedBody body{stepped_model(model_, reference_of(stages_), load_.examples), nullptr};
  if (!model_.skeleton) return body;
  runtime::FullModelResult full = runtime::build_full_model(model_, *body.model);
  if (!full.model) throw InputError(std::move(full.complaint));
  body.full = std::move(full.model);
  return body;
}

// Stiffnesses that are tried, from that of the lowest mode to one that leaves nothing to elasticity.
std::vector<double> PoseSettler::strengths(Eigen::Index group) const {
  const Eigen::VectorXd& modes = stages_.modes.eigenvalues;
  const double most = kStrongest * (is_elastic(group) ? 1 : modes.tail(1)[0]);
  std::vector<double> all;
  for (double strength = is_elastic(group) ? 1 : modes[0]; strength <= most; strength *= kNextStrength)
    all.push_back(strength);
  return all;
}

// With the force of one group, and those of others left out.
runtime::StepScene PoseSettler::scene(const runtime::Model& model, Eigen::Index group, Eigen::Index k, double stiffness,
                                      const Eigen::Vector3d& gravity) const {
  runtime::StepScene scene;
  scene.integrator = Integrator::kBackwardEuler;
  scene.time_step = kPeriods * 2 * std::numbers::pi / std::sqrt(stages_.modes.eigenvalues[0]);
  scene.newton.tolerance = scene.space.newton.tolerance = kTolerance;
  if (stages_.system.constrained()) scene.gravity = gravity;
  scene.gravity_force = runtime::gravity_force(model, scene.gravity);
  scene.examples.resize(load_.examples.size());
  ExampleSettings& own = scene.examples[static_cast<std::size_t>(group)];
  own.stiffness = stiffness;
  own.elastic = is_elastic(group);
  own.given_weights = Eigen::VectorXd::Unit(std::ssize(examples_of(model_, stages_.fitter->region(group)).examples), k);
  return scene;
}

Coordinates PoseSettler::settled(const runtime::Model& model, Eigen::Index group, Eigen::Index k, double stiffness,
                                 const Eigen::Vector3d& gravity) const {
  const runtime::StepScene scene = this->scene(model, group, k, stiffness, gravity);
  runtime::State state = runtime::make_state(model);
  runtime::Workspace workspace(model, scene);
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::VectorXd before = state.q;
    if ((runtime::step(model, scene, state, workspace).status & runtime::kStepNonFinite) != 0) return std::nullopt;
    if ((state.q - before).norm() <= kSettledChange * state.q.norm()) return state.q;
    state.v.setZero();
    state.begins_anew = true;
  }
  return std::nullopt;
}

Shape PoseSettler::settled_in_all_vertices(const SteppedBody& body, const runtime::StepScene& scene) const {
  runtime::State state = runtime::make_state(*body.model);
  runtime::prepare_full(*body.full, state);
  runtime::enter_full_space(*body.full, *body.model, state);
  runtime::put_by_shifts(*body.full, scene, state);
  runtime::Workspace workspace(*body.model, scene);
  runtime::FullWorkspace own(*body.full, scene);
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::VectorXd before = state.full->q;
    const auto report = runtime::step_in_full_space(*body.full, *body.model, scene, state, workspace, own);
    if ((report.status & runtime::kStepNonFinite) != 0) return std::nullopt;
    runtime::put_on_bones(*body.full, state.full->skeleton->bones, state);  // without velocities
    if ((state.full->q - before).norm() > kSettledChange * state.full->q.norm()) continue;
    const Eigen::Index vertices = body.full->space.mesh_vertices();
    Eigen::VectorXd shape(3 * vertices);
    for (Eigen::Index v = 0; v < vertices; ++v)
      shape.segment<3>(3 * v) = runtime::full_displacement(*body.full, {}, *state.full, v);
    return shape;
  }
  return std::nullopt;
}

// As the group sees it.
Shape PoseSettler::settled_shape(const SteppedBody& body, Eigen::Index group, Eigen::Index k, double stiffness,
                                 const Eigen::Vector3d& gravity) const {
  if (body.full) {
    const Shape shape = settled_in_all_vertices(body, scene(*body.model, group, k, stiffness, gravity));
    return shape ? Shape(stages_.fitter->seen(group, *shape)) : std::nullopt;
  }
  const Coordinates q = settled(*body.model, group, k, stiffness, gravity);
  return q ? Shape(field(group, *q)) : std::nullopt;
}

// The unknowns of the body's steps hold this part of a pose: modes, or all vertices but those that bones hold
// elsewhere.
Eigen::VectorXd PoseSettler::held(Eigen::Index group, const Eigen::VectorXd& given) const {
  if (!plain_.full) return field(group, model_.modal->basis.transpose() * (stages_.system.full_mass * given));
  if (model_.skeleton->shifts.rows() > 0) return given;
  return stages_.system.extend(stages_.system.restrict(given));
}

SettledPose PoseSettler::settle(Eigen::Index group, Eigen::Index k) const {
  const PoseFitter& fitter = *stages_.fitter;
  const SteppedBody& loaded = loaded_ ? *loaded_ : plain_;
  const PoseFitter::PoseFields pose = fitter.pose_fields(group, k);
  const double size = norm(pose.given);
  const Eigen::VectorXd in_basis = held(group, pose.given);
  SettledPose found;
  found.region = fitter.region(group);
  found.example = examples_of(model_, found.region).examples[static_cast<std::size_t>(k)].name;
  found.basis = norm(pose.given - in_basis) / size;
  found.clamp = plain_.full ? found.basis : norm(pose.carried - pose.clamped) / size;
  found.compensable = (!model_.skeleton || model_.skeleton->is_clamp()) && !load_.compensate && found.region.empty() &&
                      model_.targets && !is_elastic(group);

  Shape best;
  for (const double strength : strengths(group)) {
    Shape shape = settled_shape(plain_, group, k, strength, Eigen::Vector3d::Zero());
    if (shape && (!best || error(pose.given, shape) < error(pose.given, best))) best = std::move(shape);
  }
  Shape shape = best;
  found.best = error(pose.given, best);
  const double stiffness = load_.examples[static_cast<std::size_t>(group)].stiffness;
  if (stiffness > 0) {
    shape = settled_shape(loaded, group, k, stiffness, load_.gravity);
    found.loaded = error(pose.given, shape);
  }
  found.settles = best && shape;
  if (!found.settles) return found;
  found.eigenfunctions = norm(in_basis - *best) / size;
  found.force = norm(*shape - *best) / size;
  const bool by_force = found.force > std::max(found.basis, found.eigenfunctions);
  found.unheld = by_force && load_.compensate && found.region.empty();
  if (by_force && !found.unheld)
    found.stronger = error(pose.given, settled_shape(loaded, group, k, kNextStrength * stiffness, load_.gravity));
  const Eigen::VectorXd off = *shape - pose.given;
  const Eigen::VectorXd distances = off.reshaped<Eigen::RowMajor>(off.size() / 3, 3).rowwise().norm();
  found.distance = distances.maxCoeff(&found.vertex);
  return found;
}

// Puts the column of an example; leaves it where the body does not settle.
void PoseSettler::add_shift(double strength, Eigen::Index k, Shifts& shifts) const {
  const double share = strength / load_.examples.front().stiffness - 1;
  const Eigen::VectorXd weights = Eigen::VectorXd::Unit(shifts.pull.cols(), k);
  Eigen::VectorXd displacement;  // beside what the example shifts
  if (plain_.full) {
    const Shape shape = settled_in_all_vertices(plain_, scene(*plain_.model, 0, k, strength, load_.gravity));
    if (!shape) return;
    const Eigen::Index vertices = model_.object->mesh.vertex_count();
    const RowMatrix shift = model_.skeleton->shifts.middleRows(k * vertices, vertices);
    displacement = *shape - shift.reshaped<Eigen::RowMajor>();
  } else {
    const runtime::ExampleModel& force = plain_.model->examples.front();
    const Coordinates q = settled(*plain_.model, 0, k, strength, load_.gravity);
    if (!q) return;
    displacement = model_.modal->basis * *q;
    runtime::TargetTable::Workspace workspace = force.table->make_workspace();
    Eigen::VectorXd pull(plain_.model->modes());
    force.table->evaluate(weights, workspace, pull);
    shifts.pull.col(k) = share * (pull - force.filter * *q);
  }
  if (!model_.full_space) return;
  TargetTableData data = *model_.targets;
  data.control_points = model_.full_space->control_points;
  const runtime::TargetTable table(data);
  runtime::TargetTable::Workspace workspace = table.make_workspace();
  Eigen::VectorXd target(shifts.coefficients.rows());
  table.evaluate(weights, workspace, target);
  shifts.coefficients.col(k) =
      share * (target - filter_coefficients(model_.full_space->filter, displacement).reshaped<Eigen::RowMajor>());
}

// Shifts the targets of the model from where they were by themselves, those of full space from `plain_full`.
void PoseSettler::shift(const Shifts& by, const TargetTableData& plain, const RowMatrix& plain_full) {
  *model_.targets = plain;
  shift_targets(by.pull, *model_.targets);
  if (!model_.full_space) return;
  TargetTableData full = plain;
  full.control_points = plain_full;
  shift_targets(by.coefficients, full);
  model_.full_space->control_points = full.control_points;
}

// Each example is shifted by the strength after which the body settles nearest to its pose, from rest: where a force is
// so weak that a pose is no stable equilibrium, less is more. It stays as it is where all make it worse.
void PoseSettler::compensate() {
  const auto refuse = [&](const char* place, const char* expected, const char* found, const char* advice) {
    throw InputError({load_.file, place, expected, found, advice});
  };
  if (!model_.targets)
    refuse("/examples/compensate", "a table of targets of the whole body's examples", "none",
           "leave compensate out, or have the asset make a table: targets.tolerance");
  const double stiffness = load_.examples.front().stiffness;
  if (!(stiffness > 0))
    refuse("/examples/stiffness", "> 0, where targets are compensated", "0", "leave compensate out");
  const Eigen::Index count = std::ssize(model_.examples->examples);
  const auto distance = [&](const SteppedBody& body, Eigen::Index k) {
    const Shape shape = settled_shape(body, 0, k, stiffness, load_.gravity);
    if (!shape) return std::numeric_limits<double>::infinity();
    return norm(k == 0 ? *shape : Eigen::VectorXd(*shape - stages_.fitter->pose_fields(0, k).given));
  };
  const TargetTableData plain = *model_.targets;
  const RowMatrix plain_full = model_.full_space ? model_.full_space->control_points : RowMatrix();
  const Shifts none{Eigen::MatrixXd::Zero(plain_.model->modes(), count),
                    Eigen::MatrixXd::Zero(model_.full_space ? plain_full.cols() : 0, count)};
  Shifts best = none;
  Eigen::VectorXd least(count), taken = Eigen::VectorXd::Constant(count, stiffness);
  for (Eigen::Index k = 0; k < count; ++k) least[k] = distance(plain_, k);
  Eigen::VectorXd too_much = Eigen::VectorXd::Zero(count);  // 0: no strength is known to be
  const auto try_all = [&](const Eigen::VectorXd& strengths) {
    Shifts by = none;
    shift(none, plain, plain_full);
    for (Eigen::Index k = 0; k < count; ++k)
      if (strengths[k] > 0) add_shift(strengths[k], k, by);
    shift(by, plain, plain_full);
    const SteppedBody candidate = stepped();
    for (Eigen::Index k = 0; k < count; ++k) {
      if (!(strengths[k] > 0)) continue;
      const double found = distance(candidate, k);
      if (found > kWorse * least[k]) too_much[k] = strengths[k];
      if (found >= least[k]) continue;
      least[k] = found;
      taken[k] = strengths[k];
      best.pull.col(k) = by.pull.col(k);
      best.coefficients.col(k) = by.coefficients.col(k);
    }
  };
  for (const double strength : strengths(0))
    if (strength > stiffness) try_all((too_much.array() == 0).select(Eigen::VectorXd::Constant(count, strength), 0));
  for (int halving = 0; halving < kHalvings && (too_much.array() > 0).any(); ++halving)
    try_all((taken.array() * too_much.array()).sqrt());
  shift(best, plain, plain_full);
  model_.targets->compensated_stiffness = stiffness;
  model_.targets->compensated_gravity = load_.gravity;
  loaded_ = stepped();
}

std::string advice_on(const SettledPose& pose) {
  if (pose.error() <= kGood) return "";
  if (pose.stronger)
    return fmt::format("; ten times examples.stiffness would leave {:.1f} %{}", 100 * *pose.stronger,
                       pose.compensable ? ", examples.compensate about what is best" : "");
  if (pose.unheld)
    return "; so weak a force does not hold the pose: raise examples.stiffness, and make the bundle for that";
  if (pose.eigenfunctions > pose.basis)
    return "; more shape_space.eigenfunctions, or a shape_space.tolerance, would hold more of the pose";
  if (2 * pose.clamp > pose.basis)
    return "; the pose moves fixed vertices: leave these at rest in it, or out of object.fixed, or have them follow it "
           "(object.fixed.follow)";
  return "; a larger basis.size would hold more of the pose";
}

}  // namespace

std::vector<SettledPose> settle_examples(const BodyStages& stages, const std::optional<SettlingLoad>& load,
                                         ReducedModel& model) {
  const PoseSettler settler(stages, model, load);
  model.targets = settler.model().targets;
  model.full_space = settler.model().full_space;
  std::vector<SettledPose> all;
  for (Eigen::Index group = 0; group < stages.fitter->groups(); ++group) {
    auto& examples = examples_of(model, stages.fitter->region(group)).examples;
    for (Eigen::Index k = 1; k < std::ssize(examples); ++k) {
      const SettledPose& found = all.emplace_back(settler.settle(group, k));
      ExampleData& example = examples[static_cast<std::size_t>(k)];
      example.best_error = found.best;
      example.settled_error = found.error();
      example.settled_distance = found.distance;
      example.settled_vertex = found.vertex;
    }
  }
  return all;
}

std::string to_string(const SettledPose& pose, const ReducedModel& model) {
  const std::string name =
      pose.region.empty() ? pose.example : fmt::format("{} in region {}", pose.example, pose.region);
  if (!pose.settles) return fmt::format("{}: the body does not settle with this example", name);
  const VertexArray& vertices = model.object->mesh.vertices;
  const Eigen::RowVector3d at = vertices.row(pose.vertex);
  return fmt::format(
      "{}: settled {}{:.1f} % of its displacement from the pose, {:.3g} m ({:.1f} % of the size) at ({:.3g}, {:.3g}, "
      "{:.3g}){}; by the basis {:.1f} (clamp {:.1f}), eigenfunctions {:.1f}, force {:.1f} %{}",
      name, pose.loaded ? "" : "at best ", 100 * pose.error(), pose.distance,
      100 * pose.distance / bounding_box_diagonal(vertices), at[0], at[1], at[2],
      pose.loaded ? fmt::format(", at best {:.1f} %", 100 * pose.best) : "", 100 * pose.basis, 100 * pose.clamp,
      100 * pose.eigenfunctions, 100 * pose.force, advice_on(pose));
}

}  // namespace exmat::precompute

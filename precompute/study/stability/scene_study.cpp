#include "precompute/study/stability/scene_study.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <fmt/format.h>
#include <omp.h>
#include <utility>

#include "common/config/config.h"
#include "common/core/progress.h"
#include "precompute/study/stability/body_scale.h"
#include "precompute/study/stability/scene_variants.h"

namespace exmat::precompute {
namespace {

constexpr int kPatience = 4;       // times the scene's duration, in which a run has to come to rest
constexpr double kReturned = 0.1;  // of L

/// Properties of a scene that decide which checks apply, and why others do not.
struct Traits {
  bool touches = false;  ///< obstacles or other bodies
  bool all_free = true;  ///< every body moves by its momenta
  std::string no_energy, no_momentum;

  Traits(const WorldConfig& scene, const SceneBodies& bodies);
};

Traits::Traits(const WorldConfig& scene, const SceneBodies& bodies) {
  bool examples = false, driven = false, forces = false, keys = false, newmark = false, gravity = false;
  bool obstacles = false, pushed = false;
  for (const BodiesConfig& kind : scene.bodies) keys |= !place_of_keys(kind.scene).empty();
  for (std::size_t i = 0; i < bodies.kinds(); ++i) {
    const runtime::LoadedScene& kind = bodies.kind(i);
    const bool is_free = kind.model->frame->momenta(kind.start.frame).has_value();
    all_free &= is_free;
    examples |= runtime::runs_examples(kind.scene);
    driven |= kind.scene.carrier.has_value();
    for (const runtime::SharedObstacle& obstacle : kind.scene.obstacles) driven |= obstacle->motion.moves();
    obstacles |= !kind.scene.obstacles.empty();
    forces |= !kind.scene.forces.empty();
    pushed |= is_free && !kind.scene.forces.empty();
    newmark |= kind.scene.integrator == Integrator::kNewmark;
    gravity |= !kind.scene.gravity.isZero(0);
  }
  touches = obstacles || bodies.count() > 1;
  no_energy = examples  ? "examples move the target"
              : keys    ? "settings change in time"
              : driven  ? "a motion does work"
              : pushed  ? "forces push a free body"
              : newmark ? "newmark keeps the energy of linear elasticity alone"
                        : "";
  no_momentum = !all_free                       ? "a body is held"
                : obstacles                     ? "obstacles take momentum"
                : forces                        ? "forces act"
                : gravity && bodies.count() > 1 ? "gravity acts on several bodies"
                : gravity && keys               ? "gravity changes in time"
                                                : "";
}

/// Momenta of all bodies, angular about the origin, or of one body about its centre of mass.
struct Momenta {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();
  double linear_size = 0, angular_size = 0;  // sums of the bodies' own

  explicit Momenta(const SceneBodies& bodies) {
    for (int i = 0; i < bodies.count(); ++i) {
      const runtime::BodyFrame& frame = *bodies.kind(bodies.kind_of(i)).model->frame;
      const runtime::FreeState& body = runtime::free_state(bodies.state(i));
      const Eigen::Vector3d own = angular_momentum(*frame.inertia_of_momenta(), bodies.state(i));
      linear += body.linear_momentum;
      angular += own;
      if (bodies.count() > 1) angular += (frame.centre_of_mass() + body.position).cross(body.linear_momentum);
      linear_size += body.linear_momentum.norm();
      angular_size += own.norm();
    }
  }
};

class Runner {
 public:
  Runner(const Traits& traits, const std::vector<BodyScale>& scales, SceneBodies& bodies, bool own_start)
      : traits_(traits), scales_(scales), bodies_(bodies), own_start_(own_start) {}

  /// Takes so many steps and, if the bodies are to come to rest, more until they do; calls `advance` after each step.
  template <typename Advance>
  void run(std::int64_t steps, bool to_rest, Advance advance, SceneRun& run);

 private:
  const runtime::LoadedScene& kind(int body) const { return bodies_.kind(bodies_.kind_of(body)); }
  const BodyScale& scale(int body) const { return scales_[bodies_.kind_of(body)]; }
  double largest(int body, const Eigen::VectorXd& q) const {
    return largest_displacement(kind(body).data.modal->basis, q) / scale(body).size;
  }
  double vibration() const;
  void read(const std::vector<Eigen::VectorXd>& before, double time_step, StepFacts& facts);
  double bound() const;

  const Traits& traits_;
  const std::vector<BodyScale>& scales_;
  SceneBodies& bodies_;
  bool own_start_;
  double start_displacement_ = 0, work_ = 0;
  double peak_rigid_ = 0;  // kinetic energy that deformation may get [J]
};

/// Kinetic energy of the deformation.
double Runner::vibration() const {
  double energy = 0;
  for (int i = 0; i < bodies_.count(); ++i) energy += 0.5 * bodies_.state(i).v.squaredNorm();
  return energy;
}

void Runner::read(const std::vector<Eigen::VectorXd>& before, double time_step, StepFacts& facts) {
  facts.energies = bodies_.energies();
  for (int i = 0; i < bodies_.count(); ++i) {
    const runtime::State& state = bodies_.state(i);
    facts.displacement = std::max(facts.displacement, largest(i, state.q));
    if (before.empty()) continue;
    for (const runtime::ScriptedForce& force : kind(i).scene.forces)
      if (force.acts_at(state.time - 0.5 * time_step))
        work_ += force.force.dot(state.q - before[static_cast<std::size_t>(i)]);
  }
  facts.work = work_;
  facts.kinetic = traits_.touches ? facts.energies.kinetic : vibration();
  double rigid = facts.energies.kinetic - vibration();
  if (traits_.all_free && !traits_.touches) {
    const runtime::FreeState& body = runtime::free_state(bodies_.state(0));
    rigid -= 0.5 * body.linear_momentum.squaredNorm() / body.mass;
  }
  peak_rigid_ = std::max(peak_rigid_, rigid);
}

/// A body of the energy W deflects to |q|_K = sqrt(2 W), a load that sets in at once to 2 |f|_(K^-1), and
/// |u| <= reach |q|_K. One body may get the energy of all. The start's elastic energy is left out: far from linear
/// elasticity that estimate allows for hundreds of sizes.
double Runner::bound() const {
  double most = 0;
  for (int i = 0; i < bodies_.count(); ++i) {
    const runtime::LoadedScene& loaded = kind(i);
    double load = scale(i).load_norm(loaded.scene.gravity_force);
    for (const runtime::ScriptedForce& force : loaded.scene.forces) load += scale(i).load_norm(force.force);
    const double linear = scale(i).reach * (2 * load + std::sqrt(2 * peak_rigid_));
    most = std::max(most, displacement_bound(linear / scale(i).size, start_displacement_));
    for (const auto& poses : loaded.poses)
      for (const runtime::NamedPose& pose : poses)
        most = std::max(most, displacement_bound(largest(i, pose.pose), start_displacement_));
  }
  return most;
}

template <typename Advance>
void Runner::run(std::int64_t steps, bool to_rest, Advance advance, SceneRun& run) {
  RunRecord& record = run.record;
  StepFacts facts;
  read({}, run.time_step, facts);
  start_displacement_ = record.displacement = facts.displacement;
  record.start_energy = facts.energies.total();
  record.start_potential = facts.energies.potential;
  record.exchanged = facts.energies.kinetic + facts.energies.elastic;
  record.kinetic = record.peak_kinetic = facts.kinetic;
  Expectation expected{.energy = traits_.no_energy.empty() && (own_start_ || !traits_.touches),
                       .momentum = traits_.no_momentum.empty(),
                       .integrator = kind(0).scene.integrator};
  std::optional<Momenta> start;
  if (expected.momentum) start.emplace(bodies_);
  const bool has_gravity = !kind(0).scene.gravity.isZero(0);
  expected.momentum &= start && start->angular_size + start->linear_size > 0;
  std::vector<Eigen::VectorXd> before(static_cast<std::size_t>(bodies_.count()));
  while (record.steps < steps || (to_rest && !record.is_at_rest() && record.steps < kPatience * steps)) {
    for (int i = 0; i < bodies_.count(); ++i) before[static_cast<std::size_t>(i)] = bodies_.state(i).q;
    const SceneBodies::Step done = bodies_.step();
    advance();
    facts = {.non_finite = done.non_finite, .unsolved = done.unsolved ? 1 : 0};
    if (done.non_finite == 0) {
      read(before, run.time_step, facts);
      if (expected.momentum) {
        const Momenta now(bodies_);
        const double angular = start->angular_size + start->linear_size * scale(0).size;
        facts.momentum_error = (now.angular - start->angular).norm() / angular;
        if (!has_gravity && start->linear_size > 0)
          facts.momentum_error =
              std::max(facts.momentum_error, (now.linear - start->linear).norm() / start->linear_size);
      }
    }
    if (!record.add(facts)) break;
  }
  expected.displacement = bound();
  run.checks = judge(record, expected);
  for (int i = 0; i < bodies_.count(); ++i) run.end.push_back(bodies_.state(i).q);
}

/// Rest and return, which compare with the scene as it is.
void judge_end(const SceneRun& own, const SceneBodies& bodies, const std::vector<BodyScale>& scales, SceneRun& run) {
  const auto at = [&](Check check) -> CheckResult& { return run.checks[static_cast<std::size_t>(check)]; };
  if (run.record.non_finite > 0) return;
  const RunRecord& record = run.record;
  at(Check::kRest) = judge(record.peak_kinetic > 0 ? record.kinetic / record.peak_kinetic : 0, kRestKinetic);
  if (run.dimension != "start" || at(Check::kRest).verdict != Verdict::kPass) return;
  double farthest = 0;
  for (int i = 0; i < bodies.count(); ++i) {
    const std::size_t body = static_cast<std::size_t>(i), kind = bodies.kind_of(i);
    farthest =
        std::max(farthest, largest_displacement(bodies.kind(kind).data.modal->basis, run.end[body] - own.end[body]) /
                               scales[kind].size);
  }
  at(Check::kReturn) = judge(farthest, kReturned);
}

SafeRange range_of(const SceneDimension& dimension, const std::vector<SceneRun>& runs) {
  SafeRange range{.dimension = dimension.name, .own = dimension.own};
  if (dimension.variants.empty()) {
    range.safe = "not tested: " + dimension.left_out;
    return range;
  }
  const bool own_passes = runs.front().passes();
  std::string last = own_passes ? "1 x" : "none";
  bool is_safe = own_passes;
  for (const SceneVariant& variant : dimension.variants) {
    const auto same = [&](const SceneRun& run) {
      return run.dimension == dimension.name && run.variant == variant.name;
    };
    const SceneRun& run = *std::ranges::find_if(runs, same);
    if (!run.passes())
      range.fails += fmt::format("{}{}: {}", range.fails.empty() ? "" : "; ", run.variant, run.failures());
    if (!dimension.is_ordered()) {
      if (run.passes()) range.safe += (range.safe.empty() ? "" : ", ") + run.variant;
      continue;
    }
    if (variant.factor < 1) continue;
    is_safe &= run.passes();
    if (is_safe) last = run.variant;
  }
  if (dimension.is_ordered()) range.safe = last + (is_safe ? " and more" : "");
  if (range.safe.empty()) range.safe = "none";
  return range;
}

}  // namespace

std::string SceneRun::failures() const {
  std::string text;
  for (std::size_t i = 0; i < checks.size(); ++i)
    if (checks[i].verdict == Verdict::kFail)
      text += fmt::format("{}{} {:.3g}, limit {:.3g}", text.empty() ? "" : ", ", kCheckNames[i], checks[i].value,
                          checks[i].limit);
  return text;
}

SceneStudy study_scene(const std::filesystem::path& file, int jobs) {
  const WorldConfig scene = load_world(file);
  const SceneBodies bodies(scene);
  const Traits traits(scene, bodies);
  std::vector<BodyScale> scales;
  for (std::size_t i = 0; i < bodies.kinds(); ++i) {
    const runtime::LoadedScene& kind = bodies.kind(i);
    scales.push_back(
        measure_scale(kind.data.object->mesh.vertices, kind.data.modal->basis, kind.model->internal_force));
  }
  const std::vector<SceneDimension> dimensions = scene_dimensions(scene, bodies);
  const SceneVariant own{.name = "1 x", .factor = 1, .scene = scene};
  std::vector<std::pair<std::string, const SceneVariant*>> tasks{{"", &own}};
  for (const SceneDimension& dimension : dimensions)
    for (const SceneVariant& variant : dimension.variants) tasks.emplace_back(dimension.name, &variant);

  SceneStudy study{.scene = file.filename().string(), .duration = scene.time_step * static_cast<double>(scene.steps)};
  study.runs.resize(tasks.size());
  std::int64_t all_steps = 0;
  for (const auto& [dimension, variant] : tasks) all_steps += variant->scene.steps;
  Progress progress("stability", all_steps);
  const auto make = [&](std::size_t i, bool to_rest) {
    const auto& [dimension, variant] = tasks[i];
    SceneRun& run = study.runs[i];
    run.dimension = dimension;
    run.variant = variant->name;
    run.time_step = variant->scene.time_step;
    std::int64_t left = variant->scene.steps;
    const auto advance = [&](std::int64_t steps) {
#pragma omp critical(exmat_stability_progress)
      progress.advance(std::min(steps, left));
      left -= std::min(steps, left);
    };
    std::optional<SceneBodies> its_own;
#pragma omp critical(exmat_stability_load)
    its_own.emplace(variant->scene);
    Runner(traits, scales, *its_own, dimension != "start")
        .run(
            left, to_rest, [&] { advance(1); }, run);
    advance(left);
  };
  make(0, false);
  const SceneRun& own_run = study.runs.front();
  const bool to_rest = own_run.record.non_finite == 0 && own_run.record.peak_kinetic > 0 && own_run.record.is_at_rest();
  const bool several = bodies.count() > 1;  // whose steps share the threads
  std::exception_ptr failure;
#pragma omp parallel for schedule(dynamic) num_threads(several ? 1 : jobs)
  for (std::size_t i = 1; i < tasks.size(); ++i) {
    try {
      make(i, to_rest);
    } catch (...) {
#pragma omp critical(exmat_stability_failure)
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
  if (to_rest)
    for (SceneRun& run : study.runs) judge_end(own_run, bodies, scales, run);
  else
    study.not_tested.emplace_back(
        "rest, return: the scene itself does not come to rest; with more steps or damping it may");
  if (!traits.no_energy.empty()) study.not_tested.push_back("energy: " + traits.no_energy);
  if (!traits.no_momentum.empty()) study.not_tested.push_back("momentum: " + traits.no_momentum);
  for (const SceneDimension& dimension : dimensions) {
    study.ranges.push_back(range_of(dimension, study.runs));
    if (!dimension.left_out.empty()) study.not_tested.push_back(dimension.name + ": " + dimension.left_out);
  }
  study.not_tested.push_back(
      fmt::format("two changes at once, times beyond {:g} s, factors between those tried, other bundles of the asset",
                  study.duration));
  return study;
}

}  // namespace exmat::precompute

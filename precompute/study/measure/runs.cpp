#include "precompute/study/measure/runs.h"

#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <optional>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "common/core/timer.h"
#include "precompute/full_space/scene_setup.h"
#include "runtime/scene/keyed_settings.h"
#include "runtime/scene/obstacle_loader.h"
#include "runtime/scene/samples.h"
#include "runtime/sim/frame/world_vertices.h"
#include "runtime/sim/lanes/lane_step.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/world/world.h"

namespace exmat::precompute {
namespace {

// [n x 3] U v.
VertexArray field(const ReducedModel& data, const Eigen::VectorXd& v) {
  return (data.modal->basis * v).reshaped<Eigen::RowMajor>(data.object->mesh.vertex_count(), 3);
}

constexpr double kReboundPause = 0.05;  // of the duration

[[noreturn]] void fail_non_finite(std::int64_t step, double time) {
  throw WorkError(
      fmt::format("step {} (time {:g} s): a number that is not finite; try a smaller time step", step, time));
}

// Counts and times of a run on its way.
class Meter {
 public:
  /// `pause`: how long no contact may come back for a rebound [s].
  Meter(std::int64_t steps, double pause, BodyFrames& frames) : frames_(frames), seconds_(steps), rebound_(pause) {}

  void add(const runtime::StepReport& report, double seconds) {
    ++frames_.steps;
    frames_.unconverged += (report.status & runtime::kStepUnconverged) != 0;
    frames_.newton_iterations += report.newton_iterations;
    frames_.factorisations += report.factorisations;
    seconds_.add(seconds);
  }
  void add_centre(const runtime::StepReport& report, double time, const Eigen::Vector3d& velocity) {
    rebound_.add(time, report.contacts > 0, velocity);
  }
  void finish() {
    frames_.rebound = rebound_.found();
    frames_.newton_iterations /= static_cast<double>(frames_.steps);
    frames_.factorisations /= static_cast<double>(frames_.steps);
    frames_.step_seconds = seconds_.quantile(0.5);
  }

 private:
  BodyFrames& frames_;
  runtime::Samples seconds_;
  ReboundFinder rebound_;
};

// Velocity of the centre of mass [m/s]; empty where nothing asks for it.
using CentreVelocity = std::function<Eigen::Vector3d()>;

// Takes steps and records frames; `take` makes one step, `record` adds the positions and velocities of a frame.
template <typename Take, typename Record, typename Energy>
BodyFrames run(double time_step, const std::vector<double>& times, Take take, Record record, Energy energy,
               const CentreVelocity& centre) {
  BodyFrames frames;
  frames.times = times;
  Meter meter(std::llround(times.back() / time_step), kReboundPause * times.back(), frames);
  if (centre) meter.add_centre({}, 0, centre());
  for (const double time : times) {
    const std::int64_t until = std::llround(time / time_step);
    while (frames.steps < until) {
      const Timer timer;
      const runtime::StepReport report = take();
      meter.add(report, timer.seconds());
      if (report.status & runtime::kStepNonFinite) fail_non_finite(frames.steps, time);
      if (centre) meter.add_centre(report, static_cast<double>(frames.steps) * time_step, centre());
    }
    record(frames);
    const runtime::Energies now = energy();
    frames.kinetic.push_back(now.kinetic);
    frames.elastic.push_back(now.elastic);
    frames.potential.push_back(now.potential);
  }
  meter.finish();
  return frames;
}

FullSpaceModel model_of(const SceneConfig& config, const ReducedModel& data,
                        const std::vector<PoseCoordinates>& coordinates) {
  if (data.skeleton)
    throw InputError({config.file.string(), config.place + "/bundle", "the bundle of a body without bones",
                      config.bundle.string() + ", whose bones or clamp its examples move",
                      "it steps in all its vertices as it is: exmat-runtime run"});
  FullSpaceOptions options = full_space_options(config);
  options.coordinates = coordinates;
  return build_full_space_model(data, options);
}

// [n] shares of the mass in the motion of the centre [kg].
Eigen::VectorXd vertex_masses(const ReducedModel& data) {
  const SparseMatrix mass = scalar_mass(data.object->mesh, data.object->materials.density);
  return mass * Eigen::VectorXd::Ones(mass.cols());
}

// [3n] deformation.
Eigen::VectorXd start_of(const SceneConfig& config, const ReducedModel& data) {
  const RowMatrix& basis = data.modal->basis;
  return basis * runtime::start_coordinates(config, data, basis.cols());
}

}  // namespace

WorldFrame world_frame(const ReducedModel& data, const runtime::BodyFrame& frame, const runtime::State& state,
                       const runtime::FullModel* full) {
  if (state.full) {
    const runtime::Placement placement = frame.placement(state.frame);
    const runtime::FrameVelocity velocity = frame.velocity(state.frame);
    WorldFrame found{data.object->mesh.vertices, data.object->mesh.vertices};
    for (Eigen::Index v = 0; v < found.positions.rows(); ++v) {
      found.positions.row(v) += runtime::full_displacement(*full, placement, *state.full, v).transpose();
      found.velocities.row(v) = runtime::full_velocity(*full, placement, velocity, *state.full, v);
    }
    return found;
  }
  WorldFrame found{data.object->mesh.vertices + field(data, state.q), field(data, state.v)};
  if (frame.moves())
    runtime::to_world(frame.placement(state.frame), frame.velocity(state.frame), found.positions, found.velocities);
  return found;
}

namespace {

// Takes steps of one body as a scene's instances take them: with mixed precision in a lane, the others idle; where it
// has two spaces in the one that a world chooses.
class Stepper {
 public:
  Stepper(const runtime::LoadedScene& loaded, runtime::State& state)
      : loaded_(loaded),
        state_(state),
        in_lanes_(loaded.scene.precision == Precision::kMixed &&
                  runtime::can_step_side_by_side(*loaded.model, loaded.scene)),
        workspace_(*loaded.model, loaded.scene, in_lanes_ ? runtime::kLanes : 1) {
    if (!loaded.full) return;
    world_.emplace(runtime::ContactLaw{});
    world_->add({loaded.model.get(), &loaded.scene, nullptr, loaded.full.get()}, state);
  }

  runtime::StepReport step() {
    if (world_) {
      world_->step(1);
      return world_->report(0);
    }
    if (!in_lanes_) return runtime::step(*loaded_.model, loaded_.scene, state_, workspace_.body(0));
    runtime::StepReport report;
    const runtime::LaneBody body{&loaded_.scene, &state_};
    runtime::step_in_lanes(*loaded_.model, {&body, 1}, workspace_, {&report, 1});
    return report;
  }

  runtime::Energies energies() const {
    return world_ ? world_->energies(0) : runtime::energies(*loaded_.model, loaded_.scene, state_);
  }

 private:
  const runtime::LoadedScene& loaded_;
  runtime::State& state_;
  std::optional<runtime::World> world_;
  bool in_lanes_;
  runtime::LaneWorkspace workspace_;
};

}  // namespace

std::string target_of(const runtime::LoadedScene& loaded) {
  for (std::size_t i = 0; i < loaded.scene.examples.size(); ++i)
    if (runtime::acts(loaded.scene.examples[i])) return loaded.model->examples[i].table ? "table" : "solve";
  return "none";
}

void require_no_keys(const SceneConfig& config) {
  if (const std::string keys = place_of_keys(config); !keys.empty())
    throw InputError({config.file.string(), keys, "a value: studies take no keys", "keys",
                      "measure scenes with the values between the keys, one by one"});
}

ReducedRun run_reduced(const SceneConfig& config, const std::vector<double>& times) {
  require_no_keys(config);
  const runtime::LoadedScene loaded = runtime::load_run(config);
  runtime::State state = loaded.start;
  Stepper stepper(loaded, state);
  CentreVelocity centre;
  if (!config.obstacles.empty() && loaded.model->frame->momenta(state.frame))
    centre = [&] { return loaded.model->frame->motion(state.frame).linear_velocity; };
  ReducedRun result;
  result.modes = static_cast<std::size_t>(loaded.model->modes());
  result.elements = static_cast<std::size_t>(loaded.summary.cubature_elements);
  result.internal_force = loaded.model->internal_force.polynomial() ? "polynomial" : "cubature";
  result.target = target_of(loaded);
  result.frames = run(
      config.time_step, times, [&] { return stepper.step(); },
      [&](BodyFrames& frames) {
        WorldFrame now = world_frame(loaded.data, *loaded.model->frame, state, loaded.full.get());
        frames.positions.push_back(std::move(now.positions));
        frames.velocities.push_back(std::move(now.velocities));
      },
      [&] { return stepper.energies(); }, centre);
  return result;
}

FullSpaceRun::FullSpaceRun(const SceneConfig& config, const ReducedModel& data,
                           const std::vector<PoseCoordinates>& coordinates)
    : model(model_of(config, data, coordinates)),
      scene(full_space_scene(config, runtime::make_obstacles(config), model)),
      keys(runtime::make_keys(config)),
      state(full_space_start(config, model, start_of(config, data))),
      stepper(model) {
  keys.apply_start(scene.gravity, scene.examples);
  stepper.set(scene);
}

FullSpaceReport FullSpaceRun::step() {
  if (!keys.empty()) {
    if (keys.apply(model.frame.has_value(), state.step, scene.time_step, scene.gravity, scene.examples))
      state.begins_anew = true;
    stepper.set(scene);
  }
  return stepper.step(state);
}

FullSpaceReport FullSpaceRun::sound_step() {
  const FullSpaceReport report = step();
  if (report.status & runtime::kStepNonFinite) fail_non_finite(state.step, state.time);
  return report;
}

BodyFrames run_full_space(const SceneConfig& config, const ReducedModel& data, const std::vector<double>& times,
                          const std::vector<PoseCoordinates>& coordinates) {
  require_no_keys(config);
  FullSpaceRun body(config, data, coordinates);
  CentreVelocity centre;
  if (!config.obstacles.empty() && body.model.frame)
    centre = [&, weights = vertex_masses(data)]() -> Eigen::Vector3d {
      return world_velocities(body.model, body.state).transpose() * weights / weights.sum();
    };
  return run(
      config.time_step, times, [&] { return body.step(); },
      [&](BodyFrames& frames) {
        frames.positions.push_back(world_positions(body.model, body.state));
        frames.velocities.push_back(world_velocities(body.model, body.state));
      },
      [&] { return energies(body.model, body.scene, body.state); }, centre);
}

}  // namespace exmat::precompute

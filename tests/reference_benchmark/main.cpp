// Steps a scene reduced, in full space and by the baseline of the paper's Table 2, and prints how long a step takes and
// how far the reduced trajectory is from the full one.
//   exmat-reference-benchmark SCENE.json [STEPS]

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iostream>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "common/core/timer.h"
#include "precompute/reference/scene_setup.h"
#include "runtime/io/obstacle_loader.h"
#include "runtime/io/scene_loader.h"
#include "runtime/sim/stepper.h"

namespace exmat::benchmarks {
namespace {

using precompute::FullSpaceModel;
using precompute::FullSpaceReport;
using precompute::FullSpaceState;
using precompute::FullSpaceWorkspace;

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values.empty() ? 0 : values[values.size() / 2];
}

double mass_norm(const FullSpaceModel& model, const VertexArray& field) {
  const Eigen::VectorXd flat = field.reshaped<Eigen::RowMajor>();
  return std::sqrt(flat.dot(model.system.full_mass * flat));
}

/// [n x 3] world positions of the reduced body.
VertexArray reduced_positions(const ReducedModel& data, const runtime::State& state) {
  const VertexArray local =
      data.object->mesh.vertices +
      (data.modal->basis * state.q).reshaped<Eigen::RowMajor>(data.object->mesh.vertex_count(), 3);
  if (!state.body) return local;
  const Eigen::RowVector3d centre = data.rigid->centre_of_mass.transpose();
  const VertexArray turned = (local.rowwise() - centre) * state.body->orientation.toRotationMatrix().transpose();
  return turned.rowwise() + (centre + state.body->position.transpose());
}

struct Times {
  std::vector<double> total, target;
  long newton = 0, factorisations = 0, target_iterations = 0, evaluations = 0, unconverged = 0, inverted = 0, steps = 0;

  void add(const FullSpaceReport& report) {
    total.push_back(report.seconds);
    if (report.target_iterations > 0) target.push_back(report.target_seconds);
    newton += report.newton_iterations;
    factorisations += report.factorisations;
    target_iterations += report.target_iterations;
    evaluations += report.target_evaluations;
    unconverged += (report.status & runtime::kStepUnconverged) != 0;
    inverted = std::max<long>(inverted, report.inverted_tets);
    ++steps;
  }
  void print(const char* name) const {
    const auto each = [this](long count) { return static_cast<double>(count) / static_cast<double>(steps); };
    fmt::print(
        "{:9} t_total {:8.3f} ms  t_interp {:8.3f} ms  (medians of {} steps, t_interp of the {} that solved for a "
        "target; a step: {:.2f} Newton, {:.2f} "
        "factorisations, {:.1f} target iterations, {:.1f} evaluations; {} unconverged, {} tets inverted)\n",
        name, 1e3 * median(total), 1e3 * median(target), steps, target.size(), each(newton), each(factorisations),
        each(target_iterations), each(evaluations), unconverged, inverted);
  }
};

FullSpaceReport sound_step(const FullSpaceModel& model, const precompute::FullSpaceScene& scene, FullSpaceState& state,
                           FullSpaceWorkspace& workspace) {
  const FullSpaceReport report = precompute::step(model, scene, state, workspace);
  if (report.status & runtime::kStepNonFinite)
    throw WorkError(fmt::format("step {}: a number that is not finite", state.step));
  return report;
}

void compare(const SceneConfig& config, const ReducedModel& data, long steps) {
  auto loaded = runtime::load_run(config);
  const FullSpaceModel model = precompute::build_full_space_model(data, precompute::full_space_options(config));
  const auto scene = precompute::full_space_scene(config, runtime::make_obstacles(config), model);
  runtime::State reduced = loaded.start;
  runtime::Workspace reduced_workspace(*loaded.model, loaded.scene);
  FullSpaceState state = precompute::full_space_start(config, model, data.modal->basis * reduced.q);
  FullSpaceWorkspace workspace(model);
  Times times;
  std::vector<double> reduced_seconds;
  double square = 0, largest = 0, size = 0, distance = 0;
  for (long i = 0; i < steps; ++i) {
    const Timer timer;
    runtime::step(*loaded.model, loaded.scene, reduced, reduced_workspace);
    reduced_seconds.push_back(timer.seconds());
    times.add(sound_step(model, scene, state, workspace));
    const VertexArray full = precompute::world_positions(model, state);
    distance = mass_norm(model, reduced_positions(data, reduced) - full);
    const double moved = mass_norm(model, full - model.rest);
    square += distance * distance;
    size += moved * moved;
    largest = std::max(largest, distance);
  }
  fmt::print("{} DOFs, {} tets, {} modes\nreduced   t_total {:8.3f} ms\n", model.size(), data.object->mesh.tet_count(),
             reduced.q.size(), 1e3 * median(reduced_seconds));
  times.print("full");
  fmt::print("reduced against full: RMS distance {:.2f} % of the RMS displacement (M-norm), largest {:.3g} kg^1/2 m\n",
             100 * std::sqrt(square / size), largest);
}

void baseline(const SceneConfig& config, const ReducedModel& data, long steps) {
  precompute::FullSpaceOptions options = precompute::full_space_options(config);
  options.targets = precompute::ExampleTargets::kSurface;
  const FullSpaceModel model = precompute::build_full_space_model(data, options);
  auto scene = precompute::full_space_scene(config, runtime::make_obstacles(config), model);
  scene.example_elasticity = 1;
  FullSpaceState state = precompute::full_space_start(config, model, Eigen::VectorXd::Zero(model.rest.size()));
  FullSpaceWorkspace workspace(model);
  Times times;
  for (long i = 0; i < steps; ++i) times.add(sound_step(model, scene, state, workspace));
  fmt::print("{} vertices of the surface, d = {}\n", model.surface_targets.front().surface_vertices(),
             model.examples.front().pose_basis().cols());
  times.print("baseline");
}

int run(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "exmat-reference-benchmark SCENE.json [STEPS]\n";
    return 2;
  }
  const SceneConfig config = load_scene(argv[1]);
  const long steps = argc > 2 ? std::stol(argv[2]) : static_cast<long>(config.steps);
  const ReducedModel data = read_bundle(config.bundle);
  compare(config, data, steps);
  if (config.examples || !config.regions.empty()) baseline(config, data, steps);
  return 0;
}

}  // namespace
}  // namespace exmat::benchmarks

int main(int argc, char** argv) {
  try {
    return exmat::benchmarks::run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}

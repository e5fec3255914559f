#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/console/console.h"
#include "precompute/solvers/ranks.h"
#include "runtime/scene/samples.h"
#include "tests/paper/baseline.h"
#include "tests/support/sparse_space/sparse_model.h"

namespace {

using namespace exmat;

/// Times steps of a scene from rest and prints medians as JSON.
void time_baseline(const std::string& file, int steps) {
  SceneConfig scene = load_scene(file);
  scene.body.pose.reset();
  scene.body.reduced.reset();
  const ReducedModel data = read_bundle(scene.bundle);
  precompute::FullSpaceRun run(scene, data);
  precompute::make_baseline(data, run);
  const precompute::SparseModel model(run.model, data);
  precompute::SparseWorkspace workspace(model);
  runtime::Samples whole(steps), interpolation(steps);
  for (int i = 0; i < steps; ++i) {
    const precompute::SparseReport report = precompute::step(model, run.scene, run.state, workspace);
    if (report.status & runtime::kStepNonFinite) throw WorkError("a number that is not finite");
    whole.add(report.seconds);
    if (report.target_iterations > 0) interpolation.add(report.target_seconds);
  }
  fmt::print("{{\"interp_us\": {:.3f}, \"median_us\": {:.3f}, \"steps\": {}}}\n", 1e6 * interpolation.quantile(0.5),
             1e6 * whole.quantile(0.5), steps);
}

int run(int argc, char** argv) {
  CLI::App app{
      "Times the full-space method that the paper compares with: targets by the energy of the surface, elastic "
      "example forces.",
      "exmat-paper-baseline"};
  CommonOptions common;
  add_common_options(app, common);
  std::string scene;
  int steps = 50;
  app.add_option("SCENE", scene, "scene file (JSON), with its whole bundle")->required();
  app.add_option("--steps", steps, "steps from rest, whose medians are printed")->check(CLI::PositiveNumber);
  return run_program(app, argc, argv, [&] {
    apply(common);
    time_baseline(scene, steps);
  });
}

}  // namespace

int main(int argc, char** argv) {
  return precompute::run_on_ranks([&] { return run(argc, argv); });
}

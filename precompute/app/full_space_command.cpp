#include "precompute/app/full_space_command.h"

#include <fmt/format.h>

#include "common/bundle/file_schemas.h"
#include "common/config/config.h"
#include "common/core/command_files.h"
#include "common/core/log.h"
#include "common/hdf5/xdmf.h"
#include "precompute/study/measure/full_space_trajectory.h"

namespace exmat {
namespace {

void print(const char* name, const std::string& value) { fmt::print("{:<22} {}\n", name, value); }

void print_summary(const precompute::FullSpaceSummary& summary, const SceneConfig& config,
                   const std::string& trajectory) {
  print("steps", std::to_string(summary.steps));
  print("simulated time", fmt::format("{:g} s", static_cast<double>(summary.steps) * config.time_step));
  print("median step time", fmt::format("{:.3f} ms", 1e3 * summary.step_seconds));
  print("Newton iterations", fmt::format("{:.2f} a step", summary.newton_iterations));
  print("unconverged steps", std::to_string(summary.unconverged));
  print("kinetic energy", fmt::format("{:.6g} J", summary.energies.kinetic));
  print("elastic energy", fmt::format("{:.6g} J", summary.energies.elastic));
  print("potential energy", fmt::format("{:.6g} J", summary.energies.potential));
  print("inverted tets",
        fmt::format("at most {} in a frame, {} in the last", summary.inverted.most, summary.inverted.last));
  print("trajectory", fmt::format("{}, {} frames", trajectory, summary.frames));
}

}  // namespace

void full_space_command(const FullSpaceCommandOptions& options) {
  claim_trajectory(options.trajectory, "-o");
  SceneConfig config = load_scene(options.scene);
  require_files(config);
  check_input(config.bundle, "a bundle");
  for (const NamedFile& named : obstacle_files(config)) check_input(named.file, named.kind);
  require_trajectory_kind(options.trajectory, "-o", trajectory_schema());
  if (options.steps) config.steps = *options.steps;
  if (options.every) config.every = *options.every;
  const precompute::FullSpaceSummary summary = precompute::write_full_space(config, options.trajectory);
  if (summary.unconverged > 0)
    log::warning(fmt::format("{} of {} steps did not reach the tolerance; a smaller time_step may help",
                             summary.unconverged, summary.steps));
  if (summary.inverted.any())
    log::warning(
        fmt::format("up to {} tets are inverted in a frame: this is no truth to measure by; use the material "
                    "stable_neo_hookean, or smaller loads",
                    summary.inverted.most));
  print_summary(summary, config, options.trajectory);
}

}  // namespace exmat

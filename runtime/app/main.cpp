#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <map>
#include <string>

#include "common/console/console.h"
#include "common/core/version.h"
#include "common/hdf5/library_versions.h"
#include "runtime/app/commands.h"

int main(int argc, char** argv) {
  using namespace exmat;
  CLI::App app{"Steps example-based elastic bodies in real time.", "exmat-runtime"};
  app.set_version_flag("--version", [] { return fmt::format("exmat-runtime {}, {}", version(), library_versions()); });
  app.require_subcommand(1);
  CommonOptions common;
  add_common_options(app, common);

  runtime::RunCommandOptions options;
  CLI::App& run = *app.add_subcommand("run", "Step a scene on its bundle");
  run.add_option("scene", options.scene, "SCENE.json")->required();
  run.add_option("-o,--output", options.trajectory,
                 "Trajectory (HDF5; an .xdmf comes beside it), instead of the scene's");
  const CLI::Validator step_range = whole_number_between(1, 1'000'000'000'000);
  run.add_option("--steps", options.steps, "Number of steps, instead of the scene's")->check(step_range);
  run.add_flag("--profile", options.run.profiled, "Print the time of each stage");
  run.add_flag("--load-capacity", options.load_capacity,
               "Print how much of forces and contacts the basis cannot answer, also of a large mesh");
  run.add_option("--from-state", options.run.from_state, "Begin at the state of this file, which --dump-state wrote");
  run.add_option("--dump-state", options.run.dump_state,
                 "File for the state at the end, or before a step that fails: the run goes on from it to the last bit");

  runtime::BenchCommandOptions bench_options;
  CLI::App& bench = *app.add_subcommand("bench", "Step a scene without output and say how fast each stage is");
  bench.add_option("scene", bench_options.scene, "SCENE.json")->required();
  bench
      .add_option("--steps", bench_options.steps,
                  "Steps of one round; default: the scene's, or what two seconds allow if that is less")
      ->check(step_range);
  bench.add_flag("--json", bench_options.json, "Print JSON instead of a table");

  runtime::ExportOptions export_options;
  CLI::App& export_command = *app.add_subcommand(
      "export", "Write a motion for other programs: glTF with morph targets (.glb), USD (.usda), point cache (.pc2)");
  export_command.add_option("trajectory", export_options.trajectory, "TRAJECTORY.h5; none: the modes of --bundle");
  export_command.add_option("-o,--output", export_options.output, "File to write (.glb, .usda or .pc2)")->required();
  export_command.add_option("--bundle", export_options.bundle,
                            "Bundle whose modes become morph targets of a .glb, instead of the one that was stepped");
  export_command.add_option("--body", export_options.body, "The body alone, of a trajectory of several")
      ->type_name("NAME");
  export_command
      .add_option("--targets", export_options.targets,
                  "Morph targets of a .glb, by principal components of the motion; default: one for each mode")
      ->check(whole_number_between(1, 1'000'000));
  export_command.add_flag("--mesh", export_options.mesh, "The tet mesh, also where there is a render mesh");
  export_command
      .add_option("--frame-rate", export_options.frame_rate,
                  "Frames a second of the animation; default: 24 of a .usda, of a .pc2 a sample is a frame")
      ->check(number_between(1e-3, 1e6));
  const std::map<std::string, runtime::UpAxis> axes{{"y", runtime::UpAxis::kY}, {"z", runtime::UpAxis::kZ}};
  take_words(
      *export_command.add_option("--up", export_options.up, "Axis of the object that points up, y (default) or z"),
      axes);

  runtime::PackOptions pack_options;
  CLI::App& pack = *app.add_subcommand("pack", "Write what runs need of a bundle as one block of memory, without HDF5");
  pack.add_option("bundle", pack_options.bundle, "BUNDLE.h5")->required();
  pack.add_option("-o,--output", pack_options.output, "Pack to write (.exmat)")->required();
  pack.add_option("--scene", pack_options.scene, "SCENE.json: keep the groups that this scene needs, no others");

  std::filesystem::path bundle;
  CLI::App& info = *app.add_subcommand("info", "Say what a bundle holds");
  CLI::App& validate = *app.add_subcommand("validate", "Say whether every dataset of a bundle is sound");
  for (CLI::App* command : {&info, &validate})
    command->add_option("bundle", bundle, "BUNDLE.h5, or a pack of one")->required();

  return run_program(app, argc, argv, [&] {
    apply(common);
    if (run.parsed()) runtime::run_command(options);
    if (bench.parsed()) runtime::bench_command(bench_options);
    if (export_command.parsed()) runtime::export_command(export_options);
    if (pack.parsed()) runtime::pack_command(pack_options);
    if (info.parsed()) runtime::info_command(bundle);
    if (validate.parsed()) runtime::validate_command(bundle);
  });
}

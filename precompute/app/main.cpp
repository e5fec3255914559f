#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "common/config/config.h"
#include "common/console/console.h"
#include "common/core/log.h"
#include "common/core/version.h"
#include "common/hdf5/library_versions.h"
#include "precompute/app/asset_input.h"
#include "precompute/app/bundle_command.h"
#include "precompute/app/full_space_command.h"
#include "precompute/app/mesh_command.h"
#include "precompute/app/solver_options.h"
#include "precompute/app/study_command.h"
#include "precompute/examples/alignment_report.h"
#include "precompute/pipeline/build_reduced_model.h"
#include "precompute/solvers/ranks.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace {

using namespace exmat;

struct CheckOptions {
  std::string asset;
  std::string alignment_report;
};

void print_alignments(const std::vector<precompute::AlignmentOutcome>& outcomes) {
  fmt::print("\n{:<20}{:<20}{:>12}{:>14}{:>14}{:>12}{:>16}  {}\n", "example", "method", "doubt", "residual [%]",
             "inverted [%]", "competing", "lost by m [%]", "alignment");
  for (const auto& outcome : outcomes)
    fmt::print("{:<20}{:<20}{:>12.3f}{:>14.2f}{:>14.2f}{:>12}{:>16.2f}  {}\n", outcome.name, outcome.method,
               outcome.doubt, 100 * outcome.residual, 100 * outcome.inverted_fraction, outcome.competing_maps,
               100 * outcome.shape_space_error, precompute::name_of(outcome.verdict));
}

void check(const CheckOptions& options) {
  precompute::BuildReport report;
  const AssetConfig asset = asset_from(options.asset);
  if (!options.alignment_report.empty()) precompute::claim_alignment_report(asset, options.alignment_report);
  const auto outcomes = precompute::check_inputs(asset, options.alignment_report, report);
  if (!outcomes.empty()) print_alignments(outcomes);
  precompute::require_aligned(asset, outcomes, report.warnings);
  fmt::print("{}: sound, {} files read\n", options.asset, report.inputs.size());
}

int run(std::vector<char*> words) {
  CLI::App app{"Turns an object and its example poses into a bundle for exmat-runtime.", "exmat-precompute"};
  app.set_version_flag("--version", [] {
    return fmt::format("exmat-precompute {}, {}, {}, mesher: {}", version(), precompute::solver_versions(),
                       library_versions(), precompute::mesher_version());
  });
  app.require_subcommand(1);
  CommonOptions common;
  add_common_options(app, common);
  precompute::SolverSettings solvers{.options = take_solver_options(words)};
  add_solver_options(app, solvers);

  BundleOptions options;
  auto* bundle_command_line = app.add_subcommand("bundle", "compute the offline stage and write a bundle");
  const char* asset_text =
      "asset file (JSON), or a surface (.glb, .gltf, .obj, .ply, .stl) that an asset is assumed for";
  bundle_command_line->add_option("ASSET", options.asset, asset_text)->required();
  bundle_command_line->add_option("-o,--output", options.bundle, "bundle to write (HDF5)")->required();
  bundle_command_line->add_option("--scene", options.scene, "write only what this scene needs");
  bundle_command_line->add_option("--write-asset", options.write_asset,
                                  "file to write the asset that a surface stands for into (JSON)");
  bundle_command_line->add_option("--depfile", options.depfile, "file to list what was read in, for Make and Ninja");
  bundle_command_line->add_option(
      "--report", options.report,
      "file to write stages, times, errors, warnings and hashes into, also of a failure (JSON)");
  bundle_command_line->add_option("--cache", options.cache,
                                  "folder to keep stages in, so that only what depends on a change is computed again");
  bundle_command_line
      ->add_option("--training-budget", options.training_budget,
                   "seconds after which no run of training begins; the bundle then depends on the machine's speed")
      ->check(positive_number());
  bundle_command_line->add_flag("--if-changed", options.if_changed,
                                "do nothing where the bundle was made of the same inputs by this version");

  CheckOptions check_options;
  auto* check_command =
      app.add_subcommand("check", "read and check the inputs and align the examples, compute nothing else");
  check_command->add_option("ASSET", check_options.asset, asset_text)->required();
  const auto add_alignment_report = [](CLI::App* command, std::string& folder) {
    command->add_option(
        "--alignment-report", folder,
        "folder to write each transferred pose beside its example into (.vtk), and a page with pictures");
  };
  add_alignment_report(bundle_command_line, options.alignment_report);
  add_alignment_report(check_command, check_options.alignment_report);

  MeshCommandOptions mesh_options;
  auto* mesh_command_line =
      app.add_subcommand("mesh", "enclose a surface with tets, write these and what they are like");
  mesh_command_line->add_option("SURFACE", mesh_options.surface, "surface (.glb, .gltf, .obj, .ply, .stl)")->required();
  mesh_command_line->add_option("-o,--output", mesh_options.mesh, "mesh to write (Gmsh .msh)")->required();
  auto* cells = mesh_command_line->add_option("--cells", mesh_options.settings.cells, "about so many tets")
                    ->check(CLI::Range(50, 2000000));
  mesh_command_line
      ->add_option("--cell-size", mesh_options.settings.cell_size, "radius of the sphere about a tet, at most [m]")
      ->check(positive_number())
      ->excludes(cells);

  StudyCommandOptions study_options;
  auto* study_command_line = app.add_subcommand(
      "study", "measure a scene's error against run time over sweeps of settings, by the full space");
  auto* subject = study_command_line->add_option_group("subject", "what to measure");
  subject->require_option(1);
  subject->add_option("STUDY", study_options.study, "study file (JSON)");
  subject->add_option(
      "--stability", study_options.scene,
      "scene file (JSON) to run with other time steps, loads, speeds, stiffnesses and starts: how far each "
      "is safe; status 1 if the scene fails as it is");
  study_command_line
      ->add_option(
          "-o,--output", study_options.folder,
          "folder for report.html, results.csv, results.json and what a resumed study needs; with --stability for "
          "stability.html, .md, .csv and .json")
      ->required();
  study_command_line
      ->add_option("--budget-us", study_options.budget_us,
                   "recommend the most accurate point of at most so many us a step")
      ->check(positive_number());
  study_command_line
      ->add_option(
          "--max-error", study_options.max_error,
          "recommend the fastest point of at most so many percent of error: of shape of a free body, else of position")
      ->check(positive_number());
  study_command_line
      ->add_option("--jobs", study_options.jobs,
                   "processes that run points; times are measured by one. With --stability runs at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();

  FullSpaceCommandOptions full_space_options;
  auto* full_space_command_line = app.add_subcommand(
      "full-space", "step a scene with all degrees of freedom of its mesh, without a basis, and write the trajectory");
  full_space_command_line->add_option("SCENE", full_space_options.scene, "scene file (JSON), with its bundle")
      ->required();
  full_space_command_line
      ->add_option("-o,--output", full_space_options.trajectory, "trajectory to write (HDF5), and an .xdmf beside it")
      ->required();
  const CLI::Range count_range(std::int64_t{1}, std::int64_t{1'000'000'000'000});
  full_space_command_line->add_option("--steps", full_space_options.steps, "so many steps instead of the scene's")
      ->check(count_range);
  full_space_command_line
      ->add_option("--every", full_space_options.every, "write a frame every so many steps instead of the scene's")
      ->check(count_range);
  return run_program(app, static_cast<int>(words.size()), words.data(), [&] {
    apply(common);
    precompute::configure_solvers(solvers);
    if (precompute::rank_count() > 1) log::info(fmt::format("{} ranks", precompute::rank_count()));
    if (bundle_command_line->parsed()) bundle_command(options);
    if (check_command->parsed()) check(check_options);
    if (mesh_command_line->parsed()) mesh_command(mesh_options);
    if (full_space_command_line->parsed()) full_space_command(full_space_options);
    if (study_command_line->parsed())
      study_options.scene.empty() ? study_command(study_options) : stability_command(study_options);
  });
}

}  // namespace

int main(int argc, char** argv) {
  return precompute::run_on_ranks([&] { return run({argv, argv + argc}); });
}

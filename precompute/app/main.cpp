#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fmt/format.h>
#include <unistd.h>

#include "common/config/config.h"
#include "common/console/console.h"
#include "common/core/command_files.h"
#include "common/core/log.h"
#include "common/core/version.h"
#include "common/hdf5/library_versions.h"
#include "precompute/app/asset_input.h"
#include "precompute/app/bundle_command.h"
#include "precompute/app/full_space_command.h"
#include "precompute/app/mesh_command.h"
#include "precompute/app/new_command.h"
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

/// A number that a refused pose does not have is a line.
std::string number_or_line(double number, int digits) {
  return std::isfinite(number) ? fmt::format("{:.{}f}", number, digits) : "-";
}

void print_alignments(const std::vector<precompute::AlignmentOutcome>& outcomes) {
  fmt::print("\n{:<20}{:<20}{:>12}{:>14}{:>14}{:>12}{:>16}  {}\n", "example", "method", "doubt", "residual [%]",
             "inverted [%]", "competing", "lost by m [%]", "alignment");
  for (const auto& outcome : outcomes)
    fmt::print("{:<20}{:<20}{:>12}{:>14}{:>14}{:>12}{:>16}  {}\n", outcome.name, outcome.method,
               number_or_line(outcome.doubt, 3), number_or_line(100 * outcome.residual, 2),
               number_or_line(100 * outcome.inverted_fraction, 2), outcome.competing_maps,
               number_or_line(100 * outcome.shape_space_error, 2), precompute::name_of(outcome.verdict));
}

void check(const CheckOptions& options) {
  precompute::BuildReport report;
  if (!options.alignment_report.empty()) claim_folder(options.alignment_report, "--alignment-report");
  const AssetConfig asset = asset_from(options.asset);
  if (!options.alignment_report.empty()) precompute::claim_alignment_report(asset, options.alignment_report);
  const auto outcomes = precompute::check_inputs(asset, options.alignment_report, report);
  if (!outcomes.empty()) print_alignments(outcomes);
  precompute::require_aligned(asset, outcomes, report.warnings);
  fmt::print("{}: sound, {} files read\n", options.asset, report.inputs.size());
}

constexpr const char* kAssetText =
    "asset file (JSON), or a surface (.glb, .gltf, .obj, .ply, .stl) that an asset is assumed for";

void add_alignment_report(CLI::App& command, std::string& folder) {
  command.add_option("--alignment-report", folder,
                     "folder to write each transferred pose beside its example into (.vtk), and a page with pictures");
}

CLI::App& add_bundle(CLI::App& app, BundleOptions& options) {
  CLI::App& command = *app.add_subcommand("bundle", "compute the offline stage and write a bundle");
  command.add_option("ASSET", options.asset, kAssetText)->required();
  command.add_option("-o,--output", options.bundle, "bundle to write (HDF5)")->required();
  command.add_option("--scene", options.scene, "write only what this scene needs");
  command.add_option("--write-asset", options.write_asset,
                     "file to write the asset that a surface stands for into (JSON)");
  command.add_option("--depfile", options.depfile, "file to list what was read in, for Make and Ninja");
  command.add_option("--report", options.report,
                     "file to write stages, times, errors, warnings and hashes into, also of a failure (JSON)");
  command.add_option("--cache", options.cache,
                     "folder to keep stages in, so that only what depends on a change is computed again");
  command
      .add_option("--training-budget", options.training_budget,
                  "seconds after which no run of training begins; the bundle then depends on the machine's speed")
      ->check(positive_number());
  command.add_flag("--if-changed", options.if_changed,
                   "do nothing where the bundle was made of the same inputs by this version");
  add_alignment_report(command, options.alignment_report);
  return command;
}

CLI::App& add_check(CLI::App& app, CheckOptions& options) {
  CLI::App& command =
      *app.add_subcommand("check", "read and check the inputs and align the examples, compute nothing else");
  command.add_option("ASSET", options.asset, kAssetText)->required();
  add_alignment_report(command, options.alignment_report);
  return command;
}

CLI::App& add_mesh(CLI::App& app, MeshCommandOptions& options) {
  CLI::App& command = *app.add_subcommand("mesh", "fill a surface with tets, write these and what they are like");
  command.add_option("SURFACE", options.surface, "surface (.glb, .gltf, .obj, .ply, .stl)")->required();
  command.add_option("-o,--output", options.mesh, "mesh to write (Gmsh .msh)")->required();
  auto* cells = command.add_option("--cells", options.settings.cells, "about so many tets")
                    ->check(whole_number_between(50, 2000000));
  command.add_option("--cell-size", options.settings.cell_size, "radius of the sphere about a tet, at most [m]")
      ->check(positive_number())
      ->excludes(cells);
  return command;
}

CLI::App& add_new(CLI::App& app, NewCommandOptions& options) {
  CLI::App& command =
      *app.add_subcommand("new", "write an asset and a scene to begin with for a surface and its poses");
  command.add_option("SURFACE", options.surface, "surface with its poses as morph targets (.glb, .gltf), or without")
      ->required();
  command.add_option("-o,--output", options.folder, "folder to write into; absent: one of the surface's name");
  return command;
}

CLI::App& add_study(CLI::App& app, StudyCommandOptions& options) {
  CLI::App& command = *app.add_subcommand(
      "study", "measure a scene's error against run time over sweeps of settings, by the full space");
  auto* subject = command.add_option_group("subject", "what to measure");
  subject->require_option(1);
  subject->add_option("STUDY", options.study, "study file (JSON)");
  subject->add_option(
      "--stability", options.scene,
      "scene file (JSON) to run with other time steps, loads, speeds, stiffnesses and starts: how far each "
      "is safe; status 1 if the scene fails as it is");
  command
      .add_option(
          "-o,--output", options.folder,
          "folder for report.html, results.csv, results.json and what a resumed study needs; with --stability for "
          "stability.html, .md, .csv and .json")
      ->required();
  command
      .add_option("--budget-us", options.budget_us, "recommend the most accurate point of at most so many us a step")
      ->check(positive_number());
  command
      .add_option(
          "--max-error", options.max_error,
          "recommend the fastest point of at most so many percent of error: of shape of a free body, else of position")
      ->check(positive_number());
  command
      .add_option("--jobs", options.jobs,
                  "processes that run points; times are measured by one. With --stability runs at a time")
      ->check(whole_number_between(1, 256))
      ->capture_default_str();
  return command;
}

CLI::App& add_full_space(CLI::App& app, FullSpaceCommandOptions& options) {
  CLI::App& command = *app.add_subcommand(
      "full-space", "step a scene with all degrees of freedom of its mesh, without a basis, and write the trajectory");
  command.add_option("SCENE", options.scene, "scene file (JSON), with its bundle")->required();
  command.add_option("-o,--output", options.trajectory, "trajectory to write (HDF5), and an .xdmf beside it")
      ->required();
  const CLI::Validator count_range = whole_number_between(1, 1'000'000'000'000);
  command.add_option("--steps", options.steps, "so many steps instead of the scene's")->check(count_range);
  command.add_option("--every", options.every, "write a frame every so many steps instead of the scene's")
      ->check(count_range);
  return command;
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

  BundleOptions bundle_options;
  CheckOptions check_options;
  MeshCommandOptions mesh_options;
  NewCommandOptions new_options;
  StudyCommandOptions study_options;
  FullSpaceCommandOptions full_space_options;
  const CLI::App &bundle = add_bundle(app, bundle_options), &asset_check = add_check(app, check_options),
                 &mesh = add_mesh(app, mesh_options), &begin = add_new(app, new_options),
                 &study = add_study(app, study_options), &full_space = add_full_space(app, full_space_options);
  return run_program(app, static_cast<int>(words.size()), words.data(), [&] {
    apply(common);
    check_solver_options(solvers);
    precompute::configure_solvers(solvers);
    if (precompute::rank_count() > 1) log::info(fmt::format("{} ranks", precompute::rank_count()));
    if (bundle.parsed()) bundle_command(bundle_options);
    if (asset_check.parsed()) check(check_options);
    if (mesh.parsed()) mesh_command(mesh_options);
    if (begin.parsed()) new_command(new_options);
    if (full_space.parsed()) full_space_command(full_space_options);
    if (study.parsed()) study_options.scene.empty() ? study_command(study_options) : stability_command(study_options);
  });
}

/// Threads of OpenMP that wait take the processor from those that work, where a machine has other things to do. OpenMP
/// reads how they are to wait before main() begins, so the program is started once more, unless its user has said it.
void wait_passively(char** argv) {
  if (std::getenv("OMP_WAIT_POLICY") != nullptr || std::getenv("GOMP_SPINCOUNT") != nullptr) return;
  setenv("OMP_WAIT_POLICY", "passive", 1);
  setenv("GOMP_SPINCOUNT", "400", 1);  // pauses of a processor: 20 us at most
  execv("/proc/self/exe", argv);       // returns where there is none: then they spin
}

}  // namespace

int main(int argc, char** argv) {
  wait_passively(argv);
  const int status = precompute::run_on_ranks([&] { return run({argv, argv + argc}); });
  if (status == static_cast<int>(ExitStatus::kDone) || precompute::rank_count() > 1) return status;
  std::fflush(nullptr);
  std::_Exit(status);  // at exit libraries wait for threads that they could not make, where memory ran out
}

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fmt/format.h>
#include <optional>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/console/console.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/timer.h"
#include "common/core/version.h"
#include "precompute/pipeline/build_model.h"
#include "precompute/solvers/semidefinite_solver.h"
#include "precompute/study/stability_report.h"

namespace {

using namespace exmat;

struct Options {
  CommonOptions common;
  std::string asset;
  std::string bundle;
  std::string scene;
  std::string alignment_report;
  std::string study_folder;
  bool stability = false, quick = false;
  int jobs = 0;
};

void print_stages(const precompute::BuildReport& report) {
  double total = 0;
  fmt::print("\n{:<28}{:>10}\n", "stage", "seconds");
  for (const auto& stage : report.stages) {
    fmt::print("{:<28}{:>10.3f}\n", stage.stage, stage.seconds);
    total += stage.seconds;
  }
  fmt::print("{:<28}{:>10.3f}\n", "total", total);
}

void print_ledger(const std::vector<LedgerEntry>& ledger) {
  fmt::print("\n{:<14}{:>12}  {:<5}{}\n", "group", "bytes", "in", "why");
  for (const auto& entry : ledger)
    fmt::print("{:<14}{:>12}  {:<5}{}\n", entry.group, entry.bytes, entry.included ? "yes" : "no", entry.reason);
}

void print_examples(const std::string& title, const ExampleSet& set) {
  fmt::print("\n{:<20}{:>14}{:>12}{:>16}{:>14}\n", title, "method", "confidence", "lost by m [%]", "by basis [%]");
  for (const auto& example : set.examples)
    fmt::print("{:<20}{:>14.13}{:>12.3f}{:>16.2f}{:>14.2f}\n", example.name, example.method, example.confidence,
               100 * example.shape_space_error, 100 * example.basis_error);
}

void bundle(const Options& options) {
  const AssetConfig asset = load_asset(options.asset);
  std::optional<Needs> scene_needs;
  if (!options.scene.empty()) scene_needs = needs_of(load_scene(options.scene));
  { const AtomicFile writable(options.bundle); }  // better refused now than after the work
  precompute::BuildReport report;
  const ReducedModel model =
      precompute::build_model(asset, precompute::resolve_needs(asset, scene_needs), report, options.alignment_report);
  const Timer timer;
  write_bundle(model, options.bundle);
  report.stages.push_back({"writing the bundle", timer.seconds()});
  fill_bytes(model, report.ledger);

  fmt::print("{}: {} vertices, {} tets, {} body, r = {}, s = {}", options.bundle, model.object->mesh.vertex_count(),
             model.object->mesh.tet_count(), model.object->fixed.any() ? "constrained" : "free",
             model.modal->basis.cols(), model.cubature->elements.size());
  if (model.shape_space) fmt::print(", m = {}", model.shape_space->eigenvalues.size());
  fmt::print(", {} bytes\n", std::filesystem::file_size(options.bundle));
  fmt::print(
      "frequencies {:.4g} to {:.4g} Hz; held-out cubature error: force {:.2f} %, energy {:.2f} %, stiffness {:.2f} %\n",
      model.modal->frequencies.minCoeff(), model.modal->frequencies.maxCoeff(), 100 * model.cubature->heldout_error,
      100 * model.cubature->heldout_energy_error, 100 * model.cubature->heldout_stiffness_error);
  if (model.examples) print_examples("example", *model.examples);
  for (const RegionData& region : model.regions) print_examples("region " + region.name, region.examples);
  print_ledger(report.ledger);
  print_stages(report);
}

void print_alignments(const std::vector<precompute::AlignmentOutcome>& outcomes) {
  fmt::print("\n{:<20}{:<20}{:>12}{:>14}{:>14}{:>12}{:>16}  {}\n", "example", "method", "confidence", "residual [%]",
             "inverted [%]", "competing", "lost by m [%]", "alignment");
  for (const auto& outcome : outcomes)
    fmt::print("{:<20}{:<20}{:>12.3f}{:>14.2f}{:>14.2f}{:>12}{:>16.2f}  {}\n", outcome.name, outcome.method,
               outcome.confidence, 100 * outcome.residual, 100 * outcome.inverted_fraction, outcome.competing_maps,
               100 * outcome.shape_space_error, precompute::name_of(outcome.verdict));
}

void check(const Options& options) {
  precompute::BuildReport report;
  const AssetConfig asset = load_asset(options.asset);
  const auto outcomes = precompute::check_inputs(asset, options.alignment_report, report);
  if (!outcomes.empty()) print_alignments(outcomes);
  precompute::require_aligned(asset, outcomes, report.warnings);
  fmt::print("{}: sound, {} files read\n", options.asset, report.inputs.size());
}

void stability(const Options& options) {
  CommonOptions quiet = options.common;  // hundreds of small bodies go through the stages
  if (quiet.log_level != "debug") quiet.log_level = "error";
  apply(quiet);
  precompute::write_stability_report({}, options.study_folder);  // better refused now than after the work
  const auto runs =
      options.quick
          ? precompute::run_stability(precompute::short_stability_suite(), {precompute::kShortSteps, options.jobs})
          : precompute::run_stability(precompute::long_stability_suite(), {precompute::kLongSteps, options.jobs});
  precompute::write_stability_report(runs, options.study_folder);
  fmt::print("{}", precompute::stability_markdown(runs));
  const auto failed = precompute::runs_with(runs, precompute::Verdict::kFail).size();
  if (failed > 0)
    throw WorkError(fmt::format("{} of {} runs of the stability suite failed; see {}/stability.html", failed,
                                runs.size(), options.study_folder));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Turns an object and its example poses into a bundle for exmat-runtime.", "exmat-precompute"};
  app.set_version_flag("--version",
                       [] { return fmt::format("exmat-precompute {}, {}", version(), precompute::solver_versions()); });
  app.require_subcommand(1);
  Options options;
  add_common_options(app, options.common);

  auto* bundle_command = app.add_subcommand("bundle", "compute the offline stage and write a bundle");
  bundle_command->add_option("ASSET", options.asset, "asset file (JSON)")->required();
  bundle_command->add_option("-o,--output", options.bundle, "bundle to write (HDF5)")->required();
  bundle_command->add_option("--scene", options.scene, "write only what this scene needs");

  auto* check_command =
      app.add_subcommand("check", "read and check the inputs and align the examples, compute nothing else");
  check_command->add_option("ASSET", options.asset, "asset file (JSON)")->required();
  for (auto* command : {bundle_command, check_command})
    command->add_option("--alignment-report", options.alignment_report,
                        "folder to write each transferred pose beside its example into (.vtk and .svg)");

  auto* study_command = app.add_subcommand("study", "run a study of the step and write its report");
  study_command
      ->add_flag("--stability", options.stability,
                 "thousands of runs at the ends of every range: stiffness, loads, starts, spin, contact, examples; "
                 "status 1 if one fails that is no known limit")
      ->required();
  study_command->add_flag("--quick", options.quick, "with --stability: the part of the suite that the tests run");
  study_command->add_option("--jobs", options.jobs, "runs at a time; 0: as many as --threads")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str();
  study_command
      ->add_option("-o,--output", options.study_folder,
                   "folder for stability.html, .md, .csv and .json; made if missing")
      ->required();

  return run_program(app, argc, argv, [&] {
    apply(options.common);
    if (bundle_command->parsed()) bundle(options);
    if (check_command->parsed()) check(options);
    if (study_command->parsed()) stability(options);
  });
}

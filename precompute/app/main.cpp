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
#include "common/mesh/geometry.h"
#include "precompute/pipeline/build_model.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace {

using namespace exmat;

struct Options {
  CommonOptions common;
  std::string asset;
  std::string bundle;
  std::string scene;
  std::string alignment_report;
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

void print_render_mesh(const ReducedModel& model) {
  const RenderData& render = *model.render;
  fmt::print("render mesh: {} vertices, {} triangles; {} vertices outside the object", render.vertices.rows(),
             render.triangles.rows(), render.outside);
  if (render.outside > 0)
    fmt::print(", by up to {:.3g} m ({:.3g} % of the diagonal of its bounding box)", render.farthest,
               100 * render.farthest / bounding_box_diagonal(model.object->mesh.vertices));
  fmt::print("\n");
}

// What the scene asks of the bundle; nothing without a scene.
std::optional<Needs> scene_needs(const Options& options, const AssetConfig& asset) {
  if (options.scene.empty()) return std::nullopt;
  const Needs needs = needs_of(load_scene(options.scene));
  if (needs.render && !asset.render_mesh)
    throw InputError({options.asset, "/object/render_mesh", "a surface, for output.render of the scene", "none",
                      "name one here or leave output.render out of the scene"});
  return needs;
}

void bundle(const Options& options) {
  const AssetConfig asset = load_asset(options.asset);
  const Needs needs = precompute::resolve_needs(asset, scene_needs(options, asset));
  { const AtomicFile writable(options.bundle); }  // better refused now than after the work
  precompute::BuildReport report;
  const ReducedModel model = precompute::build_model(asset, needs, report, options.alignment_report);
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
  if (model.render) print_render_mesh(model);
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

  return run_program(app, argc, argv, [&] {
    apply(options.common);
    if (bundle_command->parsed()) bundle(options);
    if (check_command->parsed()) check(options);
  });
}

#include "precompute/app/bundle_command.h"

#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <optional>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/bundle/file_schemas.h"
#include "common/config/config.h"
#include "common/config/json_file.h"
#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/hdf5/hdf5_file.h"
#include "common/mesh/geometry.h"
#include "precompute/app/asset_input.h"
#include "precompute/examples/alignment_report.h"
#include "precompute/pipeline/build_reduced_model.h"
#include "precompute/pipeline/depfile.h"
#include "precompute/pipeline/run_report.h"

namespace exmat {
namespace {

using precompute::BuildReport;
using precompute::RunReport;

void print_stages(const BuildReport& report) {
  double total = 0;
  fmt::print("\n{:<28}{:>10}{:>18}\n", "stage", "seconds", "peak memory [MB]");
  for (const auto& stage : report.stages) {
    fmt::print("{:<28}{:>10.3f}{:>18.1f}\n", stage.stage, stage.seconds,
               1e-6 * static_cast<double>(stage.peak_memory_bytes));
    total += stage.seconds;
  }
  fmt::print("{:<28}{:>10.3f}\n", "total", total);
}

void print_ledger(const std::vector<LedgerEntry>& ledger) {
  fmt::print("\n{:<18}{:>12}  {:<5}{}\n", "group", "bytes", "in", "why");
  for (const auto& entry : ledger)
    fmt::print("{:<18}{:>12}  {:<5}{}\n", entry.group, entry.bytes, entry.included ? "yes" : "no", entry.reason);
}

void print_examples(const std::string& title, const ExampleSet& set) {
  fmt::print("\n{:<20}{:<18}{:>8}{:>16}{:>14}{:>14}{:>14}\n", title, "method", "doubt", "lost by m [%]", "by basis [%]",
             "at best [%]", "settled [%]");
  for (const auto& example : set.examples)
    fmt::print("{:<20}{:<18}{:>8.3f}{:>16.2f}{:>14.2f}{:>14.2f}{:>14.2f}\n", example.name, example.method,
               example.doubt, 100 * example.shape_space_error, 100 * example.basis_error, 100 * example.best_error,
               100 * example.settled_error);
  for (const auto& example : set.examples)
    if (example.surface_iterations > 0)
      fmt::print("{}: its surface is missed by {:.3g} % of the diagonal (RMS), {:.3g} % at most\n", example.name,
                 100 * example.surface_rms, 100 * example.surface_farthest);
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

void print_model(const std::string& bundle, const ReducedModel& model) {
  fmt::print("{}: {} vertices, {} tets, {} body, r = {}, s = {}", bundle, model.object->mesh.vertex_count(),
             model.object->mesh.tet_count(), model.object->fixed.any() ? "constrained" : "free",
             model.modal->basis.cols(), model.cubature->elements.size());
  if (model.shape_space) fmt::print(", m = {}", model.shape_space->eigenvalues.size());
  fmt::print(", {} bytes\n", std::filesystem::file_size(bundle));
  fmt::print(
      "frequencies {:.4g} to {:.4g} Hz; held-out cubature error: force {:.2f} %, energy {:.2f} %, stiffness {:.2f} %\n",
      model.modal->frequencies.minCoeff(), model.modal->frequencies.maxCoeff(), 100 * model.cubature->heldout_error,
      100 * model.cubature->heldout_energy_error, 100 * model.cubature->heldout_stiffness_error);
  if (model.fidelity)
    fmt::print(
        "fidelity: {:.2f} % from the full space under {}, {:.2f} % with all elements, {:.2f} % of modes alone; {}\n",
        100 * model.fidelity->shape_error, model.fidelity->loads, 100 * model.fidelity->all_elements_error,
        100 * model.fidelity->modal_error, model.fidelity->advice);
  if (model.render) print_render_mesh(model);
  if (model.examples) print_examples("example", *model.examples);
  for (const RegionData& region : model.regions) print_examples("region " + region.name, region.examples);
}

// The scene's needs of the bundle; nothing without a scene.
std::optional<Needs> scene_needs(const BundleOptions& options, const std::optional<SceneConfig>& scene,
                                 const AssetConfig& asset) {
  if (!scene) return std::nullopt;
  const Needs needs = needs_of(*scene);
  if (needs.render && !asset.render_mesh)
    throw InputError({options.asset, "/object/render_mesh", "a surface, for output.render of the scene", "none",
                      "name one here or leave output.render out of the scene"});
  return needs;
}

// True if the bundle is there and was computed from these inputs, by this version.
bool is_up_to_date(const BundleOptions& options, const AssetConfig& asset, const Needs& needs,
                   const precompute::BuildOptions& build, BuildReport& report) {
  if (!std::filesystem::exists(options.bundle)) return false;
  precompute::read_inputs(asset, needs, report, build);
  try {
    const OwnOutputRead own;
    return summarise_bundle(options.bundle).input_sha256 == report.input_sha256;
  } catch (const InputError& error) {
    log::warning(fmt::format("computing the bundle again: {}", error.what()));
    return false;
  }
}

void write_depfile(const BundleOptions& options, const BuildReport& report) {
  if (options.depfile.empty()) return;
  precompute::InputFiles files = report.inputs;
  if (!options.scene.empty()) files.emplace_back(options.scene);
  write_file_atomically(options.depfile, precompute::depfile_text(options.bundle, files));
}

void check_writable(const std::string& file) {
  if (file.empty()) return;
  const AtomicFile writable(file);
}

/// Refuses outputs that are one file: no report of that is written, for it may be of that name.
void claim_outputs(const BundleOptions& options) {
  claim_output(options.bundle, "-o");
  if (!options.depfile.empty()) claim_output(options.depfile, "--depfile");
  if (!options.write_asset.empty()) claim_output(options.write_asset, "--write-asset");
  if (!options.report.empty()) claim_output(options.report, "--report");
  if (!options.cache.empty()) claim_folder(options.cache, "--cache");
  if (!options.alignment_report.empty()) claim_folder(options.alignment_report, "--alignment-report");
}

/// Refuses now what would fail, or destroy an input, after the work.
void check_files(const BundleOptions& options) {
  check_input(options.asset, "an asset file or a surface");
  if (!options.scene.empty()) check_input(options.scene, "a scene file");
  for (const std::string& file : {options.bundle, options.depfile, options.write_asset}) check_writable(file);
  if (!options.depfile.empty()) precompute::depfile_text(options.bundle, {options.asset, options.scene});
}

/// Claims what depends on the asset, and names inputs that are read late, or by another scene.
void claim_outputs(const BundleOptions& options, const AssetConfig& asset, const std::optional<SceneConfig>& scene) {
  if (!options.alignment_report.empty()) precompute::claim_alignment_report(asset, options.alignment_report);
  require_files(asset);
  for (const NamedFile& named : named_files(asset)) check_input(named.file, named.kind);
  if (!scene) return;
  require_obstacle_files(*scene);
  for (const NamedFile& named : obstacle_files(*scene)) check_input(named.file, named.kind);
}

/// Refuses to replace what is no earlier output of its kind, once all inputs are known.
void require_kinds(const BundleOptions& options) {
  require_format(options.bundle, "-o", "a bundle", bundle_schema());
  if (!options.report.empty())
    require_kind(options.report, "--report", "a report", "{\n  \"format\": \"exmat-report\"");
  if (options.depfile.empty()) return;
  std::ifstream stream(options.depfile);
  std::string line;
  if (std::getline(stream, line) && !line.ends_with(':') && !line.ends_with(": \\"))
    refuse_to_replace(options.depfile, "--depfile", "a depfile", "another kind of file");
}

/// Sets `model` where it makes one.
void make_bundle(const BundleOptions& options, RunReport& report, std::optional<ReducedModel>& model) {
  check_files(options);
  std::optional<SceneConfig> scene;
  if (!options.scene.empty()) scene = load_scene(options.scene);
  const SceneConfig* const loads = scene ? &*scene : nullptr;
  const AssetConfig asset = asset_from(options.asset, options.write_asset, loads);
  claim_outputs(options, asset, scene);
  require_kinds(options);
  if (!options.write_asset.empty()) write_assumed_asset(options.asset, options.write_asset, loads);
  const Needs needs = precompute::resolve_needs(asset, scene_needs(options, scene, asset));
  const precompute::BuildOptions build{options.alignment_report, options.cache, loads, options.training_budget};
  if (options.if_changed && is_up_to_date(options, asset, needs, build, report.build)) {
    log::info(fmt::format("{}: its inputs have not changed, nothing to do", options.bundle));
    write_depfile(options, report.build);
    report.status = "unchanged";
    return;
  }
  report.build = {};
  model = precompute::build_reduced_model(asset, needs, report.build, build);
  precompute::timed_stage("writing the bundle", report.build, [&] { write_bundle(*model, options.bundle); });
  fill_bytes(*model, report.build.ledger);
  write_depfile(options, report.build);
  report.status = "done";
  print_model(options.bundle, *model);
  print_ledger(report.build.ledger);
  print_stages(report.build);
}

/// Notes the warnings of the log while it lives.
class WarningRecorder {
 public:
  explicit WarningRecorder(std::vector<std::string>& warnings) {
    log::set_sink([former = former_ = log::set_sink({}), &warnings](log::Level level, std::string_view message) {
      if (level == log::Level::kWarning) warnings.emplace_back(message);
      if (former) former(level, message);
    });
  }
  ~WarningRecorder() { log::set_sink(std::move(former_)); }
  WarningRecorder(const WarningRecorder&) = delete;
  WarningRecorder& operator=(const WarningRecorder&) = delete;

 private:
  log::Sink former_;
};

void save(const BundleOptions& options, const RunReport& report, const std::optional<ReducedModel>& model) {
  write_file_atomically(
      options.report,
      to_json(report, model ? &*model : nullptr).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
          "\n");
}

/// True where nothing but a report of an earlier run is replaced. A run that failed may not have read all its inputs
/// yet: another file of that name could be one of them.
bool replaces_report_alone(const std::string& report) {
  if (!std::filesystem::exists(report)) return true;
  try {
    const OwnOutputRead own;
    check_against_schema(read_json(report), "report", report);
  } catch (const InputError&) {
    return false;
  }
  return true;
}

// The failure itself is what the program ends with, even where its report cannot be written.
void save_failure(const BundleOptions& options, RunReport& report, const std::exception& failure,
                  const std::optional<ReducedModel>& model) {
  report.status = "failed";
  report.message = failure.what();
  report.exit_status = static_cast<int>(dynamic_cast<const InputError*>(&failure) != nullptr ? ExitStatus::kBadInput
                                                                                             : ExitStatus::kFailure);
  try {
    if (!replaces_report_alone(options.report))
      throw WorkError(fmt::format("the report is not written: {} is no report of this version", options.report));
    save(options, report, model);
  } catch (const std::exception& error) {
    log::error(error.what());
  }
}

}  // namespace

void bundle_command(const BundleOptions& options) {
  RunReport report{.asset = options.asset, .bundle = options.bundle};
  std::optional<ReducedModel> model;
  claim_outputs(options);
  if (options.report.empty()) return make_bundle(options, report, model);
  check_writable(options.report);
  const WarningRecorder recorder(report.warnings);
  try {
    make_bundle(options, report, model);
  } catch (const std::exception& error) {
    save_failure(options, report, error, model);
    throw;
  }
  save(options, report, model);
}

}  // namespace exmat

#include <fmt/format.h>

#include "common/bundle/bundle.h"
#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "common/hdf5/schema.h"
#include "runtime/app/commands.h"

namespace exmat::runtime {
namespace {

void print_groups(const ReducedModel& model, const BundleSummary& summary) {
  std::vector<LedgerEntry> ledger = plan_groups({}, summary.constrained, summary.examples, std::ssize(summary.regions),
                                                summary.render_vertices > 0, summary.bones > 0);
  fill_bytes(model, ledger);
  fmt::print("\n{:<18} {:>14}\n", "group", "bytes");
  for (const LedgerEntry& entry : ledger)
    if (entry.bytes > 0) fmt::print("{:<18} {:>14}\n", entry.group, entry.bytes);
}

void print_examples(const ExampleSet& set) {
  fmt::print("\n{:<20} {:<20} {:>10} {:>12} {:>14} {:>12} {:>14}\n", "example", "mapped by", "residual", "doubt",
             "shape error", "basis error", "settled error");
  for (const ExampleData& example : set.examples)
    fmt::print("{:<20} {:<20} {:>10.3g} {:>12.3g} {:>14.3g} {:>12.3g} {:>14.3g}\n", example.name, example.method,
               example.alignment_residual, example.doubt, example.shape_space_error, example.basis_error,
               example.settled_error);
}

}  // namespace

void info_command(const std::filesystem::path& bundle) {
  const BundleSummary summary = summarise_bundle(bundle);
  const ReducedModel model = read_bundle(bundle);
  fmt::print("asset          {}\ngenerator      {}\nformat version {}\ninput sha256   {}\nbody           {}\n",
             summary.asset_name, summary.generator, bundle_schema().format_version, summary.input_sha256,
             summary.constrained ? "constrained" : "free");
  fmt::print("mesh           {} vertices, {} tets\n", summary.vertices, summary.tets);
  fmt::print("modes          {}\n", summary.modes);
  fmt::print("cubature       {} elements\n", summary.cubature_elements);
  if (model.skeleton && model.skeleton->shifts.rows() > 0)
    fmt::print("clamp          follows the examples, by their weights\n");
  if (model.object) fmt::print("material       {}\n", name_of(model.object->materials.model));
  if (model.object && model.object->stiffness_ratio > 0)
    fmt::print("elements       {}, {:.2f} times as stiff as the material, {:.2f} at worst; {:.0f} % one tet thick\n",
               name_of(model.object->materials.formulation), model.object->stiffness_ratio,
               model.object->worst_stiffness, 100 * model.object->thin_share);
  if (model.modal && model.modal->frequencies.size() > 0)
    fmt::print("frequencies    {:.4g} to {:.4g} Hz ({} linear modes)\n", model.modal->frequencies.minCoeff(),
               model.modal->frequencies.maxCoeff(), model.modal->frequencies.size());
  if (model.cubature)
    fmt::print("held-out error force {:.3g}, energy {:.3g}, stiffness {:.3g}\n", model.cubature->heldout_error,
               model.cubature->heldout_energy_error, model.cubature->heldout_stiffness_error);
  if (model.fidelity)
    fmt::print(
        "fidelity       {:.2g} % from {} under {} ({} runs), {:.2g} % at the end of the runs, {:.2g} % of modes alone; "
        "basis {}; {}\n",
        100 * model.fidelity->shape_error,
        model.fidelity->reference == "modes" ? "a body of many modes" : "the full space", model.fidelity->loads,
        model.fidelity->heldout_runs, 100 * model.fidelity->settled_error, 100 * model.fidelity->modal_error,
        model.fidelity->basis, model.fidelity->advice);
  if (model.render)
    fmt::print("render mesh    {} vertices, {} triangles; {} outside the body, by up to {:.3g} m\n",
               model.render->vertices.rows(), model.render->triangles.rows(), model.render->outside,
               model.render->farthest);
  if (summary.eigenfunctions > 0) fmt::print("eigenfunctions {}\n", summary.eigenfunctions);
  print_groups(model, summary);
  if (model.examples) print_examples(*model.examples);
  for (const RegionData& region : model.regions) {
    fmt::print("\nregion {}: {} vertices, {}", region.name, region.vertices.size(),
               region.targets ? "with a table of targets" : "no table of targets");
    print_examples(region.examples);
  }
}

void validate_command(const std::filesystem::path& bundle) {
  const std::vector<std::string> problems = validate_bundle(bundle);
  for (const std::string& problem : problems) fmt::print("{}\n", problem);
  if (!problems.empty())
    throw InputError({bundle.string(), "", "a sound bundle", fmt::format("{} problem(s)", problems.size()),
                      "compute it again with exmat-precompute, or make the pack of it again"});
  fmt::print("{}: sound\n", bundle.string());
}

}  // namespace exmat::runtime

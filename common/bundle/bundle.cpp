#include "common/bundle/bundle.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/bundle/bundle_reader.h"
#include "common/bundle/file_schemas.h"
#include "common/core/error.h"

namespace exmat {
namespace {

std::int64_t value_of(const SymbolSizes& sizes, std::string_view symbol) {
  const auto* binding = sizes.find(symbol);
  return binding == nullptr ? 0 : binding->value;
}

// Binds all sizes from the table of contents.
void open_listed(BundleReader& reader, const std::vector<LedgerEntry>& groups) {
  for (const DatasetSchema& schema : bundle_schema().datasets)
    if (includes(groups, schema.group) && is_single(schema.path)) reader.open_checked(schema, schema.path);
}

RegionSummary summarise_region(BundleReader& reader, const std::string& name) {
  RegionSummary summary{name};
  const std::string path = "/regions/" + name;
  summary.examples = std::ssize(reader.example_names(path + "/examples"));
  summary.has_targets = reader.file().has_group(path + "/targets");
  summary.has_target_space = reader.file().has_group(path + "/target_space");
  if (summary.has_targets)
    reader.read_attribute("/regions/{region}/targets", path + "/targets", "energy_reference", summary.energy_reference);
  return summary;
}

bool serves(bool has_targets, EnergyReference table, EnergyReference wanted) { return has_targets && table == wanted; }

}  // namespace

BundleSummary summarise_bundle(const BundleInput& input) {
  BundleReader reader(input);
  const auto groups = reader.listed_groups();
  open_listed(reader, groups);
  BundleSummary summary;
  summary.asset_name = reader.text_attribute("asset_name");
  summary.generator = reader.text_attribute("generator");
  summary.input_sha256 = reader.text_attribute("input_sha256");
  summary.is_pack = !reader.file().describes_itself();
  summary.constrained = reader.constrained();
  for (const LedgerEntry& entry : groups)
    if (entry.included) summary.groups.push_back(entry.group);
  const SymbolSizes& sizes = reader.sizes();
  summary.vertices = value_of(sizes, "n");
  summary.tets = value_of(sizes, "n_t");
  summary.modes = value_of(sizes, "r");
  summary.cubature_elements = value_of(sizes, "s");
  summary.eigenfunctions = value_of(sizes, "m");
  summary.examples = value_of(sizes, "K");
  summary.has_polynomial = includes(groups, "polynomial");
  summary.has_targets = includes(groups, "targets");
  summary.has_target_space = includes(groups, "target_space");
  summary.internal_force = CubatureData{}.internal_force;
  if (includes(groups, "cubature"))
    reader.read_attribute("/cubature", "/cubature", "internal_force", summary.internal_force);
  if (includes(groups, "fidelity")) {
    std::string loads;
    reader.read_attribute("/fidelity", "/fidelity", "loads", loads);
    summary.knows_scene = loads == kLoadsOfScene;
  }
  if (summary.has_targets) reader.read_attribute("/targets", "/targets", "energy_reference", summary.energy_reference);
  summary.render_vertices = value_of(sizes, "v");
  summary.bones = value_of(sizes, "b");
  if (includes(groups, "regions"))
    for (const std::string& name : reader.region_names()) summary.regions.push_back(summarise_region(reader, name));
  return summary;
}

Needs fit_needs(Needs needs, const BundleSummary& summary) {
  if (needs.internal_force == ForceMethod::kAuto) needs.internal_force = summary.internal_force;
  needs.targets = needs.targets && serves(summary.has_targets, summary.energy_reference, needs.energy_reference);
  needs.target_space = needs.target_space && !needs.targets && summary.has_target_space;
  if (!needs.regions) return needs;
  for (RegionNeeds& region : *needs.regions) {
    const auto found = std::ranges::find(summary.regions, region.name, &RegionSummary::name);
    region.targets = region.targets && found != summary.regions.end() &&
                     serves(found->has_targets, found->energy_reference, region.energy_reference);
    region.target_space =
        region.target_space && !region.targets && found != summary.regions.end() && found->has_target_space;
  }
  return needs;
}

ReducedModel read_bundle(const BundleInput& input, const BundleRequest& request, std::vector<ReadRecord>* record) {
  return BundleReader(input, record).read(request);
}

ReducedModel read_bundle(const BundleInput& input) {
  BundleReader reader(input);
  return reader.read({.groups = reader.listed_groups()});
}

RowMatrix read_basis_rows(const BundleInput& input, std::span<const std::int64_t> vertices,
                          std::vector<ReadRecord>* record) {
  BundleReader reader(input, record);
  const DatasetSchema& schema = bundle_schema().dataset("/modal/basis");
  const auto basis = reader.open_checked(schema, schema.path);
  const std::int64_t count = basis->sizes()[0], modes = basis->sizes()[2];
  RowMatrix rows(3 * std::ssize(vertices), modes);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::int64_t vertex = vertices[i];
    if (vertex < 0 || vertex >= count)
      throw InputError({input.file().string(), schema.path, fmt::format("vertex ids from 0 to {}", count - 1),
                        fmt::format("{}", vertex), ""});
    basis->read_rows(vertex, 1, rows.row(3 * static_cast<Eigen::Index>(i)).data(), schema.type);
  }
  if (!rows.allFinite()) throw InputError({input.file().string(), schema.path, "finite numbers", "others", ""});
  reader.note(schema.path, static_cast<std::size_t>(rows.size()) * sizeof(double));
  return rows;
}

}  // namespace exmat

#include <algorithm>
#include <fmt/format.h>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/bundle/pack_store.h"
#include "common/config/config.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "runtime/app/commands.h"
#include "runtime/app/print.h"

namespace exmat::runtime {
namespace {

std::vector<LedgerEntry> groups_for(const Needs& needs, const BundleSummary& summary) {
  return plan_groups(needs, summary.constrained, summary.examples, std::ssize(summary.regions),
                     summary.render_vertices > 0, summary.bones > 0);
}

/// Adds what one more kind of bodies needs.
void add_needs(const Needs& needs, const BundleSummary& summary, BundleRequest& request) {
  const std::vector<LedgerEntry> groups = groups_for(needs, summary);
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (groups[i].included) request.groups[i] = groups[i];
  for (const RegionNeeds& region : *needs.regions) {
    const auto known = std::ranges::find(*request.regions, region.name, &RegionNeeds::name);
    if (known == request.regions->end()) {
      request.regions->push_back(region);
      continue;
    }
    known->targets |= region.targets;
    known->target_space |= region.target_space;
    known->target_elasticity |= region.target_elasticity;
    known->full_space |= region.full_space;
  }
}

BundleRequest request_of(const PackOptions& options, const BundleSummary& summary) {
  BundleRequest request{.groups = groups_for({}, summary)};
  if (!options.scene) {
    for (LedgerEntry& entry : request.groups)
      entry.included = std::ranges::find(summary.groups, entry.group) != summary.groups.end();
    return request;
  }
  for (LedgerEntry& entry : request.groups) entry.included = false;
  request.regions.emplace();
  const WorldConfig world = load_world(*options.scene);
  bool any = false;
  for (const BodiesConfig& bodies : world.bodies) {
    std::error_code ignored;
    if (world.is_list && !std::filesystem::equivalent(bodies.scene.bundle, options.bundle, ignored)) continue;
    add_needs(fit_needs(needs_of(bodies.scene), summary), summary, request);
    any = true;
  }
  if (!any)
    throw InputError({options.scene->string(), "/bodies", "a body of " + options.bundle.string(), "none",
                      "name the bundle that the scene names"});
  return request;
}

std::uintmax_t bytes_of(const std::filesystem::path& file) { return std::filesystem::file_size(file); }

}  // namespace

void pack_command(const PackOptions& options) {
  claim_output(options.output, "-o");
  const BundleSummary summary = summarise_bundle(options.bundle);
  if (summary.is_pack)
    throw InputError({options.bundle.string(), "", "a bundle (HDF5)", "a pack", "pack the bundle that it was made of"});
  const BundleRequest request = request_of(options, summary);
  require_kind(options.output, "-o", "a pack", kPackMagic);
  write_pack(read_bundle(options.bundle, request), options.output);
  print("pack", options.output.string());
  print("bytes", fmt::format("{} of the bundle's {}", bytes_of(options.output), bytes_of(options.bundle)));
  std::string left_out;
  for (const std::string& group : summary.groups)
    if (!includes(request.groups, group)) left_out += (left_out.empty() ? "" : ", ") + group;
  if (!left_out.empty()) print("left out", left_out);
}

}  // namespace exmat::runtime

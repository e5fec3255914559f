#include "precompute/pipeline/asset_needs.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::precompute {

std::optional<RegionNeeds> needs_of_region(const Needs& needs, const std::string& name) {
  if (!needs.regions)
    return RegionNeeds{.name = name,
                       .targets = needs.targets,
                       .energy_reference = needs.energy_reference,
                       .target_elasticity = needs.target_elasticity,
                       .full_space = needs.full_space};
  const auto found = std::ranges::find(*needs.regions, name, &RegionNeeds::name);
  return found == needs.regions->end() ? std::nullopt : std::optional(*found);
}

void require_regions(const AssetConfig& asset, const Needs& needs) {
  for (const RegionNeeds& region : needs.regions.value_or(std::vector<RegionNeeds>{}))
    if (std::ranges::find(asset.regions, region.name, &RegionConfig::name) == asset.regions.end())
      throw InputError({asset.file.string(), "/regions", fmt::format("the region \"{}\" of the scene", region.name),
                        asset.regions.empty() ? "no regions" : "others", "name it here or leave it out of the scene"});
}

void keep_needed(const Needs& needs, bool whole_body, ExampleInput& input) {
  input.whole_body = input.whole_body && whole_body;
  std::erase_if(input.regions, [&](const RegionInput& region) { return !needs_of_region(needs, region.name); });
  std::erase_if(input.poses, [&](const PoseInput& pose) {
    const bool local = std::ranges::any_of(input.regions, [&](const RegionInput& region) {
      return std::ranges::find(region.examples, pose.name) != region.examples.end();
    });
    return !local && !(input.whole_body && pose.in_whole_body);
  });
}

std::string text_of(const Needs& needs) {
  std::string text = fmt::format(
      "examples {}\nrigid {} {}\ntargets {}\ncontact {}\nrender {}\ninternal_force {}\nenergy_reference {}\n",
      needs.examples, needs.rigid, needs.carried, needs.targets, needs.contact, needs.render,
      name_of(needs.internal_force), name_of(needs.energy_reference));
  if (needs.full_space) text += "full_space\n";
  if (needs.target_elasticity) text += "target_elasticity\n";
  if (!needs.regions) return text;
  for (const RegionNeeds& region : *needs.regions)
    text += fmt::format("region {} {} {}{}\n", region.name, region.targets, name_of(region.energy_reference),
                        region.target_elasticity ? " target_elasticity" : "");
  return text + "no other regions\n";
}

Needs resolve_needs(const AssetConfig& asset, const std::optional<Needs>& scene_needs) {
  Needs needs = scene_needs.value_or(Needs{});
  if (needs.internal_force == ForceMethod::kAuto) needs.internal_force = asset.internal_force;
  if (scene_needs || !asset.needs) return needs;
  const auto named = [&](const char* part) {
    return std::find(asset.needs->begin(), asset.needs->end(), part) != asset.needs->end();
  };
  needs.examples = named("examples");
  needs.targets = named("targets");
  needs.target_elasticity = named("target_elasticity");
  needs.full_space = named("full_space");
  needs.rigid = needs.carried = named("rigid");
  needs.contact = named("contact");
  needs.render = named("render");
  if (!named("regions")) needs.regions.emplace();
  return needs;
}

}  // namespace exmat::precompute

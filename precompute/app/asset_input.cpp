#include "precompute/app/asset_input.h"

#include <fmt/format.h>

#include "common/config/config.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/core/log.h"
#include "precompute/inputs/assumed_asset.h"
#include "precompute/mesh_io/surface_file.h"

namespace exmat {

AssetConfig asset_from(const std::filesystem::path& asset_or_surface, const std::filesystem::path& write_to) {
  if (!precompute::is_surface_file(asset_or_surface)) {
    if (!write_to.empty())
      throw InputError({"--write-asset", "", "a surface in place of an asset file, whose asset is to be written",
                        asset_or_surface.string(), ""});
    if (lower_extension(asset_or_surface) != ".json" && !way_from(asset_or_surface).empty())
      refuse_extension(asset_or_surface, "an asset file (.json) or a surface");
    return load_asset(asset_or_surface);
  }
  const Json assumed = precompute::assumed_asset(asset_or_surface, asset_or_surface.parent_path());
  AssetConfig asset = asset_of(assumed, asset_or_surface);
  const auto& material = asset.material;
  log::info(
      fmt::format("{}: no asset file; assumed are {} examples, {} cells, Young's modulus {:.2g} Pa, Poisson ratio {}, "
                  "{} kg/m^3, {}{}",
                  asset_or_surface.string(), asset.examples.size(), *asset.cells, *material.youngs_modulus,
                  *material.poisson_ratio, *material.density, asset.fixed ? "clamped at _FIXED" : "a free body",
                  write_to.empty() ? "; --write-asset FILE writes them down" : ""));
  for (const ExampleConfig& example : asset.examples)
    if (example.name != *example.morph)
      log::info(fmt::format("the morph target \"{}\" is the example \"{}\"", *example.morph, example.name));
  if (asset.examples.empty())
    log::info(
        fmt::format("{}: no morph target that moves a vertex, so the bundle has no examples; add shape keys to the "
                    "file, or name poses in an asset file",
                    asset_or_surface.string()));
  return asset;
}

void write_assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& write_to) {
  write_file_atomically(write_to, precompute::assumed_asset(surface, write_to.parent_path()).dump(2) + "\n");
  log::info(fmt::format("{}: written", write_to.string()));
}

}  // namespace exmat

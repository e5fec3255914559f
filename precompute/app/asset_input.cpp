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
namespace {

// Why a clamp cannot follow examples in a scene; nothing where it can.
std::string reason_to_stand(const SceneConfig* scene) {
  if (scene == nullptr) return "";
  if (scene->examples && scene->examples->law == ExampleForceLaw::kElastic) return "an elastic example force";
  if (scene->integrator == Integrator::kNewmark) return "the integrator newmark";
  if (!scene->body.motion.empty()) return "a motion that carries the body";
  return "";
}

// The asset that a surface alone stands for in a scene, if there is one.
Json assumed(const std::filesystem::path& surface, const std::filesystem::path& folder, const SceneConfig* scene) {
  Json asset = precompute::assumed_asset(surface, folder);
  if (asset["object"].contains("fixed") && !reason_to_stand(scene).empty()) asset["object"]["fixed"].erase("follow");
  return asset;
}

// The clamp of an assumed asset in words.
std::string clamp_text(const AssetConfig& asset) {
  if (!asset.fixed) return "a free body";
  return fmt::format("clamped at _FIXED{}", asset.clamp_follows ? ", which poses move: it follows them" : "");
}

}  // namespace

AssetConfig asset_from(const std::filesystem::path& asset_or_surface, const std::filesystem::path& write_to,
                       const SceneConfig* scene) {
  if (!precompute::is_surface_file(asset_or_surface)) {
    if (!write_to.empty())
      throw InputError({"--write-asset", "", "a surface in place of an asset file, whose asset is to be written",
                        asset_or_surface.string(), ""});
    if (lower_extension(asset_or_surface) != ".json" && !way_from(asset_or_surface).empty())
      refuse_extension(asset_or_surface, "an asset file (.json) or a surface");
    return load_asset(asset_or_surface);
  }
  const AssetConfig asset =
      asset_of(assumed(asset_or_surface, asset_or_surface.parent_path(), scene), asset_or_surface);
  const auto& material = asset.material;
  log::info(fmt::format(
      "{}: no asset file; assumed are {} examples, {} cells, Young's modulus {:.2g} Pa, Poisson ratio {}, "
      "{} kg/m^3, {}{}",
      asset_or_surface.string(), asset.examples.size(), *asset.cells, *material.youngs_modulus, *material.poisson_ratio,
      *material.density, clamp_text(asset), write_to.empty() ? "; --write-asset FILE writes them down" : ""));
  if (asset.clamp_follows)
    log::info(
        "the body steps in all its vertices, since its clamp follows; an asset file without object.fixed.follow "
        "has it step in modes, faster, while the clamp stands still");
  else if (asset.fixed && !reason_to_stand(scene).empty())
    log::info(fmt::format("the clamp stands still, also where poses move it: it follows none in a scene with {}",
                          reason_to_stand(scene)));
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

void write_assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& write_to,
                         const SceneConfig* scene) {
  write_file_atomically(write_to, assumed(surface, write_to.parent_path(), scene).dump(2) + "\n");
  log::info(fmt::format("{}: written", write_to.string()));
}

}  // namespace exmat

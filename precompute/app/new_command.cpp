#include "precompute/app/new_command.h"

#include <filesystem>
#include <fmt/format.h>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/core/log.h"
#include "precompute/inputs/assumed_asset.h"
#include "precompute/inputs/assumed_scene.h"
#include "precompute/mesh_io/surface_file.h"

namespace exmat {
namespace {

void require_new(const std::filesystem::path& file) {
  claim_output(file, "-o");
  if (std::filesystem::exists(file))
    throw InputError({file.string(), "", "no such file yet", "one", "choose another folder by -o, or remove it"});
}

}  // namespace

void new_command(const NewCommandOptions& options) {
  const std::filesystem::path surface = options.surface;
  if (!precompute::is_surface_file(surface))
    refuse_extension(surface, "a surface with the extension .glb, .gltf, .obj, .ply or .stl");
  const std::string name = surface.stem().string();
  const std::filesystem::path folder = options.folder.empty() ? name : options.folder;
  const std::filesystem::path asset_file = folder / "asset.json", scene_file = folder / "scene.json";
  check_input(surface, "a surface");
  claim_folder(folder, "-o");
  require_new(asset_file);
  require_new(scene_file);
  const Json asset = precompute::assumed_asset(surface, folder);
  const Json scene = precompute::assumed_scene(asset, name, precompute::read_surface_file(surface));
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw InputError({folder.string(), "", "a folder that can be made", failed.message(), ""});
  write_file_atomically(asset_file, asset.dump(2) + "\n");
  write_file_atomically(scene_file, scene.dump(2) + "\n");
  const std::size_t examples = asset.contains("examples") ? asset["examples"].size() : 0;
  log::info(fmt::format("{}: {} poses, {}", surface.string(), examples,
                        !asset["object"].contains("fixed")            ? "a free body above a floor"
                        : asset["object"]["fixed"].contains("follow") ? "clamped at _FIXED, which follows the poses"
                                                                      : "clamped at _FIXED"));
  const auto path = [&](const std::string& file) { return (folder / file).string(); };
  fmt::print("{} and {} are written. Run\n\n", asset_file.string(), scene_file.string());
  fmt::print("  exmat-precompute bundle {} --scene {} -o {}\n", asset_file.string(), scene_file.string(),
             path(name + ".h5"));
  fmt::print("  exmat-runtime run {}\n", scene_file.string());
  fmt::print("  exmat-runtime export {} -o {} --targets 8\n", path(name + "_run.h5"), path(name + "_run.glb"));
  fmt::print("\nand open {}, or exmat-viewer {}.\n", path(name + "_run.glb"), scene_file.string());
}

}  // namespace exmat

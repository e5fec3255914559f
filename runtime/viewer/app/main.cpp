#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "common/console/console.h"
#include "common/core/error.h"
#include "common/core/version.h"
#include "exmat/exmat.hpp"
#include "runtime/viewer/app/options.h"

namespace {

/// "1280x720".
exmat::viewer::PictureSize size_of(const std::string& text) {
  exmat::viewer::PictureSize size;
  int read = 0;
  constexpr int kMost = 16384;
  if (std::sscanf(text.c_str(), "%dx%d%n", &size.width, &size.height, &read) == 2 &&
      read == static_cast<int>(text.size()) && size.width >= 64 && size.height >= 64 && size.width <= kMost &&
      size.height <= kMost)
    return size;
  throw exmat::InputError({"--size", "", "width and height as 1280x720, 64 to 16384 each", '"' + text + '"', ""});
}

/// Errors of the library as those of the programs: the same messages, the same statuses.
void show(const exmat::viewer::Options& options) {
  try {
    exmat::viewer::run(options);
  } catch (const exmat::Error& error) {
    if (error.status() != EXMAT_BAD_INPUT) throw exmat::WorkError(error.what());
    // Its message has file, place, expected and found.
    throw exmat::InputError({error.what(), "", "", "", ""});
  }
}

}  // namespace

int main(int argc, char** argv) {
  using namespace exmat;
  CLI::App app{"Shows example-based elastic bodies, and lets you take hold of them.", "exmat-viewer"};
  app.set_version_flag("--version", [] { return fmt::format("exmat-viewer {}", version()); });
  CommonOptions common;
  add_common_options(app, common);
  viewer::Options options;
  std::string size;
  app.add_option("files", options.files, "SCENE.json or BUNDLE.h5, then bundles that are shown beside it")->required();
  app.add_option("--size", size, "Size of the picture in pixels, 1280x720");
  app.add_option("--scale", options.scale, "Scale of the interface; default: the screen's")
      ->check(number_between(0.5, 8.0));
  app.add_flag("--hide-interface", options.hide_interface, "Nothing but the scene; H brings the interface back");
  app.add_flag("--object", options.object_surface, "The surface of the tets, also where there is a render mesh");
  const std::string group = "Without a screen (with xvfb-run -a where there is none)";
  app.add_option("--script", options.script, "Do what this file says, at fixed time (schemas/viewer_script.json)")
      ->group(group);
  app.add_option("--frames", options.frames, "End after so many pictures")
      ->check(whole_number_between(0, 10'000'000))
      ->group(group);
  app.add_option("--frame-rate", options.frame_rate,
                 "Pictures a second of simulated time; default: the script's, or 60")
      ->check(number_between(1e-3, 1e6))
      ->group(group);
  app.add_option("--record", options.record, "Folder for pictures (PNG), or a movie (.mp4 or .gif, by ffmpeg)")
      ->group(group);
  app.add_option("--screenshot", options.screenshot, "File for the last picture (PNG)")->group(group);
  app.add_option("--save-scene", options.save_scene, "File for the scene with what was set (JSON), at the end")
      ->group(group);
  app.add_option("--dump", options.dump, "File for what the last picture shows: camera, states, hands (JSON)")
      ->group(group);
  app.add_flag("--time", options.time, "Print what steps and pictures take")->group(group);
  return run_program(app, argc, argv, [&] {
    apply(common);
    if (!size.empty()) options.size = size_of(size);
    show(options);
  });
}

#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "runtime/viewer/view/camera.h"

namespace exmat::viewer {

/// Requests of the command line.
struct Options {
  std::vector<std::filesystem::path> files;  ///< SCENE.json or BUNDLE.h5, then more bundles
  PictureSize size;
  std::optional<double> scale;  ///< scale of the interface; absent: the screen's
  bool hide_interface = false;
  bool object_surface = false;  ///< the tets' boundary, also where there is a render mesh

  // Without a screen.
  std::optional<std::filesystem::path> script, record, screenshot, save_scene, dump;
  std::optional<int> frames;
  std::optional<double> frame_rate;
  bool time = false;

  bool by_itself() const { return script || record || screenshot || frames || save_scene || dump; }
};

/// Opens the window and stays until it is closed, or does what the options ask for and ends.
void run(const Options& options);

}  // namespace exmat::viewer

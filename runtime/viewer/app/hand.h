#pragma once

#include <span>

#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

/// The mouse of the current ImGui frame and keys become what they ask for.
class Hand {
 public:
  /// `keys` that went down since the last frame, by GLFW's numbers.
  void act(Studio& studio, const PictureSize& picture, std::span<const int> keys);

 private:
  enum class Mode { kNone, kDrag, kOrbit, kPan };

  void use_mouse(Studio& studio, const PictureSize& picture);
  void use_key(Studio& studio, int key);
  void toggle_gravity(Studio& studio);

  Mode mode_ = Mode::kNone;
  std::array<double, 3> gravity_{0, 0, -9.81};  ///< that G brings back
};

}  // namespace exmat::viewer

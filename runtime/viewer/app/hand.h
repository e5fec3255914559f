#pragma once

#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

/// Mouse and keys of the current ImGui frame become what they ask for.
class Hand {
 public:
  void act(Studio& studio, const PictureSize& picture);

 private:
  enum class Mode { kNone, kDrag, kOrbit, kPan };

  void use_mouse(Studio& studio, const PictureSize& picture);
  void use_keys(Studio& studio);
  void toggle_gravity(Studio& studio);

  Mode mode_ = Mode::kNone;
  std::array<double, 3> gravity_{0, 0, -9.81};  ///< that G brings back
};

}  // namespace exmat::viewer

#pragma once

#include <string>

#include "runtime/viewer/panels/controls.h"
#include "runtime/viewer/panels/history.h"
#include "runtime/viewer/panels/overlay.h"
#include "runtime/viewer/panels/plots.h"

struct GLFWwindow;

namespace exmat::viewer {

/// All that is drawn by ImGui.
class Interface {
 public:
  /// `window` null: no mouse and no keys, pictures of any size.
  Interface(GLFWwindow* window, float scale, std::string title, std::string save_name);
  ~Interface();
  Interface(const Interface&) = delete;
  Interface& operator=(const Interface&) = delete;

  /// Asks for mouse and keys.
  void begin(const PictureSize& picture, double seconds);
  /// Notes a picture for the plots; `times` are those of the steps since the call before.
  void note(const Snapshot& snapshot, const StepTimes& times) { history_.add(snapshot, times); }
  /// Onto the picture that is bound.
  void draw(const Snapshot& snapshot, const SceneDrawing& drawing, Studio& studio, const PictureSize& picture,
            double frame_seconds);

  float scale() const { return style_.scale; }

 private:
  GLFWwindow* window_;
  Style style_;
  Controls controls_;
  History history_;
};

}  // namespace exmat::viewer

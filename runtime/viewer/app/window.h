#pragma once

#include <string>
#include <utility>
#include <vector>

#include "runtime/viewer/view/camera.h"

struct GLFWwindow;

namespace exmat::viewer {

/// A window with OpenGL 3.3 of its own; hidden, it is but the way to OpenGL.
class Window {
 public:
  /// Throws WorkError: there is no display, or its OpenGL is too old.
  Window(const PictureSize& size, bool visible);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  GLFWwindow* get() const { return window_; }
  /// In pixels.
  PictureSize size() const;
  /// Pixels of the screen over those of a plain one.
  float scale() const;
  bool closed() const;
  void show_next();
  /// GLFW's numbers of the keys that went down since the last call, however soon they came up again.
  std::vector<int> take_keys() { return std::exchange(keys_, {}); }

  /// The renderer, in words; whether that is the processor.
  std::string renderer() const;
  bool is_software() const;

 private:
  GLFWwindow* window_ = nullptr;
  std::vector<int> keys_;
};

}  // namespace exmat::viewer

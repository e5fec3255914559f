#pragma once

#include <cstdint>
#include <vector>

#include "runtime/viewer/drawing/gl_objects.h"
#include "runtime/viewer/view/camera.h"

namespace exmat::viewer {

/// Rows from the top, three bytes a pixel.
struct Picture {
  PictureSize size;
  std::vector<std::uint8_t> rgb;
};

/// The surface that is drawn into, whether a window shows it or not: several samples a pixel, then one.
class Canvas {
 public:
  Canvas(const PictureSize& size, int samples);

  const PictureSize& size() const { return size_; }
  /// Draw in three dimensions from now on.
  void begin();
  /// The samples become pixels, onto which an interface may be drawn.
  void resolve();
  /// The pixels into the window of the current context.
  void show(const PictureSize& window) const;
  Picture read() const;

 private:
  PictureSize size_;
  Renderbuffer colour_, depth_, pixels_;
  Framebuffer many_, one_;
};

}  // namespace exmat::viewer

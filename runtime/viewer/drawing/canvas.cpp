#include "runtime/viewer/drawing/canvas.h"

#include <algorithm>

#include "common/core/error.h"

namespace exmat::viewer {
namespace {

void require_complete() {
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw WorkError("the graphics driver does not make a picture of this size");
}

}  // namespace

Canvas::Canvas(const PictureSize& size, int samples)
    : size_(size),
      colour_(make_renderbuffer()),
      depth_(make_renderbuffer()),
      pixels_(make_renderbuffer()),
      many_(make_framebuffer()),
      one_(make_framebuffer()) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_SAMPLES, &most);
  samples = std::min(samples, most);
  glBindRenderbuffer(GL_RENDERBUFFER, colour_.get());
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_RGBA8, size.width, size.height);
  glBindRenderbuffer(GL_RENDERBUFFER, depth_.get());
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_DEPTH_COMPONENT24, size.width, size.height);
  glBindRenderbuffer(GL_RENDERBUFFER, pixels_.get());
  glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, size.width, size.height);
  glBindFramebuffer(GL_FRAMEBUFFER, many_.get());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour_.get());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_.get());
  require_complete();
  glBindFramebuffer(GL_FRAMEBUFFER, one_.get());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, pixels_.get());
  require_complete();
}

void Canvas::begin() {
  glBindFramebuffer(GL_FRAMEBUFFER, many_.get());
  glViewport(0, 0, size_.width, size_.height);
  glDisable(GL_SCISSOR_TEST);
  glDepthMask(GL_TRUE);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

void Canvas::resolve() {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, many_.get());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, one_.get());
  glBlitFramebuffer(0, 0, size_.width, size_.height, 0, 0, size_.width, size_.height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, one_.get());
}

void Canvas::show(const PictureSize& window) const {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, one_.get());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  glBlitFramebuffer(0, 0, size_.width, size_.height, 0, 0, window.width, window.height, GL_COLOR_BUFFER_BIT,
                    GL_NEAREST);
}

Picture Canvas::read() const {
  Picture picture{size_, {}};
  const std::size_t row = 3 * static_cast<std::size_t>(size_.width);
  picture.rgb.resize(row * static_cast<std::size_t>(size_.height));
  std::vector<std::uint8_t> upside_down(picture.rgb.size());
  glBindFramebuffer(GL_READ_FRAMEBUFFER, one_.get());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, size_.width, size_.height, GL_RGB, GL_UNSIGNED_BYTE, upside_down.data());
  for (std::size_t y = 0; y < static_cast<std::size_t>(size_.height); ++y)
    std::copy_n(upside_down.data() + y * row, row,
                picture.rgb.data() + (static_cast<std::size_t>(size_.height) - 1 - y) * row);
  return picture;
}

}  // namespace exmat::viewer

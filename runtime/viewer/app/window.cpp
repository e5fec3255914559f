#include "runtime/viewer/app/window.h"

#include <GLFW/glfw3.h>
#include <algorithm>
#include <epoxy/gl.h>
#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::viewer {
namespace {

std::string& last_complaint() {
  static std::string text;
  return text;
}

/// OpenGL's version in a window without wishes; empty where there is none.
std::string version_found() {
  glfwDefaultWindowHints();
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  GLFWwindow* const window = glfwCreateWindow(16, 16, "exmat-viewer", nullptr, nullptr);
  if (window == nullptr) return {};
  glfwMakeContextCurrent(window);
  const auto* const version = reinterpret_cast<const char*>(glGetString(GL_VERSION));
  const std::string found = version != nullptr ? version : "";
  glfwDestroyWindow(window);
  return found;
}

}  // namespace

Window::Window(const PictureSize& size, bool visible) {
  glfwSetErrorCallback([](int, const char* text) { last_complaint() = text; });
  if (glfwInit() == GLFW_FALSE)
    throw WorkError(
        fmt::format("no window can be opened: {}. Without a screen: xvfb-run -a exmat-viewer ... with "
                    "--screenshot, --record or --script",
                    last_complaint()));
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  glfwWindowHint(GLFW_VISIBLE, visible ? GLFW_TRUE : GLFW_FALSE);
  window_ = glfwCreateWindow(size.width, size.height, "exmat", nullptr, nullptr);
  if (window_ == nullptr) {
    const std::string complaint = last_complaint(), found = version_found();
    glfwTerminate();
    throw WorkError(found.empty()
                        ? fmt::format("there is no OpenGL on this display: {}", complaint)
                        : fmt::format("OpenGL 3.3 is needed, found {}; a newer driver, or the software of Mesa "
                                      "(LIBGL_ALWAYS_SOFTWARE=1), has it",
                                      found));
  }
  glfwMakeContextCurrent(window_);
  glfwSwapInterval(visible ? 1 : 0);
  // ImGui, which comes later, hands keys on to it. It would lose one that comes up before the next picture.
  glfwSetWindowUserPointer(window_, this);
  glfwSetKeyCallback(window_, [](GLFWwindow* window, int key, int, int action, int) {
    if (action != GLFW_RELEASE) static_cast<Window*>(glfwGetWindowUserPointer(window))->keys_.push_back(key);
  });
}

Window::~Window() {
  glfwDestroyWindow(window_);
  glfwTerminate();
}

PictureSize Window::size() const {
  PictureSize size;
  glfwGetFramebufferSize(window_, &size.width, &size.height);
  size.width = std::max(size.width, 1);
  size.height = std::max(size.height, 1);
  return size;
}

float Window::scale() const {
  float x = 1, y = 1;
  glfwGetWindowContentScale(window_, &x, &y);
  return std::max(1.0F, std::max(x, y));
}

bool Window::closed() const { return glfwWindowShouldClose(window_) == GLFW_TRUE; }

void Window::show_next() {
  glfwSwapBuffers(window_);
  glfwPollEvents();
}

std::string Window::renderer() const { return reinterpret_cast<const char*>(glGetString(GL_RENDERER)); }

bool Window::is_software() const {
  const std::string name = renderer();
  return name.find("llvmpipe") != std::string::npos || name.find("softpipe") != std::string::npos;
}

}  // namespace exmat::viewer

#include "runtime/viewer/app/hand.h"

#include <GLFW/glfw3.h>
#include <algorithm>
#include <cmath>
#include <imgui.h>

namespace exmat::viewer {
namespace {

constexpr double kZoomPerNotch = 1.12;
constexpr double kSpeedPerKey = 1.5;

Eigen::Vector2d pixel_of(const ImVec2& mouse) { return {mouse.x - 0.5, mouse.y - 0.5}; }

}  // namespace

void Hand::act(Studio& studio, const PictureSize& picture, std::span<const int> keys) {
  use_mouse(studio, picture);
  if (ImGui::GetIO().WantTextInput) return;
  for (const int key : keys)
    if (key == GLFW_KEY_P)
      studio.toggle_pin(pixel_of(ImGui::GetIO().MousePos), picture);
    else
      use_key(studio, key);
}

void Hand::use_mouse(Studio& studio, const PictureSize& picture) {
  const ImGuiIO& io = ImGui::GetIO();
  const Eigen::Vector2d pixel = pixel_of(io.MousePos);
  if (!io.WantCaptureMouse && mode_ == Mode::kNone) {
    if (ImGui::IsMouseClicked(ImGuiMouseButton_Left))
      mode_ = io.KeyShift ? Mode::kPan : studio.begin_drag(pixel, picture) ? Mode::kDrag : Mode::kOrbit;
    if (ImGui::IsMouseClicked(ImGuiMouseButton_Right) || ImGui::IsMouseClicked(ImGuiMouseButton_Middle))
      mode_ = Mode::kPan;
    if (io.MouseWheel != 0) studio.camera().zoom(std::pow(kZoomPerNotch, io.MouseWheel));
  }
  const double right = static_cast<double>(io.MouseDelta.x) / picture.height,
               up = -static_cast<double>(io.MouseDelta.y) / picture.height;
  if (mode_ == Mode::kOrbit) studio.camera().orbit(right, -up);
  if (mode_ == Mode::kPan) studio.camera().pan(-right, -up);
  if (mode_ == Mode::kDrag) studio.drag(pixel, picture);
  const bool held = std::ranges::any_of(io.MouseDown, [](bool down) { return down; });
  if (held || mode_ == Mode::kNone) return;
  studio.end_drag();
  mode_ = Mode::kNone;
}

void Hand::use_key(Studio& studio, int key) {
  Look& look = studio.look();
  Runner& runner = studio.runner();
  switch (key) {
    case GLFW_KEY_SPACE:
      return studio.toggle_pause();
    case GLFW_KEY_RIGHT:
      runner.set_paused(true);
      return runner.step(ImGui::GetIO().KeyShift ? 10 : 1);
    case GLFW_KEY_R:
      return studio.reset();
    case GLFW_KEY_MINUS:
    case GLFW_KEY_KP_SUBTRACT:
      return runner.set_speed(runner.speed() / kSpeedPerKey);
    case GLFW_KEY_EQUAL:
    case GLFW_KEY_KP_ADD:
      return runner.set_speed(runner.speed() * kSpeedPerKey);
    case GLFW_KEY_F:
      studio.frame_next = true;
      break;
    case GLFW_KEY_C:
      look.colouring = static_cast<Colouring>((static_cast<int>(look.colouring) + 1) % 4);
      break;
    case GLFW_KEY_W:
      look.wireframe = !look.wireframe;
      break;
    case GLFW_KEY_E:
      look.elements = !look.elements;
      break;
    case GLFW_KEY_B:
      look.bones = !look.bones;
      break;
    case GLFW_KEY_X:
      look.examples = !look.examples;
      studio.frame_next = true;
      break;
    case GLFW_KEY_T:
      look.targets = !look.targets;
      break;
    case GLFW_KEY_G:
      return toggle_gravity(studio);
    case GLFW_KEY_H:
      studio.interface = !studio.interface;
      break;
    case GLFW_KEY_SLASH:
    case GLFW_KEY_F1:
      studio.help = !studio.help;
      break;
    case GLFW_KEY_ESCAPE:
      studio.help = false;
      break;
    case GLFW_KEY_Q:
      studio.end = true;
      break;
    default:
      break;
  }
}

void Hand::toggle_gravity(Studio& studio) {
  Settings settings = studio.settings(0);
  const bool on = std::ranges::any_of(settings.gravity, [](double part) { return part != 0; });
  if (on) gravity_ = settings.gravity;
  settings.gravity = on ? std::array<double, 3>{} : gravity_;
  studio.apply(0, settings);
}

}  // namespace exmat::viewer

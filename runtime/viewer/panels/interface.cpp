#include "runtime/viewer/panels/interface.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <utility>

namespace exmat::viewer {

Interface::Interface(GLFWwindow* window, float scale, std::string title, std::string save_name)
    : window_(window), controls_(std::move(title), std::move(save_name)) {
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // nothing is remembered beside the scene
  style_ = make_style(scale);
  if (window_ != nullptr) ImGui_ImplGlfw_InitForOpenGL(window_, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}

Interface::~Interface() {
  ImGui_ImplOpenGL3_Shutdown();
  if (window_ != nullptr) ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

void Interface::begin(const PictureSize& picture, double seconds) {
  ImGui_ImplOpenGL3_NewFrame();
  ImGuiIO& io = ImGui::GetIO();
  if (window_ != nullptr) {
    ImGui_ImplGlfw_NewFrame();
  } else {
    io.DisplaySize = {static_cast<float>(picture.width), static_cast<float>(picture.height)};
    io.DeltaTime = static_cast<float>(seconds);
  }
  ImGui::NewFrame();
}

void Interface::draw(const Snapshot& snapshot, const SceneDrawing& drawing, Studio& studio, const PictureSize& picture,
                     double frame_seconds) {
  draw_overlay(style_, snapshot, drawing, studio, picture);
  if (studio.interface) {
    controls_.draw(style_, snapshot, studio);
    draw_plots(style_, snapshot, history_, studio, studio.shapes(), frame_seconds);
    draw_message(style_, studio);
  }
  if (studio.help) draw_help(style_);
  ImGui::Render();
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

}  // namespace exmat::viewer

#include "runtime/viewer/panels/style.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>

namespace exmat::viewer {
namespace {

constexpr const char* kTextFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr const char* kTitleFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf";
constexpr float kTextSize = 13, kTitleSize = 15;

/// A font of Debian, where it is installed; else the one that ImGui brings, scaled.
ImFont* load_font(const char* file, float size) {
  ImGuiIO& io = ImGui::GetIO();
  ImFontConfig config;
  config.OversampleH = config.OversampleV = 2;
  if (std::filesystem::exists(file)) return io.Fonts->AddFontFromFileTTF(file, size, &config);
  config.SizePixels = size;
  return io.Fonts->AddFontDefault(&config);
}

ImVec4 grey(float level, float opacity = 1) { return {level, level + 0.005F, level + 0.015F, opacity}; }

void set_colours(ImGuiStyle& style) {
  ImGui::StyleColorsLight(&style);
  ImVec4* const colours = style.Colors;
  const ImVec4 blue{0.000F, 0.447F, 0.698F, 1}, pale{0.000F, 0.447F, 0.698F, 0.16F}, middle{0, 0.447F, 0.698F, 0.32F};
  colours[ImGuiCol_Text] = grey(0.13F);
  colours[ImGuiCol_TextDisabled] = grey(0.42F);
  colours[ImGuiCol_WindowBg] = grey(0.985F, 0.93F);
  colours[ImGuiCol_PopupBg] = grey(0.99F, 0.98F);
  colours[ImGuiCol_Border] = grey(0.30F, 0.16F);
  colours[ImGuiCol_FrameBg] = grey(0.30F, 0.10F);
  colours[ImGuiCol_FrameBgHovered] = pale;
  colours[ImGuiCol_FrameBgActive] = middle;
  colours[ImGuiCol_SliderGrab] = {0.000F, 0.447F, 0.698F, 0.40F};
  colours[ImGuiCol_SliderGrabActive] = blue;
  colours[ImGuiCol_CheckMark] = blue;
  colours[ImGuiCol_Button] = grey(0.30F, 0.12F);
  colours[ImGuiCol_ButtonHovered] = pale;
  colours[ImGuiCol_ButtonActive] = middle;
  colours[ImGuiCol_Header] = grey(0.30F, 0.08F);
  colours[ImGuiCol_HeaderHovered] = pale;
  colours[ImGuiCol_HeaderActive] = middle;
  colours[ImGuiCol_ScrollbarBg] = grey(0.5F, 0);
  colours[ImGuiCol_ScrollbarGrab] = grey(0.5F, 0.35F);
  colours[ImGuiCol_Separator] = grey(0.30F, 0.16F);
}

}  // namespace

Style make_style(float scale) {
  Style style{scale, load_font(kTextFont, kTextSize * scale), load_font(kTitleFont, kTitleSize * scale)};
  ImGuiStyle& all = ImGui::GetStyle();
  all = ImGuiStyle();
  set_colours(all);
  all.WindowRounding = 8;
  all.FrameRounding = 4;
  all.GrabRounding = 4;
  all.PopupRounding = 6;
  all.ScrollbarRounding = 6;
  all.ScrollbarSize = 10;
  all.WindowPadding = {12, 10};
  all.FramePadding = {7, 3};
  all.ItemSpacing = {7, 5};
  all.ItemInnerSpacing = {6, 4};
  all.IndentSpacing = 12;
  all.WindowBorderSize = 1;
  all.ScaleAllSizes(scale);
  return style;
}

std::string with_unit(double value, const char* unit) {
  constexpr std::array<const char*, 7> kPrefixes{"u", "m", "", "k", "M", "G", "T"};
  constexpr int kPlain = 2;
  const double size = std::abs(value);
  if (!(size >= 1e-9)) return fmt::format("0 {}", unit);
  const int thousands = std::clamp(static_cast<int>(std::floor(std::log10(size * 1.0005) / 3)), -kPlain, 4);
  const double shown = value / std::pow(1000, thousands);
  const int whole = std::abs(shown) >= 99.95 ? 0 : std::abs(shown) >= 9.995 ? 1 : 2;
  return fmt::format("{:.{}f} {}{}", shown, whole, kPrefixes[static_cast<std::size_t>(thousands + kPlain)], unit);
}

ImU32 colour_of(const Colour& colour, float opacity) {
  return ImGui::ColorConvertFloat4ToU32({colour[0], colour[1], colour[2], opacity});
}

ImU32 palette_colour(std::size_t number, float opacity) {
  // Yellow last: it is faint on a light ground.
  return colour_of(kPalette[number % (kPalette.size() - 1)], opacity);
}

}  // namespace exmat::viewer

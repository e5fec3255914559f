#pragma once

#include <imgui.h>
#include <string>

#include "runtime/viewer/drawing/look.h"

namespace exmat::viewer {

/// Fonts and colours of the interface.
struct Style {
  float scale = 1;
  ImFont* text = nullptr;
  ImFont* title = nullptr;
};

/// For the current ImGui context.
Style make_style(float scale);

/// Three digits with a prefix: 333 kN.
std::string with_unit(double value, const char* unit);

/// 0 to 1 in sRGB.
ImU32 colour_of(const Colour& colour, float opacity = 1);
ImU32 palette_colour(std::size_t number, float opacity = 1);

}  // namespace exmat::viewer

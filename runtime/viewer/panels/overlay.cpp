#include "runtime/viewer/panels/overlay.h"

#include <array>
#include <fmt/format.h>
#include <string>
#include <utility>

namespace exmat::viewer {
namespace {

ImVec2 at(const Eigen::Vector2d& pixel) {
  return {static_cast<float>(pixel.x() + 0.5), static_cast<float>(pixel.y() + 0.5)};
}

void text_beside(ImDrawList& list, ImVec2 place, const std::string& text, const Style& style) {
  const ImVec2 size = style.text->CalcTextSizeA(style.text->FontSize, 1e6F, 0, text.c_str());
  const float margin = 4 * style.scale;
  list.AddRectFilled({place.x - margin, place.y - margin}, {place.x + size.x + margin, place.y + size.y + margin},
                     IM_COL32(252, 252, 254, 215), 4 * style.scale);
  list.AddText(style.text, style.text->FontSize, place, IM_COL32(30, 34, 42, 255), text.c_str());
}

void draw_grips(const Style& style, const Snapshot& snapshot, Studio& studio, const PictureSize& picture,
                ImDrawList& list) {
  const float s = style.scale;
  for (const GripSnapshot& grip : snapshot.grips) {
    const auto point = studio.camera().pixel(grip.point, picture), target = studio.camera().pixel(grip.target, picture);
    if (!point || !target) continue;
    list.AddLine(at(*point), at(*target), IM_COL32(255, 255, 255, 190), 4.5F * s);
    list.AddLine(at(*point), at(*target), IM_COL32(213, 94, 0, 255), 2.2F * s);
    list.AddCircleFilled(at(*point), 4.5F * s, IM_COL32(255, 255, 255, 220));
    list.AddCircleFilled(at(*point), 3.2F * s, IM_COL32(213, 94, 0, 255));
    list.AddCircle(at(*target), 7 * s, IM_COL32(255, 255, 255, 220), 0, 4 * s);
    list.AddCircle(at(*target), 7 * s, IM_COL32(213, 94, 0, 255), 0, 2 * s);
    const ImVec2 hand = at(*target);
    if (studio.interface && !grip.force.isZero(0))
      text_beside(list, {hand.x + 14 * s, hand.y - 8 * s}, with_unit(grip.force.norm(), "N"), style);
  }
}

void draw_pins(const Style& style, const Snapshot& snapshot, const Studio& studio, const PictureSize& picture,
               ImDrawList& list) {
  for (const Eigen::Vector3d& pin : snapshot.pins) {
    const auto point = studio.camera().pixel(pin, picture);
    if (!point) continue;
    list.AddCircleFilled(at(*point), 7 * style.scale, IM_COL32(255, 255, 255, 220));
    list.AddCircleFilled(at(*point), 5 * style.scale, IM_COL32(0, 158, 115, 255));
  }
}

void draw_bones(const Style& style, const Snapshot& snapshot, const Studio& studio, const PictureSize& picture,
                ImDrawList& list) {
  const float s = style.scale;
  for (std::size_t body = 0; body < snapshot.bodies.size(); ++body) {
    const std::vector<std::int64_t>& parents = studio.shapes()[studio.kinds_of_bodies()[body]]->bone_parents;
    const auto pixel = [&](std::size_t bone) {
      return studio.camera().pixel(snapshot.bodies[body].joint(bone) + studio.offsets()[body], picture);
    };
    for (std::size_t bone = 0; bone < parents.size(); ++bone) {
      const auto joint = pixel(bone);
      if (!joint) continue;
      const auto parent = parents[bone] < 0 ? std::nullopt : pixel(static_cast<std::size_t>(parents[bone]));
      if (parent) list.AddLine(at(*parent), at(*joint), IM_COL32(0, 114, 178, 200), 2 * s);
      list.AddCircleFilled(at(*joint), 6 * s, IM_COL32(255, 255, 255, 220));
      list.AddCircleFilled(at(*joint), 4.5F * s, IM_COL32(0, 114, 178, 255));
    }
  }
}

void draw_names(const Style& style, const SceneDrawing& drawing, const Studio& studio, const PictureSize& picture,
                ImDrawList& list) {
  for (const ShownGhost& ghost : drawing.ghosts()) {
    const auto place = studio.camera().pixel(ghost.place, picture);
    if (!place) continue;
    const ImVec2 size = style.text->CalcTextSizeA(style.text->FontSize, 1e6F, 0, ghost.name.c_str());
    text_beside(list, {at(*place).x - 0.5F * size.x, at(*place).y - 2.2F * size.y}, ghost.name, style);
  }
}

void draw_scale(const Style& style, float most, Colouring colouring, const PictureSize& picture, ImDrawList& list) {
  if (colouring == Colouring::kPlain) return;
  constexpr std::array<std::pair<const char*, const char*>, 4> kNames{
      {{"", ""}, {"displacement", "m"}, {"strain energy", "J/m^3"}, {"contact force", "N"}}};
  const auto& [name, unit] = kNames[static_cast<std::size_t>(colouring)];
  const float s = style.scale, width = 220 * s, height = 10 * s;
  const ImVec2 from{0.5F * (static_cast<float>(picture.width) - width), static_cast<float>(picture.height) - 44 * s};
  list.AddRectFilled({from.x - 14 * s, from.y - 24 * s}, {from.x + width + 14 * s, from.y + height + 22 * s},
                     IM_COL32(252, 252, 254, 225), 8 * s);
  constexpr int kSteps = 44;
  for (int i = 0; i < kSteps; ++i) {
    const float left = from.x + width * static_cast<float>(i) / kSteps;
    list.AddRectFilled({left, from.y}, {left + width / kSteps + 0.5F, from.y + height},
                       colour_of(scale_colour((static_cast<float>(i) + 0.5F) / kSteps)));
  }
  const ImU32 ink = IM_COL32(30, 34, 42, 255);
  const auto write = [&](const std::string& text, float share, float y) {
    const ImVec2 size = style.text->CalcTextSizeA(style.text->FontSize, 1e6F, 0, text.c_str());
    list.AddText(style.text, style.text->FontSize, {from.x + share * (width - size.x), y}, ink, text.c_str());
  };
  write(name, 0.5F, from.y - 20 * s);
  write("0", 0, from.y + height + 3 * s);
  write(with_unit(most, unit), 1, from.y + height + 3 * s);
}

}  // namespace

void draw_overlay(const Style& style, const Snapshot& snapshot, const SceneDrawing& drawing, Studio& studio,
                  const PictureSize& picture) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  if (studio.look().bones) draw_bones(style, snapshot, studio, picture, list);
  draw_pins(style, snapshot, studio, picture, list);
  draw_grips(style, snapshot, studio, picture, list);
  draw_names(style, drawing, studio, picture, list);
  if (studio.interface) draw_scale(style, drawing.most(), studio.look().colouring, picture, list);
}

void draw_help(const Style& style) {
  constexpr std::array<std::pair<const char*, const char*>, 22> kKeys{
      {{"drag a body", "pull at it; let go to throw it"},
       {"drag an obstacle", "push with it"},
       {"drag a joint", "turn the bone that it hangs on; a root is shifted"},
       {"P over a body", "pin it there; again lets it go"},
       {"drag elsewhere", "look from another side"},
       {"right or middle button", "move the picture"},
       {"wheel", "nearer, farther"},
       {"space", "pause, play"},
       {"right arrow", "one step; with shift ten"},
       {"R", "reset"},
       {"- and +", "slower, faster"},
       {"F", "all in the picture"},
       {"C", "colour: plain, displacement, strain energy, contact force"},
       {"W", "wireframe"},
       {"E", "cubature elements"},
       {"B", "bones, whose joints can be dragged"},
       {"X", "examples beside the body"},
       {"T", "the target where the body is"},
       {"G", "gravity on and off"},
       {"H", "hide and show the interface"},
       {"?", "this page"},
       {"Q", "quit"}}};
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({0.5F * display.x, 0.5F * display.y}, ImGuiCond_Always, {0.5F, 0.5F});
  ImGui::SetNextWindowBgAlpha(0.98F);
  ImGui::Begin("##help", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoSavedSettings);
  ImGui::PushFont(style.title);
  ImGui::TextUnformatted("Mouse and keys");
  ImGui::PopFont();
  ImGui::Separator();
  for (const auto& [key, what] : kKeys) {
    ImGui::TextUnformatted(key);
    ImGui::SameLine(178 * style.scale);
    ImGui::TextUnformatted(what);
  }
  ImGui::End();
}

void draw_message(const Style& style, const Studio& studio) {
  if (studio.message().empty()) return;
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({0.5F * display.x, 14 * style.scale}, ImGuiCond_Always, {0.5F, 0});
  ImGui::SetNextWindowSizeConstraints({0, 0}, {0.42F * display.x, display.y});
  ImGui::Begin("##message", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoInputs |
                   ImGuiWindowFlags_NoSavedSettings);
  ImGui::PushTextWrapPos(0.40F * display.x);
  ImGui::TextUnformatted(studio.message().c_str());
  ImGui::PopTextWrapPos();
  ImGui::End();
}

}  // namespace exmat::viewer

#include "runtime/viewer/panels/plots.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <string>

namespace exmat::viewer {
namespace {

constexpr float kPlotWidth = 252, kPlotMargin = 12, kPlotHeight = 58;

/// Lines over the last while, zero marked.
void plot(const Style& style, const Series& series, float least, float most) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const ImVec2 size{ImGui::GetContentRegionAvail().x, kPlotHeight * style.scale};
  ImDrawList* const list = ImGui::GetWindowDrawList();
  list->AddRectFilled(at, {at.x + size.x, at.y + size.y}, IM_COL32(40, 50, 70, 14), 4 * style.scale);
  const float range = most > least ? most - least : 1;
  const auto height = [&](float value) { return at.y + size.y * (0.96F - 0.92F * (value - least) / range); };
  list->AddLine({at.x, height(0)}, {at.x + size.x, height(0)}, IM_COL32(40, 50, 70, 60));
  for (std::size_t i = 0; i < series.lines(); ++i) {
    const std::vector<float>& line = series.line(i);
    std::vector<ImVec2> points;
    for (std::size_t j = 0; j < line.size(); ++j)
      points.push_back({at.x + size.x * static_cast<float>(j + Series::kLength - line.size()) /
                                   static_cast<float>(Series::kLength - 1),
                        height(line[j])});
    list->AddPolyline(points.data(), static_cast<int>(points.size()), palette_colour(i), 0, 1.8F * style.scale);
  }
  ImGui::Dummy(size);
}

/// A square of a line's colour, its name, and its value at the right.
void key(const Style& style, std::size_t number, const std::string& name, const std::string& value) {
  const float s = style.scale, side = 9 * s;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float down = 0.5F * (ImGui::GetTextLineHeight() - side);
  ImGui::GetWindowDrawList()->AddRectFilled({at.x, at.y + down}, {at.x + side, at.y + down + side},
                                            palette_colour(number), 2 * s);
  ImGui::Dummy({side, ImGui::GetTextLineHeight()});
  ImGui::SameLine(0, 6 * s);
  ImGui::TextUnformatted(name.c_str());
  const float width = ImGui::CalcTextSize(value.c_str()).x;
  ImGui::SameLine(ImGui::GetContentRegionMax().x - width);
  ImGui::TextUnformatted(value.c_str());
}

void heading(const Style& style, const std::string& text) {
  ImGui::Dummy({0, 2 * style.scale});
  ImGui::PushFont(style.title);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopFont();
}

std::string joules(float value) { return with_unit(value, "J"); }

void draw_weights(const Style& style, const History& history, const BodyShape& shape, const Settings& settings) {
  for (std::size_t i = 0; i < history.weights.size() && i < settings.forces.size(); ++i) {
    const std::string& region = settings.forces[i].region;
    heading(style, region.empty() ? "Weights" : "Weights of " + region);
    const Series& series = history.weights[i];
    plot(style, series, 0, 1);
    std::size_t line = 0;
    for (const ShownExample& example : shape.examples) {
      if (example.region != region || line >= series.lines()) continue;
      key(style, line, example.name, fmt::format("{:.2f}", series.line(line).back()));
      ++line;
    }
  }
}

void draw_energies(const Style& style, const History& history) {
  if (history.energies.lines() == 0) return;
  heading(style, "Energies");
  plot(style, history.energies, history.energies.least(), history.energies.most());
  constexpr std::array<const char*, 3> kNames{"kinetic", "elastic", "of gravity"};
  for (std::size_t i = 0; i < kNames.size(); ++i) key(style, i, kNames[i], joules(history.energies.line(i).back()));
}

/// Stages beside each other; nothing of bodies that touch each other, whose stages are not told apart.
void draw_stages(const Style& style, const StageTimes& stages) {
  constexpr float kNone = 0.005F;  // us
  if (std::none_of(stages.microseconds.begin(), stages.microseconds.end() - 1,
                   [](float time) { return time > kNone; }))  // all but the rest
    return;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const ImVec2 size{ImGui::GetContentRegionAvail().x, 12 * style.scale};
  ImDrawList* const list = ImGui::GetWindowDrawList();
  list->AddRectFilled(at, {at.x + size.x, at.y + size.y}, IM_COL32(40, 50, 70, 24), 3 * style.scale);
  float from = 0;
  const float whole = std::max(stages.total, 1e-6F);
  for (std::size_t i = 0; i < StageTimes::kStages; ++i) {
    const float to = std::min(1.0F, from + stages.microseconds[i] / whole);
    list->AddRectFilled({at.x + from * size.x, at.y}, {at.x + to * size.x, at.y + size.y}, palette_colour(i));
    from = to;
  }
  ImGui::Dummy(size);
  for (std::size_t i = 0; i < StageTimes::kStages; ++i)
    if (stages.microseconds[i] > kNone)
      key(style, i, StageTimes::kNames[i], fmt::format("{:.1f} us", stages.microseconds[i]));
}

/// Against the time that a step may take in real time.
void draw_times(const Style& style, const Snapshot& snapshot, const History& history) {
  const StageTimes& stages = history.stages;
  heading(style, "A step");
  const auto bodies = static_cast<float>(snapshot.bodies.size());
  const float budget = 1e6F * static_cast<float>(snapshot.time_step) / bodies;
  draw_stages(style, stages);
  ImGui::Text("%.1f us of %.0f us: %.1f %%", stages.total, budget, 100 * stages.total / budget);
  if (ImGui::IsItemHovered())
    ImGui::SetTooltip(
        "What a step of a body takes, and what it may take\nfor all bodies to move in real time on one core");
  ImGui::Text("%.1f Newton iterations", stages.newton_iterations);
}

void draw_status(const Style& style, const Snapshot& snapshot, const History& history, double frame_seconds) {
  heading(style, "Now");
  if (!snapshot.grips.empty()) ImGui::Text("hand: %s", with_unit(snapshot.grips.back().force.norm(), "N").c_str());
  if (frame_seconds > 0) ImGui::Text("%.0f pictures a second, %.2f x real time", 1 / frame_seconds, snapshot.speed);
  std::size_t contacts = 0;
  for (const BodySnapshot& body : snapshot.bodies) contacts += body.contacts.size();
  if (contacts > 0) ImGui::Text("%zu vertices touch", contacts);
  const std::vector<std::string> words = status_words(history.status);
  if (words.empty() && snapshot.failure.empty()) ImGui::TextUnformatted("all steps converged");
  for (const std::string& word : words) ImGui::TextWrapped("%s", word.c_str());
  if (!snapshot.failure.empty()) ImGui::TextWrapped("stopped: %s", snapshot.failure.c_str());
}

/// From green to red: in between by way of yellow, so that lightness tells, too.
ImU32 warning_colour(double share) {
  constexpr std::array<Colour, 3> kStops{{{0.00F, 0.50F, 0.38F}, {0.93F, 0.72F, 0.16F}, {0.76F, 0.20F, 0.02F}}};
  const float at = 2 * std::clamp(static_cast<float>(share), 0.0F, 1.0F);
  const std::size_t first = at < 1 ? 0 : 1;
  const float rest = at - static_cast<float>(first);
  Colour colour{};
  for (std::size_t i = 0; i < 3; ++i) colour[i] = (1 - rest) * kStops[first][i] + rest * kStops[first + 1][i];
  return colour_of(colour);
}

void draw_lost(const Style& style, const char* what, double lost) {
  constexpr double kLittle = 0.15, kMuch = 0.45;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const ImVec2 size{ImGui::GetContentRegionAvail().x, 10 * style.scale};
  ImDrawList* const list = ImGui::GetWindowDrawList();
  list->AddRectFilled(at, {at.x + size.x, at.y + size.y}, IM_COL32(40, 50, 70, 24), 3 * style.scale);
  list->AddRectFilled(at, {at.x + size.x * static_cast<float>(std::max(lost, 0.01)), at.y + size.y},
                      warning_colour(lost), 3 * style.scale);
  ImGui::Dummy(size);
  const std::string share = fmt::format("{:.0f}\u00a0%", 100 * lost);
  const std::string text =
      lost < kLittle ? fmt::format("The basis answers this {}: {} of its work is lost.", what, share)
      : lost < kMuch
          ? fmt::format("The basis answers this {} in part: {} of its work is lost.", what, share)
          : fmt::format(
                "This {} needs modes that the basis has not: {} of its work is lost. Add it to the asset's training.",
                what, share);
  ImGui::TextWrapped("%s", text.c_str());
}

/// Why bodies step in all vertices.
std::string full_space_text(const Snapshot& snapshot, std::size_t full, bool on_bones) {
  const std::string which = snapshot.bodies.size() == 1
                                ? "The body steps"
                                : fmt::format("{} of {} bodies step", full, snapshot.bodies.size());
  if (on_bones) return which + " in all vertices: bones are a load that no basis has learned.";
  return which + (snapshot.grips.empty() ? " in all vertices: something acts that the basis was not made for."
                                         : " in all vertices: the hand is answered without a basis.");
}

void draw_basis(const Style& style, const Snapshot& snapshot, const Studio& studio) {
  const auto full =
      std::ranges::count_if(snapshot.bodies, [](const BodySnapshot& body) { return !body.positions.empty(); });
  if (full > 0) {
    const bool on_bones = std::ranges::any_of(studio.shapes(), [](const auto& shape) { return shape->on_bones(); });
    heading(style, "All vertices");
    ImGui::TextWrapped("%s", full_space_text(snapshot, static_cast<std::size_t>(full), on_bones).c_str());
  }
  const LostWork& lost = studio.lost_work();
  if (!lost.measured) {
    heading(style, "The basis");
    ImGui::TextWrapped("What it loses is not measured: the mesh is too large.");
  }
  if (!lost.hand && !lost.contact) return;
  heading(style, "The basis");
  if (lost.hand) draw_lost(style, "push", *lost.hand);
  if (lost.contact) draw_lost(style, "contact", *lost.contact);
}

}  // namespace

void draw_plots(const Style& style, const Snapshot& snapshot, const History& history, const Studio& studio,
                const std::vector<std::shared_ptr<const BodyShape>>& shapes, double frame_seconds) {
  const float s = style.scale;
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({display.x - (kPlotWidth + kPlotMargin) * s, kPlotMargin * s});
  ImGui::SetNextWindowSize({kPlotWidth * s, 0});
  ImGui::SetNextWindowSizeConstraints({kPlotWidth * s, 0}, {kPlotWidth * s, display.y - 2 * kPlotMargin * s});
  ImGui::Begin("##plots", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize |
                   ImGuiWindowFlags_NoSavedSettings);
  draw_status(style, snapshot, history, frame_seconds);
  draw_basis(style, snapshot, studio);
  draw_weights(style, history, *shapes.front(), studio.settings(0));
  draw_energies(style, history);
  draw_times(style, snapshot, history);
  ImGui::End();
}

}  // namespace exmat::viewer

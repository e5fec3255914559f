#include "runtime/viewer/panels/controls.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <imgui_stdlib.h>
#include <string>
#include <vector>

namespace exmat::viewer {
namespace {

constexpr float kWidth = 272, kMargin = 12, kLabel = 104;

/// The name at the left, the control that follows at the right of it.
void label(const char* text, const char* help = nullptr) {
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(text);
  if (help != nullptr && ImGui::IsItemHovered()) ImGui::SetTooltip("%s", help);
  ImGui::SameLine(kLabel * ImGui::GetFontSize() / 13);
  ImGui::SetNextItemWidth(-1);
}

bool slider(const char* name, const char* help, double& value, double least, double most, const char* format) {
  label(name, help);
  ImGui::PushID(name);
  const bool changed = ImGui::SliderScalar("##value", ImGuiDataType_Double, &value, &least, &most, format,
                                           ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_NoRoundToFormat);
  ImGui::PopID();
  value = std::max(value, 0.0);
  return changed;
}

bool share(const char* name, const char* help, double& value) {
  label(name, help);
  ImGui::PushID(name);
  constexpr double kNone = 0, kAll = 1;
  const bool changed =
      ImGui::SliderScalar("##value", ImGuiDataType_Double, &value, &kNone, &kAll, "%.2f", ImGuiSliderFlags_AlwaysClamp);
  ImGui::PopID();
  return changed;
}

template <std::size_t N>
void choice(const char* name, const char* help, std::string& value, const std::array<const char*, N>& names) {
  label(name, help);
  ImGui::PushID(name);
  if (ImGui::BeginCombo("##value", value.c_str())) {
    for (const char* const entry : names)
      if (ImGui::Selectable(entry, value == entry)) value = entry;
    ImGui::EndCombo();
  }
  ImGui::PopID();
}

/// The others share what is left, in their proportions.
void balance(std::vector<double>& weights, std::size_t changed) {
  double others = 0;
  for (std::size_t i = 0; i < weights.size(); ++i)
    if (i != changed) others += weights[i];
  const double left = 1 - weights[changed];
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (i == changed) continue;
    weights[i] = others > 0 ? weights[i] * left / others : left / static_cast<double>(weights.size() - 1);
  }
}

std::vector<std::string> names_of(const BodyShape& shape, const std::string& region) {
  std::vector<std::string> names;
  for (const ShownExample& example : shape.examples)
    if (example.region == region) names.push_back(example.name);
  return names;
}

/// `now`: the weights of the last step, which keys of the scene have brought about until a slider is moved.
void draw_weights(ForceSettings& force, const std::vector<std::string>& names, const std::vector<double>& now) {
  label("weights", "Given: the body goes to this blend. Else they are those of its shape.");
  if (ImGui::Checkbox("given##weights", &force.given)) force.keyed = false;
  if (!force.given) return;
  std::vector<double> weights = force.keyed ? now : force.weights;
  for (std::size_t i = 0; i < weights.size() && i < names.size(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    if (share(names[i].c_str(), nullptr, weights[i])) {
      if (weights.size() > 1) balance(weights, i);
      force.keyed = false;
    }
    ImGui::PopID();
  }
  if (!force.keyed) force.weights = std::move(weights);
}

void draw_force(ForceSettings& force, const std::vector<std::string>& names, const std::vector<double>& now) {
  const bool elastic = force.law == "elastic";
  const std::string title = force.region.empty() ? "whole body" : force.region;
  ImGui::Checkbox(title.c_str(), &force.on);
  if (!force.on) return;
  slider(elastic ? "factor" : "kappa",
         elastic ? "As stiff as the material: 1" : "Stiffness of the example force [1/s^2]", force.stiffness,
         elastic ? 0.01 : 1, elastic ? 100 : 1e6, elastic ? "%.3g" : "%.4g 1/s^2");
  slider("damping", "c_kappa [1/s]", force.damping, 0, 1000, "%.3g 1/s");
  share("bias", "Factor on the weight of the rest pose: 1 changes nothing, 0 leaves it out", force.bias);
  choice("target", "table: from the bundle; solve: by Newton's method", force.target,
         std::array<const char*, 3>{"auto", "table", "solve"});
  draw_weights(force, names, now);
}

}  // namespace

void Controls::draw(const Style& style, const Snapshot& snapshot, Studio& studio) {
  const float s = style.scale, height = ImGui::GetIO().DisplaySize.y;
  ImGui::SetNextWindowPos({kMargin * s, kMargin * s});
  ImGui::SetNextWindowSize({kWidth * s, 0});
  ImGui::SetNextWindowSizeConstraints({kWidth * s, 0}, {kWidth * s, height - 2 * kMargin * s});
  ImGui::Begin("##controls", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize |
                   ImGuiWindowFlags_NoSavedSettings);
  draw_run(style, snapshot, studio);
  draw_kind(studio);
  Settings settings = studio.settings(kind_);
  if (!settings.forces.empty() && ImGui::CollapsingHeader("Examples", ImGuiTreeNodeFlags_DefaultOpen))
    draw_examples(settings, snapshot, studio);
  if (ImGui::CollapsingHeader("View", ImGuiTreeNodeFlags_DefaultOpen)) draw_view(studio);
  if (ImGui::CollapsingHeader("Body")) draw_body(settings);
  if (ImGui::CollapsingHeader("World and hands")) draw_world(style, snapshot, settings, studio);
  if (settings != studio.settings(kind_)) studio.apply(kind_, settings);
  if (ImGui::CollapsingHeader("Save as scene")) draw_saving(studio);
  ImGui::End();
}

void Controls::draw_run(const Style& style, const Snapshot& snapshot, Studio& studio) {
  ImGui::PushFont(style.title);
  ImGui::TextUnformatted(title_.c_str());
  ImGui::PopFont();
  Runner& runner = studio.runner();
  const float width = (ImGui::GetContentRegionAvail().x - 2 * ImGui::GetStyle().ItemSpacing.x) / 3;
  if (ImGui::Button(runner.paused() ? "Play" : "Pause", {width, 0})) studio.toggle_pause();
  ImGui::SameLine();
  if (ImGui::Button("Step", {width, 0})) {
    runner.set_paused(true);
    runner.step(1);
  }
  ImGui::SameLine();
  if (ImGui::Button("Reset", {width, 0})) studio.reset();
  double speed = runner.speed();
  if (slider("speed", "Simulated over real time", speed, 0.02, 4, "%.2f x"))
    runner.set_speed(std::clamp(speed, 0.001, 100.0));
  label("time");
  ImGui::Text("%.3f s, step %lld", snapshot.time, static_cast<long long>(snapshot.steps));
}

void Controls::draw_kind(Studio& studio) {
  if (studio.shapes().size() < 2) return;
  label("settings of");
  const std::vector<std::string>& names = studio.kind_names();
  if (!ImGui::BeginCombo("##kind", names[kind_].c_str())) return;
  for (std::size_t i = 0; i < names.size(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    if (ImGui::Selectable(names[i].c_str(), i == kind_)) kind_ = i;
    ImGui::PopID();
  }
  ImGui::EndCombo();
}

void Controls::draw_examples(Settings& settings, const Snapshot& snapshot, Studio& studio) {
  const auto first = std::ranges::find(studio.kinds_of_bodies(), kind_) - studio.kinds_of_bodies().begin();
  const auto& weights = snapshot.bodies[static_cast<std::size_t>(first)].weights;
  for (std::size_t i = 0; i < settings.forces.size(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    draw_force(settings.forces[i], names_of(*studio.shapes()[kind_], settings.forces[i].region), weights[i]);
    ImGui::PopID();
  }
}

void Controls::draw_body(Settings& settings) {
  slider("mass damping", "Rayleigh: alpha [1/s]", settings.mass_damping, 0, 100, "%.3g 1/s");
  slider("stiffness d.", "Rayleigh: beta [s]", settings.stiffness_damping, 0, 1, "%.3g s");
  choice("integrator", nullptr, settings.integrator, std::array<const char*, 3>{"bdf2", "backward_euler", "newmark"});
  choice("internal force", "How it is evaluated; auto: as the bundle says", settings.internal_force,
         std::array<const char*, 3>{"auto", "cubature", "polynomial"});
  choice("space", "Modes, all vertices, or all while a hand or an obstacle acts", settings.space,
         std::array<const char*, 3>{"reduced", "full", "auto"});
  label("time step", "The body goes on with its shape and motion; Enter takes it");
  double milliseconds = 1e3 * settings.time_step;
  if (ImGui::InputDouble("##step", &milliseconds, 0, 0, "%.4g ms", ImGuiInputTextFlags_EnterReturnsTrue) &&
      milliseconds > 0)
    settings.time_step = 1e-3 * milliseconds;
}

void Controls::draw_world(const Style& style, const Snapshot& snapshot, Settings& settings, Studio& studio) {
  label("gravity", "[m/s^2]");
  ImGui::DragScalarN("##gravity", ImGuiDataType_Double, settings.gravity.data(), 3, 0.05F, nullptr, nullptr, "%.2f");
  Runner& runner = studio.runner();
  double strength = runner.with([](Simulation& simulation) { return simulation.strength(); });
  if (slider("hand", "Strength of the spring to the mouse", strength, 0.01, 2, "%.2f"))
    runner.with([&](Simulation& simulation) { simulation.set_strength(std::max(strength, 1e-3)); });
  if (!studio.has_contact()) {
    ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyle().Colors[ImGuiCol_TextDisabled]);
    ImGui::TextWrapped("No obstacles: the bundle has no contact. Precompute it with \"needs\": [\"contact\"].");
    ImGui::PopStyleColor();
    return;
  }
  constexpr std::array<const char*, 6> kShapes{"plane", "sphere", "box", "capsule", "mesh", "ground"};
  ImGui::TextUnformatted("add");
  for (std::int32_t shape = EXMAT_PLANE; shape <= EXMAT_CAPSULE; ++shape) {
    ImGui::SameLine(0, 4 * style.scale);
    if (ImGui::SmallButton(kShapes[static_cast<std::size_t>(shape)])) studio.add_obstacle(shape);
  }
  for (std::size_t i = 0; i < snapshot.obstacles.size(); ++i) {
    const exmat_obstacle& obstacle = snapshot.obstacles[i].obstacle;
    ImGui::PushID(static_cast<int>(i));
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(kShapes[static_cast<std::size_t>(obstacle.shape)]);
    ImGui::SameLine(56 * style.scale);
    ImGui::SetNextItemWidth(-62 * style.scale);
    double friction = obstacle.friction;
    constexpr double kNone = 0, kMost = 2;
    if (ImGui::SliderScalar("##friction", ImGuiDataType_Double, &friction, &kNone, &kMost, "friction %.2f"))
      runner.with([&](Simulation& simulation) {
        simulation.set_obstacle_law(i, obstacle.stiffness, obstacle.damping, std::max(friction, 0.0));
      });
    ImGui::SameLine();
    if (ImGui::SmallButton("remove")) studio.remove_obstacle(i);
    ImGui::PopID();
  }
}

void Controls::draw_view(Studio& studio) {
  Look& look = studio.look();
  constexpr std::array<const char*, 4> kColourings{"plain", "displacement", "strain energy", "contact force"};
  std::string colouring = kColourings[static_cast<std::size_t>(look.colouring)];
  choice("colour", nullptr, colouring, kColourings);
  look.colouring = static_cast<Colouring>(std::ranges::find(kColourings, colouring) - kColourings.begin());
  const float half = 0.5F * ImGui::GetContentRegionAvail().x;
  const auto pair = [&](const char* first, bool& a, const char* second, bool& b) {
    ImGui::Checkbox(first, &a);
    ImGui::SameLine(half);
    ImGui::Checkbox(second, &b);
  };
  pair("surface", look.surface, "wireframe", look.wireframe);
  const bool examples = look.examples;
  pair("examples", look.examples, "target", look.targets);
  if (look.examples != examples) studio.frame_next = true;
  pair("elements", look.elements, "floor", look.floor);
  if (std::ranges::any_of(studio.shapes(), [](const auto& shape) { return shape->on_bones(); }))
    ImGui::Checkbox("bones", &look.bones);
}

void Controls::draw_saving(Studio& studio) {
  ImGui::SetNextItemWidth(-1);
  ImGui::InputText("##file", &save_name_);
  if (ImGui::Button("Save", {-1, 0})) studio.save_scene(save_name_);
}

}  // namespace exmat::viewer

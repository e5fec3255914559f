#include "runtime/api/settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <string>

#include "common/core/number_limits.h"
#include "runtime/api/failures.h"
#include "runtime/api/settings_ranges.h"

namespace exmat::runtime {
namespace {

static_assert(kSettingsSizes.now >= kSettingsSizes.first && kReportSizes.now >= kReportSizes.first);
static_assert(kMotionSizes.now >= kMotionSizes.first && kEnergiesSizes.now >= kEnergiesSizes.first);

/// The choice of a number, which counts as the enumeration does.
template <Named Choice>
Choice choice_of(std::int32_t value, const char* member) {
  constexpr std::size_t kCount = kNames<Choice>.size();
  if (value < 0 || static_cast<std::size_t>(value) >= kCount)
    throw InvalidArgument(fmt::format("settings.{} = {}: expected 0 to {}", member, value, kCount - 1));
  return static_cast<Choice>(value);
}

/// Callers that were compiled with an older version leave out members, those with a newer one may set none that are
/// not known here.
exmat_settings completed(const exmat_settings* given) {
  exmat_settings settings = default_settings();
  if (given == nullptr) return settings;
  const std::size_t size = given->size;
  if (size < kSettingsSizes.first || size > kMostStructBytes)
    throw InvalidArgument(
        fmt::format("settings.size = {}: expected {}, sizeof(exmat_settings); begin "
                    "with the default settings",
                    size, sizeof settings));
  const auto* const bytes = reinterpret_cast<const unsigned char*>(given);
  if (size > sizeof settings && std::any_of(bytes + sizeof settings, bytes + size, [](auto byte) { return byte != 0; }))
    throw InvalidArgument("settings: a member that this version of the library does not know is set");
  std::memcpy(&settings, given, std::min(size, sizeof settings));
  return settings;
}

void check_numbers(const exmat_settings& settings) {
  const std::array<std::pair<const char*, double>, 11> members{{{"time_step", settings.time_step},
                                                                {"gravity[0]", settings.gravity[0]},
                                                                {"gravity[1]", settings.gravity[1]},
                                                                {"gravity[2]", settings.gravity[2]},
                                                                {"newton_tolerance", settings.newton_tolerance},
                                                                {"example_stiffness", settings.example_stiffness},
                                                                {"example_damping", settings.example_damping},
                                                                {"example_bias", settings.example_bias},
                                                                {"sleep_energy", settings.sleep_energy},
                                                                {"sleep_time", settings.sleep_time},
                                                                {"space_release", settings.space_release}}};
  for (const auto& [name, value] : members)
    if (!is_near(value))
      throw InvalidArgument(
          fmt::format("settings.{} = {}: expected a finite number, of at most {:g}", name, value, kFarthest));
  // A step that more of these breaks says so.
  for (const auto& [name, value] :
       {std::pair("mass_damping", settings.mass_damping), std::pair("stiffness_damping", settings.stiffness_damping)})
    if (!std::isfinite(value))
      throw InvalidArgument(fmt::format("settings.{} = {}: expected a finite number", name, value));
}

}  // namespace

exmat_settings default_settings() {
  const SceneConfig scene;
  const ExampleForceConfig examples;
  exmat_settings settings{};
  settings.size = sizeof settings;
  settings.time_step = scene.time_step;
  settings.mass_damping = scene.mass_damping;
  settings.stiffness_damping = scene.stiffness_damping;
  settings.newton_tolerance = scene.newton.tolerance;
  settings.newton_iterations = scene.newton.max_iterations;
  settings.example_stiffness = examples.stiffness;
  settings.example_damping = examples.damping;
  settings.example_bias = examples.bias;
  settings.target_iterations = examples.target_iterations;
  settings.sleep_energy = scene.sleep.energy;
  settings.sleep_time = scene.sleep.time;
  settings.space_release = scene.space.release;
  return settings;
}

SceneConfig scene_of(const std::filesystem::path& bundle, const exmat_settings* given) {
  const exmat_settings settings = completed(given);
  check_numbers(settings);
  check_ranges(settings);
  SceneConfig scene;
  scene.file = "settings";
  scene.bundle = bundle;
  scene.time_step = settings.time_step;
  scene.gravity = Eigen::Vector3d(settings.gravity);
  scene.integrator = choice_of<Integrator>(settings.integrator, "integrator");
  scene.internal_force = choice_of<ForceMethod>(settings.internal_force, "internal_force");
  scene.mass_damping = settings.mass_damping;
  scene.stiffness_damping = settings.stiffness_damping;
  scene.newton = {settings.newton_iterations, settings.newton_tolerance};
  scene.sleep = {settings.sleep_energy, settings.sleep_time};
  scene.precision = choice_of<Precision>(settings.precision, "precision");
  scene.space.space = choice_of<Space>(settings.space, "space");
  scene.space.release = settings.space_release;
  ExampleForceConfig examples;
  examples.stiffness = settings.example_stiffness;
  examples.damping = settings.example_damping;
  examples.bias = settings.example_bias;
  examples.target = choice_of<TargetSource>(settings.example_target, "example_target");
  examples.target_iterations = settings.target_iterations;
  examples.energy_reference = choice_of<EnergyReference>(settings.energy_reference, "energy_reference");
  if (settings.use_examples == 1) scene.examples = examples;
  scene.meets_others = settings.use_contact == 1;
  return scene;
}

}  // namespace exmat::runtime

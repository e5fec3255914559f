#include "runtime/api/settings_ranges.h"

#include <fmt/format.h>

#include "common/config/json_file.h"
#include "common/core/error.h"
#include "runtime/api/failures.h"

namespace exmat::runtime {

using Json = nlohmann::json;

void check_ranges(const exmat_settings& settings) {
  Json scene{{"bundle", "a bundle"},
             {"time_step", settings.time_step},
             {"gravity", settings.gravity},
             {"damping", {{"mass", settings.mass_damping}, {"stiffness", settings.stiffness_damping}}},
             {"newton", {{"max_iterations", settings.newton_iterations}, {"tolerance", settings.newton_tolerance}}},
             {"space_release", settings.space_release},
             {"examples",
              {{"stiffness", settings.example_stiffness},
               {"damping", settings.example_damping},
               {"bias", settings.example_bias},
               {"target_iterations", settings.target_iterations}}}};
  // 0 is what a scene file says by having none.
  scene["sleep"] = {{"energy", settings.sleep_energy == 0 ? 1 : settings.sleep_energy}, {"time", settings.sleep_time}};
  try {
    check_against_schema(scene, "scene", "settings");
  } catch (const InputError& error) {
    throw InvalidArgument(error.what());
  }
  if (settings.use_examples != 0 && settings.use_examples != 1)
    throw InvalidArgument(fmt::format("settings.use_examples = {}: expected 0 or 1", settings.use_examples));
  if (settings.use_contact != 0 && settings.use_contact != 1)
    throw InvalidArgument(fmt::format("settings.use_contact = {}: expected 0 or 1", settings.use_contact));
}

}  // namespace exmat::runtime

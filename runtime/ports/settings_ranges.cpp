#include "runtime/api/settings_ranges.h"

#include <fmt/format.h>
#include <initializer_list>
#include <string_view>

#include "common/config/embedded_schema.h"
#include "common/core/plain_json.h"
#include "runtime/api/failures.h"

namespace exmat::runtime {
namespace {

// The rules of a number in schemas/scene.json: its own, those that it refers to, or those of the alternative that is no
// list of keys.
const PlainJson& rules_of(const PlainJson& scene, const PlainJson& member) {
  if (const PlainJson* const reference = member.find("$ref"))
    return rules_of(scene,
                    scene.at("definitions").at(reference->text().substr(std::string_view("#/definitions/").size())));
  for (const char* const choice : {"oneOf", "anyOf"})
    if (const PlainJson* const alternatives = member.find(choice))
      return rules_of(scene, alternatives->items().front());
  return member;
}

void check(const PlainJson& scene, std::initializer_list<const char*> path, double value) {
  const PlainJson* member = &scene;
  std::string place;
  for (const char* const name : path) {
    member = &member->at("properties").at(name);
    place += std::string("/") + name;
  }
  const PlainJson& rules = rules_of(scene, *member);
  const auto refuse = [&](const char* relation, double limit) {
    throw InvalidArgument(
        fmt::format("settings: {}: expected a number {} {}, found {}", place, relation, limit, value));
  };
  if (const PlainJson* const limit = rules.find("minimum"); limit != nullptr && value < limit->number())
    refuse(">=", limit->number());
  if (const PlainJson* const limit = rules.find("maximum"); limit != nullptr && value > limit->number())
    refuse("<=", limit->number());
  if (const PlainJson* const limit = rules.find("exclusiveMinimum"); limit != nullptr && value <= limit->number())
    refuse(">", limit->number());
  if (const PlainJson* const limit = rules.find("exclusiveMaximum"); limit != nullptr && value >= limit->number())
    refuse("<", limit->number());
}

}  // namespace

void check_ranges(const exmat_settings& settings) {
  static const PlainJson scene = PlainJson::parse(embedded_schema("scene"));
  check(scene, {"time_step"}, settings.time_step);
  check(scene, {"damping", "mass"}, settings.mass_damping);
  check(scene, {"damping", "stiffness"}, settings.stiffness_damping);
  check(scene, {"newton", "max_iterations"}, settings.newton_iterations);
  check(scene, {"newton", "tolerance"}, settings.newton_tolerance);
  check(scene, {"space_release"}, settings.space_release);
  check(scene, {"examples", "stiffness"}, settings.example_stiffness);
  check(scene, {"examples", "damping"}, settings.example_damping);
  check(scene, {"examples", "bias"}, settings.example_bias);
  check(scene, {"examples", "target_iterations"}, settings.target_iterations);
  if (settings.sleep_energy != 0) check(scene, {"sleep", "energy"}, settings.sleep_energy);
  check(scene, {"sleep", "time"}, settings.sleep_time);
  for (const std::int32_t flag : {settings.use_examples, settings.use_contact})
    if (flag != 0 && flag != 1) throw InvalidArgument(fmt::format("settings: expected 0 or 1, found {}", flag));
}

}  // namespace exmat::runtime

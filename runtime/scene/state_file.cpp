#include "runtime/scene/state_file.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/config/json_file.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "runtime/scene/state_json.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr int kOfOneKind = 1;  // version of files without what bodies remember of each other

void check_run(const std::filesystem::path& file, const Json& document, const LoadedScene& loaded,
               const Bodies& bodies) {
  const auto refuse = [&](const char* place, std::string expected, std::string found) {
    throw InputError({file.string(), place, std::move(expected), std::move(found),
                      "take the bundle and the scene that the state was written with"});
  };
  if (document["format_version"] != kOfOneKind || !document.contains("bundle_input_sha256"))
    refuse("/format_version", "a state of a scene of one body", "one of several");
  const std::string bundle = document["bundle_input_sha256"];
  if (bundle != loaded.summary.input_sha256)
    refuse("/bundle_input_sha256", "\"" + loaded.summary.input_sha256 + "\", that of the scene's bundle",
           '"' + bundle + '"');
  const double time_step = document["time_step"];
  if (time_step != loaded.scene.time_step)
    refuse("/time_step", fmt::format("{}, that of the scene", loaded.scene.time_step), fmt::format("{}", time_step));
  if (document["bodies"].size() != static_cast<std::size_t>(bodies.count()))
    refuse("/bodies", fmt::format("{}, the scene's instances", bodies.count()),
           fmt::format("{}", document["bodies"].size()));
}

}  // namespace

void write_states(const Bodies& bodies, const LoadedScene& loaded, const std::filesystem::path& file) {
  OrderedJson document{{"format", "exmat-state"},
                       {"format_version", kOfOneKind},
                       {"program", generator_name()},
                       {"bundle_input_sha256", loaded.summary.input_sha256},
                       {"time_step", loaded.scene.time_step},
                       {"bodies", OrderedJson::array()}};
  for (int i = 0; i < bodies.count(); ++i) document["bodies"].push_back(state_to_json(bodies[i], *loaded.model->frame));
  write_file_atomically(file, document.dump(1) + "\n");
}

void read_states(const std::filesystem::path& file, const LoadedScene& loaded, Bodies& bodies) {
  const Json document = read_json(file);
  check_against_schema(document, "state", file);
  check_run(file, document, loaded, bodies);
  std::vector<State> states(static_cast<std::size_t>(bodies.count()), bodies[0]);
  for (std::size_t i = 0; i < states.size(); ++i)
    read_state(file, fmt::format("/bodies/{}", i), document["bodies"][i], loaded, states[i]);
  for (int i = 0; i < bodies.count(); ++i) bodies[i] = std::move(states[static_cast<std::size_t>(i)]);
}

}  // namespace exmat::runtime

#include "runtime/scene/state_file.h"

#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "common/config/json_file.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "runtime/scene/state_json.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

// Versions: a file of a scene that names a single bundle is without names of bodies and pairs.
constexpr int kOfBundle = 1, kOfList = 2;

int version_of(const WorldConfig& config) { return config.is_list ? kOfList : kOfBundle; }

std::string name_of_version(int version) {
  return version == kOfList ? "a state of a scene that lists its bodies" : "a state of a scene of one \"bundle\"";
}

OrderedJson to_json(const HeldPair& pair) {
  OrderedJson json{{"first", pair.first}, {"second", pair.second}, {"energy", pair.energy}};
  if (std::isfinite(pair.account)) json["account"] = pair.account;
  for (const auto& [name, side] : {std::pair{"first_vertices", 0}, std::pair{"second_vertices", 1}}) {
    json[name] = OrderedJson::array();
    for (const HeldBodyContact& held : pair.held[static_cast<std::size_t>(side)]) {
      json[name].push_back({{"vertex", held.vertex},
                            {"gap", held.gap},
                            {"normal_force", held.normal_force},
                            {"stretch", array_of(held.stretch)},
                            {"side", array_of(held.normal)}});
      if (held.overlap > 0) json[name].back()["overlap"] = held.overlap;
    }
  }
  return json;
}

class Reader {
 public:
  Reader(const std::filesystem::path& file, const Json& document, const LoadedWorld& loaded, const WorldConfig& config)
      : file_(file), document_(document), loaded_(loaded), config_(config) {}

  void check_run() const {
    const int version = document_["format_version"];
    if (version != version_of(config_))
      refuse("/format_version", name_of_version(version_of(config_)), name_of_version(version));
    if (config_.is_list && !document_.contains("pairs")) refuse("/pairs", "the pairs of bodies", "no such member");
    if (!config_.is_list) require_text(document_, "", "bundle_input_sha256", kind_of(0).summary.input_sha256);
    const double written = document_["time_step"];
    if (written != config_.time_step)
      refuse("/time_step", fmt::format("{}, that of the scene", config_.time_step), fmt::format("{}", written));
    if (document_["bodies"].size() != loaded_.bodies.size())
      refuse("/bodies", fmt::format("{}, the scene's bodies", loaded_.bodies.size()),
             fmt::format("{}", document_["bodies"].size()));
  }

  void read_body(std::size_t index, BodiesMemory& memory) const {
    const LoadedBody& body = loaded_.bodies[index];
    const LoadedScene& kind = kind_of(index);
    const Json& from = document_["bodies"][index];
    const std::string place = fmt::format("/bodies/{}", index);
    if (config_.is_list) {
      require_text(from, place, "name", body.name);
      require_text(from, place, "bundle_input_sha256", kind.summary.input_sha256);
    }
    State& state = memory.states[index];
    read_body_state(file_, place, from, kind, state);
    if (state.step != memory.states.front().step)
      refuse(place + "/step", fmt::format("{}, as of the first body", memory.states.front().step),
             fmt::format("{}", state.step));
  }

  void read_pair(std::size_t index, BodiesMemory& memory) const {
    const Json& from = document_["pairs"][index];
    const std::string place = fmt::format("/pairs/{}", index);
    HeldPair pair;
    pair.first = body_number(from, place, "first");
    pair.second = body_number(from, place, "second");
    if (pair.first > pair.second)
      refuse(place + "/second", fmt::format("at least {}, the first", pair.first), fmt::format("{}", pair.second));
    if (!memory.held.empty() &&
        std::pair(memory.held.back().first, memory.held.back().second) >= std::pair(pair.first, pair.second))
      refuse(place, "pairs in ascending order, each once", fmt::format("{} and {}", pair.first, pair.second));
    pair.energy = from.value("energy", 0.0);
    pair.account = from.value("account", std::numeric_limits<double>::infinity());
    read_side(from["first_vertices"], place + "/first_vertices", pair.first, pair.held[0]);
    read_side(from["second_vertices"], place + "/second_vertices", pair.second, pair.held[1]);
    memory.held.push_back(std::move(pair));
  }

 private:
  [[noreturn]] void refuse(const std::string& place, std::string expected, std::string found) const {
    throw InputError({file_.string(), place, std::move(expected), std::move(found),
                      "take the bundles and the scene that the state was written with"});
  }
  const LoadedScene& kind_of(std::size_t body) const { return loaded_.kinds[loaded_.bodies[body].kind].loaded; }

  void require_text(const Json& from, const std::string& place, const char* name, const std::string& expected) const {
    const std::string found = from.value(name, std::string());
    if (found != expected)
      refuse(fmt::format("{}/{}", place, name), fmt::format("\"{}\", that of the scene", expected),
             fmt::format("\"{}\"", found));
  }

  int body_number(const Json& from, const std::string& place, const char* name) const {
    const auto number = from[name].get<std::uint64_t>();
    if (number >= loaded_.bodies.size())
      refuse(fmt::format("{}/{}", place, name), fmt::format("a body below {}", loaded_.bodies.size()),
             fmt::format("{}", number));
    if (!loaded_.kinds[loaded_.bodies[number].kind].surface)
      refuse(fmt::format("{}/{}", place, name), "a body that may touch others", fmt::format("{}", number));
    return static_cast<int>(number);
  }

  void read_side(const Json& from, const std::string& place, int body, std::vector<HeldBodyContact>& held) const {
    const auto vertices =
        static_cast<std::uint64_t>(kind_of(static_cast<std::size_t>(body)).model->contact->vertices());
    for (std::size_t i = 0; i < from.size(); ++i) {
      const Json& entry = from[i];
      const auto vertex = entry["vertex"].get<std::uint64_t>();
      if (vertex >= vertices || (i > 0 && static_cast<int>(vertex) <= held.back().vertex))
        refuse(fmt::format("{}/{}/vertex", place, i), fmt::format("vertices below {} in ascending order", vertices),
               fmt::format("{}", vertex));
      held.push_back({static_cast<int>(vertex), entry["gap"], entry["normal_force"], vector_of(entry["stretch"]),
                      vector_of(entry["side"]), entry.value("overlap", 0.0)});
    }
  }

  const std::filesystem::path& file_;
  const Json& document_;
  const LoadedWorld& loaded_;
  const WorldConfig& config_;
};

}  // namespace

void write_state(const BodiesMemory& memory, const LoadedWorld& loaded, const WorldConfig& config,
                 const std::filesystem::path& file) {
  OrderedJson document{
      {"format", "exmat-state"}, {"format_version", version_of(config)}, {"program", generator_name()}};
  if (!config.is_list) document["bundle_input_sha256"] = loaded.kinds.front().loaded.summary.input_sha256;
  document["time_step"] = config.time_step;
  document["bodies"] = OrderedJson::array();
  for (std::size_t i = 0; i < loaded.bodies.size(); ++i) {
    const LoadedScene& kind = loaded.kinds[loaded.bodies[i].kind].loaded;
    OrderedJson body = OrderedJson::object();
    if (config.is_list) body = {{"name", loaded.bodies[i].name}, {"bundle_input_sha256", kind.summary.input_sha256}};
    body.update(state_to_json(memory.states[i], *kind.model->frame));
    document["bodies"].push_back(std::move(body));
  }
  if (config.is_list) {
    document["pairs"] = OrderedJson::array();
    for (const HeldPair& pair : memory.held) document["pairs"].push_back(to_json(pair));
  }
  write_file_atomically(file, document.dump(1) + "\n");
}

BodiesMemory read_state(const std::filesystem::path& file, const LoadedWorld& loaded, const WorldConfig& config) {
  const Json document = read_json(file);
  check_against_schema(document, "state", file);
  const Reader reader(file, document, loaded, config);
  reader.check_run();
  BodiesMemory memory;
  memory.states = starts_of(loaded);
  for (std::size_t i = 0; i < loaded.bodies.size(); ++i) reader.read_body(i, memory);
  if (config.is_list)
    for (std::size_t i = 0; i < document["pairs"].size(); ++i) reader.read_pair(i, memory);
  return memory;
}

}  // namespace exmat::runtime

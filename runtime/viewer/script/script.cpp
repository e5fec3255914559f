#include "runtime/viewer/script/script.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <set>
#include <string_view>

#include "common/config/json_file.h"
#include "common/core/error.h"

namespace exmat::viewer {
namespace {

using Json = nlohmann::json;

Eigen::Vector3d vector_of(const Json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

// Actions that go on for a while, and for how long [s] where the script does not say.
constexpr std::array<std::pair<const char*, double>, 3> kGoingOn{
    {{"move", 0.5}, {"move_obstacle", 0.5}, {"camera", 0}}};

double duration_of(const Json& what, const char* name) {
  const auto is_it = [&](const auto& entry) { return std::string_view(entry.first) == name; };
  return what[name].value("duration", std::ranges::find_if(kGoingOn, is_it)->second);
}

double end_of(const Json& what) {
  double end = what["time"];
  for (const auto& entry : kGoingOn)
    if (what.contains(entry.first)) end = std::max(end, what["time"].get<double>() + duration_of(what, entry.first));
  return end;
}

template <typename T>
void take(const Json& json, const char* name, T& value) {
  if (json.contains(name)) value = json[name].get<T>();
}

}  // namespace

Script load_script(const std::filesystem::path& file) {
  const Json json = read_json(file);
  check_against_schema(json, "viewer_script", file);
  Script script;
  script.file = file;
  script.frame_rate = json.value("frame_rate", script.frame_rate);
  double last = 0;
  for (std::size_t i = 0; i < json["actions"].size(); ++i) {
    const Json& what = json["actions"][i];
    const std::string place = fmt::format("/actions/{}", i);
    const double time = what["time"];
    if (time < last)
      throw InputError({file.string(), place + "/time", fmt::format("a number >= {} (the action before)", last),
                        fmt::format("{}", time), ""});
    last = time;
    script.duration = std::max(script.duration, end_of(what));
    script.actions.push_back({time, what, place});
  }
  script.duration = json.value("duration", script.duration);
  return script;
}

Eigen::Vector3d ScriptPlayer::Way::at(double time) const {
  if (time >= start + duration) return from + by;
  const double share = std::clamp((time - start) / duration, 0.0, 1.0);
  return from + share * share * (3 - 2 * share) * by;
}

ScriptPlayer::ScriptPlayer(Script script, Studio& studio) : script_(std::move(script)), studio_(studio) { check(); }

void ScriptPlayer::check() const {
  std::set<std::string> hands;
  const std::string file = script_.file.string();
  const std::size_t bodies = studio_.kinds_of_bodies().size();
  const auto require_body = [&](const Json& json, const std::string& place) {
    if (json.value("body", std::size_t{0}) >= bodies)
      throw InputError({file, place + "/body", fmt::format("a body, 0 to {}", bodies - 1),
                        std::to_string(json["body"].get<std::size_t>()), ""});
  };
  const auto require_hand = [&](const std::string& hand, const std::string& place) {
    if (!hands.contains(hand)) throw InputError({file, place, "a hand that holds something", '"' + hand + '"', ""});
  };
  for (const Script::Action& action : script_.actions) {
    const Json& what = action.what;
    if (what.contains("grab")) {
      require_body(what["grab"], action.place + "/grab");
      if (what["grab"].contains("joint")) joint_of(what["grab"], action.place + "/grab");
      hands.insert(what["grab"]["hand"].get<std::string>());
    }
    if (what.contains("move")) require_hand(what["move"]["hand"], action.place + "/move/hand");
    if (what.contains("release")) {
      require_hand(what["release"], action.place + "/release");
      hands.erase(what["release"].get<std::string>());
    }
    if (what.contains("throw")) {
      require_body(what["throw"], action.place + "/throw");
      if (studio_.shapes()[studio_.kinds_of_bodies()[what["throw"].value("body", std::size_t{0})]]->mass == 0)
        throw InputError({file, action.place + "/throw", "a free body", "one with fixed vertices", ""});
    }
    if (what.contains("pin")) require_body(what["pin"], action.place + "/pin");
    if (what.contains("reset") && what["reset"].get<bool>()) hands.clear();
  }
}

void ScriptPlayer::play(double time) {
  while (next_ < script_.actions.size() && script_.actions[next_].time <= time + 1e-9) act(script_.actions[next_++]);
  move(time);
}

void ScriptPlayer::act(const Script::Action& action) {
  const Json& what = action.what;
  move(action.time);
  if (what.value("reset", false)) {
    studio_.reset();
    hands_.clear();
    obstacles_.clear();
  }
  if (what.contains("set")) set(what["set"]);
  if (what.contains("show")) show(what["show"]);
  if (what.value("frame", false)) {
    studio_.frame_next = true;
    sight_.reset();
  }
  if (what.contains("camera")) aim(what["camera"], action.time, duration_of(what, "camera"));
  if (what.contains("grab")) grab(what["grab"]);
  if (what.contains("move")) {
    Hand& hand = hands_.at(what["move"]["hand"]);
    hand.way = Way{action.time, duration_of(what, "move"), hand.at, vector_of(what["move"]["by"])};
  }
  if (what.contains("release")) {
    const auto hand = hands_.find(what["release"].get<std::string>());
    studio_.runner().with([&](Simulation& simulation) { simulation.release(hand->second.grip); });
    hands_.erase(hand);
  }
  if (what.contains("pin"))
    studio_.toggle_pin_near(what["pin"].value("body", std::size_t{0}), vector_of(what["pin"]["point"]));
  if (what.contains("throw")) {
    const Json& thrown = what["throw"];
    const Eigen::Vector3d spin = thrown.contains("spin") ? vector_of(thrown["spin"]) : Eigen::Vector3d::Zero();
    studio_.runner().with([&](Simulation& simulation) {
      simulation.throw_body(thrown.value("body", std::size_t{0}), vector_of(thrown["velocity"]), spin);
    });
  }
  if (what.contains("move_obstacle")) {
    const Json& moved = what["move_obstacle"];
    const std::size_t number = moved["obstacle"];
    const Snapshot snapshot = studio_.runner().with([](Simulation& simulation) { return simulation.snapshot({}); });
    if (number >= snapshot.obstacles.size())
      throw InputError({script_.file.string(), action.place + "/move_obstacle/obstacle",
                        fmt::format("one of {} obstacles", snapshot.obstacles.size()), std::to_string(number), ""});
    obstacles_[number] = Way{action.time, duration_of(what, "move_obstacle"),
                             Eigen::Vector3d(snapshot.obstacles[number].motion.position), vector_of(moved["by"])};
  }
  if (what.contains("step")) studio_.runner().step(what["step"]);
}

/// The joint of its body that a grab names.
std::size_t ScriptPlayer::joint_of(const Json& grab, const std::string& place) const {
  const std::string name = grab["joint"];
  const std::size_t body = grab.value("body", std::size_t{0});
  const std::vector<std::string>& bones = studio_.shapes()[studio_.kinds_of_bodies()[body]]->bones;
  const auto found = std::ranges::find(bones, name);
  if (found == bones.end())
    throw InputError({script_.file.string(), place + "/joint",
                      bones.empty() ? "a body on bones" : fmt::format("a joint: {}", fmt::join(bones, ", ")),
                      bones.empty() ? "one without" : '"' + name + '"', ""});
  return static_cast<std::size_t>(found - bones.begin());
}

void ScriptPlayer::grab(const Json& grab) {
  Hand hand;
  const std::size_t body = grab.value("body", std::size_t{0});
  if (grab.contains("joint"))
    hand.grip =
        studio_.runner().with([&](Simulation& simulation) { return simulation.grab_joint(body, joint_of(grab, "")); });
  else
    hand.grip = studio_.grab_near(body, vector_of(grab["point"]));
  const Snapshot snapshot = studio_.runner().with([](Simulation& simulation) { return simulation.snapshot({}); });
  for (const GripSnapshot& grip : snapshot.grips)
    if (grip.id == hand.grip) hand.at = grip.target - studio_.offsets()[body];
  hands_[grab["hand"]] = hand;
}

void ScriptPlayer::set(const Json& set) {
  const std::vector<std::string>& names = studio_.kind_names();
  const std::string name = set.value("bodies", names.front());
  const auto kind = static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
  if (kind == names.size())
    throw InputError({script_.file.string(), "/actions", fmt::format("bodies of the scene: {}", fmt::join(names, ", ")),
                      '"' + name + '"', ""});
  Settings settings = studio_.settings(kind);
  take(set, "gravity", settings.gravity);
  take(set, "time_step", settings.time_step);
  take(set, "mass_damping", settings.mass_damping);
  take(set, "stiffness_damping", settings.stiffness_damping);
  take(set, "integrator", settings.integrator);
  take(set, "internal_force", settings.internal_force);
  take(set, "space", settings.space);
  const std::string region = set.value("region", std::string());
  const auto force = std::ranges::find(settings.forces, region, &ForceSettings::region);
  const bool of_force =
      std::ranges::any_of(std::initializer_list<const char*>{"on", "stiffness", "damping", "bias", "target", "weights"},
                          [&](const char* member) { return set.contains(member); });
  if (of_force && force == settings.forces.end())
    throw InputError({script_.file.string(), "/actions", "settings of an example force that the scene has",
                      region.empty() ? "those of the whole body" : "those of \"" + region + '"', ""});
  if (of_force) {
    take(set, "on", force->on);
    take(set, "stiffness", force->stiffness);
    take(set, "damping", force->damping);
    take(set, "bias", force->bias);
    take(set, "target", force->target);
    if (set.contains("weights")) {
      force->keyed = false;
      force->given = !set["weights"].empty();
      if (force->given) force->weights = set["weights"].get<std::vector<double>>();
    }
  }
  studio_.apply(kind, settings);
  if (!studio_.message().empty() && studio_.settings(kind) != settings)
    throw InputError({script_.file.string(), "/actions", "settings that can be set", studio_.message(), ""});
  if (set.contains("strength"))
    studio_.runner().with([&](Simulation& simulation) { simulation.set_strength(set["strength"]); });
  if (!set.contains("speed")) return;
  const double speed = set["speed"];
  studio_.runner().set_paused(speed == 0);
  if (speed > 0) studio_.runner().set_speed(speed);
}

void ScriptPlayer::show(const Json& show) {
  Look& look = studio_.look();
  take(show, "surface", look.surface);
  take(show, "wireframe", look.wireframe);
  take(show, "elements", look.elements);
  take(show, "bones", look.bones);
  take(show, "examples", look.examples);
  take(show, "targets", look.targets);
  take(show, "floor", look.floor);
  take(show, "interface", studio_.interface);
  take(show, "help", studio_.help);
  const std::string colour = show.value("colour", std::string());
  if (colour == "plain") look.colouring = Colouring::kPlain;
  if (colour == "displacement") look.colouring = Colouring::kDisplacement;
  if (colour == "strain_energy") look.colouring = Colouring::kStrainEnergy;
  if (colour == "contact_force") look.colouring = Colouring::kContactForce;
}

void ScriptPlayer::aim(const Json& camera, double time, double duration) {
  Camera& now = studio_.camera();
  now.set_field_of_view(camera.value("field_of_view", Camera::kFieldOfView));
  studio_.frame_next = false;
  sight_ = Sight{{time, duration, now.position(), vector_of(camera["position"]) - now.position()},
                 {time, duration, now.target(), vector_of(camera["target"]) - now.target()}};
}

void ScriptPlayer::move(double time) {
  for (auto& named : hands_) {
    auto& hand = named.second;
    if (!hand.way) continue;
    hand.at = hand.way->at(time);
    studio_.runner().with([&](Simulation& simulation) { simulation.move_grip(hand.grip, hand.at); });
  }
  for (const auto& numbered : obstacles_)
    studio_.runner().with(
        [&](Simulation& simulation) { simulation.move_obstacle(numbered.first, numbered.second.at(time)); });
  if (!sight_) return;
  studio_.camera().look(sight_->position.at(time), sight_->target.at(time));
  if (time >= sight_->position.start + sight_->position.duration) sight_.reset();
}

}  // namespace exmat::viewer

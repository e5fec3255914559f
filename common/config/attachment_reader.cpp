#include "common/config/attachment_reader.h"

#include <fmt/format.h>
#include <utility>

#include "common/config/motion_reader.h"
#include "common/config/selection_reader.h"
#include "common/core/error.h"
#include "common/core/nearest_name.h"

namespace exmat {
namespace {

class Reader {
 public:
  Reader(const Json& scene, const std::filesystem::path& file, const std::vector<NamedBodies>& bodies)
      : scene_(scene), file_(file), bodies_(bodies) {}

  /// The kind of the bodies, and of which of them.
  std::pair<std::size_t, AttachmentConfig> read(const Json& json, const std::string& place) const {
    AttachmentConfig config;
    config.place = place;
    const std::size_t kind = find_bodies(json, place + "/body", config.only);
    config.vertices = read_selection(json["vertices"], file_, place + "/vertices");
    config.obstacle = read_obstacle(json, place + "/to");
    config.body = read_body(json, place + "/to", kind, config.only);
    config.motion = read_motion(member_or(json, "motion", Json::array()), file_, place + "/motion");
    if (config.obstacle && !config.motion.empty())
      refuse(place + "/motion", "no motion, since the obstacle has its own", "one");
    if (config.body && !config.motion.empty())
      refuse(place + "/motion", "no motion, since the other body has its own", "one");
    config.kind = choice_or(json, "kind", config.kind);
    for (const char* name : {"stiffness", "damping"})
      if (json.contains(name) && config.kind != AttachmentKind::kSpring)
        refuse(fmt::format("{}/{}", place, name), fmt::format("no {} of what is no spring", name), "one",
               "let kind be \"spring\"");
    config.stiffness = json.value("stiffness", config.stiffness);
    config.damping = json.value("damping", config.damping);
    config.break_force = json.value("break_force", config.break_force);
    return {kind, std::move(config)};
  }

 private:
  [[noreturn]] void refuse(std::string place, std::string expected, std::string found, std::string advice = "") const {
    throw InputError({file_.string(), std::move(place), std::move(expected), std::move(found), std::move(advice)});
  }

  std::string names() const {
    std::string names;
    for (const NamedBodies& own : bodies_) {
      names += fmt::format("{}\"{}\"", names.empty() ? "" : " or ", own.name);
      if (own.count > 1) names += fmt::format(", \"{}_0\" to \"{}_{}\"", own.name, own.name, own.count - 1);
    }
    return names;
  }

  std::size_t find_bodies(const Json& json, const std::string& place, std::optional<std::size_t>& only) const {
    if (!json.contains("body")) {
      if (bodies_.size() == 1) return 0;
      refuse(place, names(), "no such member");
    }
    const Json& body = json["body"];
    return body.is_string() ? find_name(body, place, only) : find_number(body, place, only);
  }

  std::size_t find_number(const Json& body, const std::string& place, std::optional<std::size_t>& only) const {
    auto left = body.get<std::uint64_t>();
    std::size_t count = 0;
    for (std::size_t kind = 0; kind < bodies_.size(); ++kind) {
      count += bodies_[kind].count;
      if (left < bodies_[kind].count) {
        only = left;
        return kind;
      }
      left -= bodies_[kind].count;
    }
    refuse(place, fmt::format("a body of the scene, 0 to {}", count - 1), body.dump());
  }

  std::size_t find_name(const std::string& name, const std::string& place, std::optional<std::size_t>& only) const {
    std::vector<std::string> known;
    for (std::size_t kind = 0; kind < bodies_.size(); ++kind) {
      const NamedBodies& own = bodies_[kind];
      if (!own.name.empty() && name == own.name) return kind;
      known.push_back(own.name);
      for (std::size_t i = 0; own.count > 1 && !own.name.empty() && i < own.count; ++i)
        if (name == fmt::format("{}_{}", own.name, i)) {
          only = i;
          return kind;
        }
    }
    if (known.front().empty())
      refuse(place, "a number, since the bodies of this scene have no names", fmt::format("\"{}\"", name));
    const std::string nearest = nearest_name(name, known);
    refuse(place, names(), fmt::format("\"{}\"", name),
           nearest.empty() ? "" : fmt::format("did you mean \"{}\"?", nearest));
  }

  std::optional<std::size_t> read_obstacle(const Json& json, const std::string& place) const {
    if (!json.contains("to")) return std::nullopt;
    const Json& to = json["to"];
    if (to.is_string()) {
      if (to != "world") refuse(place, R"("world" or {"obstacle": NUMBER})", to.dump());
      return std::nullopt;
    }
    if (to.contains("body")) return std::nullopt;
    if (!to.contains("obstacle"))
      refuse(place, R"({"obstacle": NUMBER} or {"body": NAME, "vertices": ...})", to.dump());
    if (to.contains("vertices")) refuse(place + "/vertices", "no vertices of an obstacle", "some");
    const auto number = to["obstacle"].get<std::uint64_t>();
    const std::size_t count = member_or(scene_, "obstacles", Json::array()).size();
    if (number >= count)
      refuse(place + "/obstacle",
             count == 0 ? "no obstacle, since the scene has none" : fmt::format("an obstacle, 0 to {}", count - 1),
             fmt::format("{}", number));
    return number;
  }

  /// Another body than those that are held.
  std::optional<HoldingBodyConfig> read_body(const Json& json, const std::string& place, std::size_t kind,
                                             const std::optional<std::size_t>& only) const {
    if (!json.contains("to") || !json["to"].is_object() || !json["to"].contains("body")) return std::nullopt;
    const Json& to = json["to"];
    if (to.contains("obstacle")) refuse(place, "an obstacle or a body", "both");
    if (bodies_.front().name.empty())
      refuse(place + "/body", "\"world\" or an obstacle, since this scene has no \"bodies\"", to["body"].dump());
    HoldingBodyConfig held;
    std::optional<std::size_t> number;
    held.kind = find_bodies(to, place + "/body", number);
    if (!number && bodies_[held.kind].count > 1)
      refuse(place + "/body",
             fmt::format("one of \"{0}_0\" to \"{0}_{1}\"", bodies_[held.kind].name, bodies_[held.kind].count - 1),
             to["body"].dump());
    held.number = number.value_or(0);
    if (held.kind == kind && (!only || *only == held.number))
      refuse(place + "/body", "another body than the one that is held", to["body"].dump());
    if (!to.contains("vertices")) refuse(place + "/vertices", "vertices of that body", "no such member");
    held.vertices = read_selection(to["vertices"], file_, place + "/vertices");
    return held;
  }

  const Json& scene_;
  const std::filesystem::path& file_;
  const std::vector<NamedBodies>& bodies_;
};

}  // namespace

std::vector<std::vector<AttachmentConfig>> read_attachments(const Json& scene, const std::filesystem::path& file,
                                                            const std::vector<NamedBodies>& bodies) {
  std::vector<std::vector<AttachmentConfig>> attachments(bodies.size());
  if (!scene.contains("attachments")) return attachments;
  const Json& all = scene["attachments"];
  const Reader reader(scene, file, bodies);
  for (std::size_t i = 0; i < all.size(); ++i) {
    auto [kind, config] = reader.read(all[i], fmt::format("/attachments/{}", i));
    attachments[kind].push_back(std::move(config));
  }
  return attachments;
}

}  // namespace exmat

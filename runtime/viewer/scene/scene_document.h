#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "exmat/exmat.hpp"
#include "runtime/viewer/scene/settings.h"

namespace exmat::viewer {

using Json = nlohmann::json;

/// An obstacle as it stands, to be saved.
struct PlacedObstacle {
  std::int64_t number = -1;  ///< among those of the scene; -1: added by hand
  bool moved = false;        ///< by hand: it stands where `motion` says
  exmat_obstacle obstacle{};
  exmat_motion motion{};
};

/// A scene file, or what a bundle without one is shown by, and what was changed in it.
class SceneDocument {
 public:
  /// A SCENE.json or a BUNDLE.h5. Throws InputError.
  static SceneDocument open(const std::filesystem::path& file);

  /// The same settings for another bundle: what names parts of the first one is left out. Throws InputError where this
  /// is a scene of several kinds of bodies, which touch each other.
  SceneDocument with_bundle(const std::filesystem::path& bundle) const;

  /// The file that names in it are relative to.
  const std::filesystem::path& path() const { return path_; }
  bool is_scene_file() const { return is_scene_; }
  /// True for bodies that touch each other.
  bool is_world() const { return json_.contains("bodies"); }
  /// Kinds of bodies; 1 where it is no world.
  std::size_t kinds() const { return is_world() ? json_["bodies"].size() : 1; }
  /// Name of a kind of its bodies, or of its bundle.
  std::string kind_name(std::size_t kind) const;
  std::filesystem::path bundle(std::size_t kind = 0) const;
  /// All files that it names: bundles, places of bodies, ids of vertices, obstacles.
  std::vector<std::filesystem::path> files() const;
  const Json& json() const { return json_; }
  std::string text() const { return json_.dump(); }

  std::int64_t steps() const { return json_.value("steps", std::int64_t{1000}); }
  int instances() const { return json_.value("instances", 1); }
  bool has_scripted_motion() const;

  Settings settings(std::size_t kind = 0) const;
  void set(const Settings& settings, std::size_t kind = 0);
  /// Sets the space of steps for bodies of which the scene does not say it.
  void prefer_space(const char* space);

  /// With this many steps and with the obstacles as they stand, to be run from `file`: names are relative to it. Throws
  /// WorkError where it cannot be written.
  void save(const std::filesystem::path& file, std::int64_t steps, std::span<const PlacedObstacle> obstacles) const;

 private:
  SceneDocument(std::filesystem::path path, Json json, bool is_scene)
      : path_(std::move(path)), json_(std::move(json)), is_scene_(is_scene) {}
  /// The object that the settings of a kind stand in.
  const Json& of_kind(std::size_t kind) const { return is_world() ? json_["bodies"][kind] : json_; }
  Json& of_kind(std::size_t kind) { return is_world() ? json_["bodies"][kind] : json_; }

  std::filesystem::path path_;
  Json json_;
  bool is_scene_ = false;
};

}  // namespace exmat::viewer

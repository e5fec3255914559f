#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

/// A script as its file says, checked against schemas/viewer_script.json.
struct Script {
  std::filesystem::path file;
  double frame_rate = 60;  ///< [1/s]
  double duration = 0;     ///< [s]
  struct Action {
    double time = 0;  ///< [s]
    nlohmann::json what;
    std::string place;  ///< in the file
  };
  std::vector<Action> actions;
};

/// Throws InputError.
Script load_script(const std::filesystem::path& file);

/// Plays a script on a studio.
class ScriptPlayer {
 public:
  /// Throws InputError where it names bodies, obstacles, regions or hands that are not there.
  ScriptPlayer(Script script, Studio& studio);

  /// Does all that is due up to this time [s], before the picture of it is drawn. Never backwards.
  void play(double time);

 private:
  struct Way {
    double start = 0, duration = 0;
    Eigen::Vector3d from = Eigen::Vector3d::Zero(), by = Eigen::Vector3d::Zero();

    Eigen::Vector3d at(double time) const;
  };
  struct Hand {
    int grip = 0;
    std::optional<Way> way;
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
  };
  struct Sight {
    Way position, target;
  };

  void check() const;
  void act(const Script::Action& action);
  std::size_t joint_of(const nlohmann::json& grab, const std::string& place) const;
  void grab(const nlohmann::json& grab);
  void set(const nlohmann::json& set);
  void show(const nlohmann::json& show);
  void aim(const nlohmann::json& camera, double time, double duration);
  void move(double time);

  Script script_;
  Studio& studio_;
  std::size_t next_ = 0;
  std::map<std::string, Hand> hands_;
  std::map<std::size_t, Way> obstacles_;
  std::optional<Sight> sight_;
};

}  // namespace exmat::viewer

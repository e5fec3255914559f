#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "exmat/exmat.hpp"
#include "runtime/viewer/scene/scene_document.h"
#include "runtime/viewer/simulation/grip.h"
#include "runtime/viewer/simulation/joint_hand.h"
#include "runtime/viewer/simulation/snapshot.h"
#include "runtime/viewer/simulation/stepped_bodies.h"

namespace exmat::viewer {

/// The bodies of a scene, what holds them and what they touch. For one thread at a time.
class Simulation {
 public:
  /// The bodies of a scene of several; else one kind for each document, the first with its instances, side by side.
  /// Throws exmat::Error.
  Simulation(std::vector<SceneDocument> documents, int surface_kind);

  std::size_t kinds() const { return kinds_.size(); }
  std::size_t bodies() const { return slots_.size(); }
  std::size_t kind_of(std::size_t body) const { return slots_[body].kind; }
  /// Shift of a drawn body from its place, so that bodies of one place stand side by side.
  const Eigen::Vector3d& offset(std::size_t body) const { return slots_[body].offset; }
  std::shared_ptr<const BodyShape> shape(std::size_t kind) const { return kinds_[kind].shape; }
  const std::string& kind_name(std::size_t kind) const { return kinds_[kind].name; }
  /// True if bodies touch each other.
  bool is_world() const { return bodies_.world().contact_law().apart == 0; }
  bool has_contact() const { return has_contact_; }

  const Settings& settings(std::size_t kind) const { return kinds_[kind].settings; }
  /// From now on; damping, integrator and time step of all kinds, and gravity of those without their own. Where the
  /// model has to be made anew, shape and motion go on, unless something moves by a script. Throws exmat::Error, and
  /// nothing has changed.
  void apply(std::size_t kind, const Settings& settings);

  /// All back to the start; obstacles of the scene, too. Throws exmat::Error, and nothing has changed, where hands have
  /// moved bones and the bundle cannot be read again.
  void reset();

  /// So many steps; fewer where a number is not finite, see failure().
  void advance(std::int64_t steps);
  std::int64_t steps() const { return steps_; }
  double time() const { return static_cast<double>(steps_) * time_step(); }
  double time_step() const { return kinds_.front().settings.time_step; }
  const std::string& failure() const { return failure_; }
  std::uint64_t hash() const { return bodies_.world().hash(); }

  // Hands. Places in the world are without the body's offset.
  int grab(std::size_t body, const SurfaceHit& place);
  /// Takes hold of a joint of a body on bones; from then on until reset() no animation moves them.
  int grab_joint(std::size_t body, std::size_t joint);
  void move_grip(int id, const Eigen::Vector3d& target);
  void release(int id);
  void set_strength(double strength) { strength_ = strength; }
  double strength() const { return strength_; }
  /// Holds the surface about `place` by an attachment where it is now, or lets that go which holds it there. Throws
  /// exmat::Error where the body cannot be held.
  void toggle_pin(std::size_t body, const SurfaceHit& place);
  /// Throws a free body; false where it is none.
  bool throw_body(std::size_t body, const Eigen::Vector3d& velocity, const Eigen::Vector3d& spin);

  // Obstacles, by their place in the list.
  void add_obstacle(const exmat_obstacle& obstacle);
  void remove_obstacle(std::size_t obstacle);
  /// Goes there smoothly [m].
  void move_obstacle(std::size_t obstacle, const Eigen::Vector3d& position);
  void set_obstacle_law(std::size_t obstacle, double stiffness, double damping, double friction);
  std::size_t obstacles() const { return obstacles_.size(); }

  /// The place of a body's surface that the ray meets first within `most` [m]. The ray is without the body's offset.
  std::optional<SurfaceHit> cast(std::size_t body, const Ray& ray, double most) const;
  /// The first obstacle but planes that the ray enters.
  struct ObstacleHit {
    std::size_t number = 0;
    double distance = 0;  ///< [m]
  };
  std::optional<ObstacleHit> cast(Ray ray) const;

  /// Surface positions [3k] now, world, without the offset.
  std::vector<float> positions(std::size_t body);

  Snapshot snapshot(const SnapshotRequest& request);

  /// Lost work of all that holds and touches bodies now. Makes what that takes when it is first asked for.
  LostWork lost_work();

  /// Writes what would be run again by exmat-runtime. Throws WorkError.
  void save_scene(const std::filesystem::path& file) const;

 private:
  struct Kind {
    std::size_t document = 0, of_document = 0;  ///< which of its kinds it is
    std::string name;
    Settings settings;
    Model model;
    std::unique_ptr<Surface> surface;
    std::optional<Points> elements;
    std::shared_ptr<const BodyShape> shape;
    std::unique_ptr<Capacity> capacity;
  };
  struct Slot {
    std::size_t kind = 0;
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  };
  /// An attachment of the user.
  struct Pin {
    std::size_t body = 0;
    std::int64_t attachment = 0;
    Eigen::Vector3d rest, point;  ///< its place at rest, and in the world without the body's offset [m]
  };
  struct MovedObstacle {
    std::int64_t id = 0;
    std::int64_t of_scene = -1;  ///< its number there
    bool moved = false;
    std::optional<Eigen::Vector3d> target;
    std::shared_ptr<const std::vector<double>> corners;  ///< 9f, of a mesh or of ground
  };
  struct Made {
    std::vector<Kind> kinds;
    std::vector<Slot> slots;
    SteppedBodies bodies;
  };

  Made make(const std::vector<SceneDocument>& documents) const;
  Made make_touchable();
  Kind make_kind(const SceneDocument& document, std::size_t of_document, std::size_t number, Model model) const;
  void take(Made made);
  void place_side_by_side();
  void rebuild(std::size_t kind, const Settings& settings);
  void apply_live(std::size_t kind, const Settings& settings);
  bool is_held() const;
  void prepare_step();
  void move_obstacles();
  void move_bones();
  bool step(std::int64_t steps);
  void add_times(std::int64_t steps, double seconds);
  void remove_pins();
  void put(const Settings& settings, const Kind& kind, std::vector<SceneDocument>& documents) const;
  std::vector<std::size_t> most_touched() const;
  BodySnapshot body_snapshot(std::size_t body, const SnapshotRequest& request);

  int surface_kind_;
  bool has_contact_ = false;
  std::vector<SceneDocument> documents_;
  std::vector<Kind> kinds_;
  std::vector<Slot> slots_;
  SteppedBodies bodies_;
  std::vector<MovedObstacle> obstacles_;
  std::vector<Grip> grips_;
  std::vector<JointHand> joint_hands_;
  std::vector<Pin> pins_;
  bool moved_bones_ = false;  ///< true once a hand has held a joint of this world
  int next_grip_ = 1;
  double strength_ = 1;
  std::int64_t steps_ = 0;
  StepTimes times_;
  std::string failure_;
};

}  // namespace exmat::viewer

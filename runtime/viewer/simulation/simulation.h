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
#include "runtime/viewer/simulation/snapshot.h"

namespace exmat::viewer {

/// The bodies of a scene, what holds them and what they touch. For one thread at a time.
class Simulation {
 public:
  /// One kind of bodies for each document, the first with its instances, side by side. Throws exmat::Error.
  Simulation(std::vector<SceneDocument> documents, int surface_kind);

  std::size_t kinds() const { return kinds_.size(); }
  std::size_t bodies() const { return slots_.size(); }
  std::size_t kind_of(std::size_t body) const { return slots_[body].kind; }
  /// How far from its place a body is drawn, so that bodies of one place stand side by side.
  const Eigen::Vector3d& offset(std::size_t body) const { return slots_[body].offset; }
  std::shared_ptr<const BodyShape> shape(std::size_t kind) const { return kinds_[kind].shape; }
  const SceneDocument& document(std::size_t kind) const { return kinds_[kind].document; }
  bool has_contact() const { return has_contact_; }

  const Settings& settings(std::size_t kind) const { return kinds_[kind].settings; }
  /// From now on; gravity, damping, integrator and time step of all kinds. Where the model has to be made anew, shape
  /// and motion go on, unless something moves by a script. Throws exmat::Error, and nothing has changed.
  void apply(std::size_t kind, const Settings& settings);

  /// All back to the start; obstacles of the scene, too.
  void reset();

  /// So many steps; fewer where a number is not finite, see failure().
  void advance(std::int64_t steps);
  std::int64_t steps() const { return steps_; }
  double time() const { return static_cast<double>(steps_) * time_step(); }
  double time_step() const { return kinds_.front().settings.time_step; }
  const std::string& failure() const { return failure_; }
  std::uint64_t hash() const { return bodies_.hash(); }

  // Hands. Places in the world are without the body's offset.
  int grab(std::size_t body, const SurfaceHit& place);
  void move_grip(int id, const Eigen::Vector3d& target);
  void release(int id);
  void set_strength(double strength) { strength_ = strength; }
  double strength() const { return strength_; }
  /// Of a free body; false where it is none.
  bool throw_body(std::size_t body, const Eigen::Vector3d& velocity, const Eigen::Vector3d& spin);

  // Obstacles, the same of all bodies, by their place in the list.
  void add_obstacle(const exmat_obstacle& obstacle);
  void remove_obstacle(std::size_t obstacle);
  /// Goes there smoothly [m].
  void move_obstacle(std::size_t obstacle, const Eigen::Vector3d& position);
  void set_obstacle_law(std::size_t obstacle, double stiffness, double damping, double friction);
  std::size_t obstacles() const { return obstacles_.size(); }

  /// Surface positions [3k] now, world, without the offset.
  std::vector<float> positions(std::size_t body);

  Snapshot snapshot(const SnapshotRequest& request);

  /// Of what holds and touches bodies now. Makes what that takes when it is first asked for.
  LostWork lost_work();

  /// Writes what would be run again by exmat-runtime. Throws WorkError.
  void save_scene(const std::filesystem::path& file) const;

 private:
  struct Kind {
    SceneDocument document;
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
  struct MovedObstacle {
    std::int64_t id = 0;
    std::int64_t of_scene = -1;  ///< its number there
    bool moved = false;
    std::optional<Eigen::Vector3d> target;
  };

  Kind make_kind(SceneDocument document, int surface_kind) const;
  void place_side_by_side();
  void make_bodies();
  void rebuild(std::size_t kind, const Settings& settings);
  void apply_live(std::size_t kind, const Settings& settings);
  bool is_held() const;
  void prepare_step();
  void move_obstacles();
  bool step(std::int64_t steps);
  void add_times(std::int64_t steps, double seconds);
  BodySnapshot body_snapshot(std::size_t body, const SnapshotRequest& request);

  int surface_kind_;
  bool has_contact_ = false;
  std::vector<Kind> kinds_;
  std::vector<Slot> slots_;
  Bodies bodies_;
  std::vector<MovedObstacle> obstacles_;
  std::vector<Grip> grips_;
  int next_grip_ = 1;
  double strength_ = 1;
  std::int64_t steps_ = 0;
  StepTimes times_;
  std::string failure_;
};

}  // namespace exmat::viewer

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/viewer/drawing/look.h"
#include "runtime/viewer/simulation/runner.h"
#include "runtime/viewer/view/camera.h"

namespace exmat::viewer {

/// The thing that the mouse is on.
struct Pick {
  enum class What { kBody, kJoint, kObstacle } what = What::kBody;
  std::size_t number = 0;                           ///< number of the body or the obstacle
  std::size_t joint = 0;                            ///< joint of a body
  SurfaceHit place;                                 ///< place on a body
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< in the picture [m]
};

/// All that a hand or a script can do: the camera, what is shown, what is held, what is set.
class Studio {
 public:
  explicit Studio(Simulation& simulation);

  Runner& runner() { return runner_; }
  Camera& camera() { return camera_; }
  const Camera& camera() const { return camera_; }
  Look& look() { return look_; }

  const std::vector<std::shared_ptr<const BodyShape>>& shapes() const { return shapes_; }
  const std::vector<std::size_t>& kinds_of_bodies() const { return kinds_; }
  const std::vector<Eigen::Vector3d>& offsets() const { return offsets_; }
  bool has_contact() const { return has_contact_; }
  const std::vector<std::string>& kind_names() const { return kind_names_; }

  /// As last set.
  const Settings& settings(std::size_t kind) const { return settings_[kind]; }
  /// Tells in message() why not where that cannot be.
  void apply(std::size_t kind, const Settings& settings);

  void reset();
  void toggle_pause() { runner_.set_paused(!runner_.paused()); }

  /// Joints lie before all else where bones are shown.
  std::optional<Pick> pick(const Eigen::Vector2d& pixel, const PictureSize& picture);

  // With the mouse, one thing at a time.
  bool begin_drag(const Eigen::Vector2d& pixel, const PictureSize& picture);
  void drag(const Eigen::Vector2d& pixel, const PictureSize& picture);
  void end_drag();
  bool dragging() const { return drag_.has_value(); }

  /// Pins the body under the mouse there, or lets it go; tells in message() why not where that cannot be.
  void toggle_pin(const Eigen::Vector2d& pixel, const PictureSize& picture);
  /// The same at the point of its surface at rest that is nearest to `point`. Throws exmat::Error.
  void toggle_pin_near(std::size_t body, const Eigen::Vector3d& point);

  /// The point of a body's surface at rest that is nearest to `point`; the grip's number.
  int grab_near(std::size_t body, const Eigen::Vector3d& point);

  void add_obstacle(std::int32_t shape);
  void remove_obstacle(std::size_t obstacle);
  void save_scene(const std::filesystem::path& file);

  /// Measured now and then: `seconds` since the last picture, or at once.
  void measure_lost_work(double seconds);
  void measure_lost_work_now();
  const LostWork& lost_work() const { return lost_; }

  /// Something that the user should read, and for how long still [s].
  const std::string& message() const { return message_; }
  void say(std::string message);
  void pass(double seconds);

  /// All of `bounds` in what the panels leave of the picture; `scale` is that of the interface.
  void frame(const Bounds& bounds, const PictureSize& picture, double scale);

  bool interface = true, help = false;
  bool frame_next = true;  ///< all is to be in the next picture
  bool end = false;        ///< the window is to be closed

 private:
  std::optional<Pick> pick_joint(const Snapshot& snapshot, const Eigen::Vector2d& pixel,
                                 const PictureSize& picture) const;

  struct Drag {
    Pick pick;
    int grip = 0;
    Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< point of the plane that the mouse moves in
    Eigen::Vector3d from = Eigen::Vector3d::Zero();    ///< start of an obstacle
  };

  Runner runner_;
  std::vector<std::shared_ptr<const BodyShape>> shapes_;
  std::vector<std::size_t> kinds_;
  std::vector<Eigen::Vector3d> offsets_;
  std::vector<Settings> settings_;
  std::vector<std::string> kind_names_;
  bool has_contact_ = false;
  Camera camera_;
  Look look_;
  std::optional<Drag> drag_;
  LostWork lost_;
  double lost_seconds_ = 0;  ///< since it was measured
  std::string message_;
  double message_seconds_ = 0;
};

}  // namespace exmat::viewer

#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

namespace exmat::viewer {

/// Bounds of points, world [m].
struct Bounds {
  Eigen::Vector3d least = Eigen::Vector3d::Constant(1e300), most = Eigen::Vector3d::Constant(-1e300);

  bool empty() const { return (least.array() > most.array()).any(); }
  void add(const Eigen::Vector3d& point) {
    least = least.cwiseMin(point);
    most = most.cwiseMax(point);
  }
  void add(const Bounds& other) {
    least = least.cwiseMin(other.least);
    most = most.cwiseMax(other.most);
  }
  Eigen::Vector3d centre() const { return 0.5 * (least + most); }
  double diagonal() const { return empty() ? 1 : (most - least).norm(); }
};

struct Ray {
  Eigen::Vector3d origin, direction;  ///< world [m], unit

  Eigen::Vector3d at(double distance) const { return origin + distance * direction; }
};

/// A picture of so many pixels.
struct PictureSize {
  int width = 1280, height = 720;

  double aspect() const { return static_cast<double>(width) / height; }
};

/// A camera that looks at a point and goes around it. Angles in radians.
class Camera {
 public:
  static constexpr double kFieldOfView = 0.56;  ///< angle over the picture's height

  /// Which way is up, unit.
  void set_up(const Eigen::Vector3d& up);
  const Eigen::Vector3d& up() const { return up_; }

  /// From where at what.
  void look(const Eigen::Vector3d& position, const Eigen::Vector3d& target);

  Eigen::Vector3d position() const { return target_ + distance_ * backward(); }
  const Eigen::Vector3d& target() const { return target_; }
  double distance() const { return distance_; }
  double field_of_view() const { return field_of_view_; }
  void set_field_of_view(double angle) { field_of_view_ = angle; }

  /// By parts of the picture's height.
  void orbit(double right, double up);
  void pan(double right, double up);
  /// > 1: nearer.
  void zoom(double factor);

  /// All of `bounds` in the picture, from the same side.
  void frame(const Bounds& bounds, const PictureSize& picture);

  Eigen::Matrix4d view() const;
  Eigen::Matrix4d projection(const PictureSize& picture) const;

  /// Through the middle of a pixel, from the top left.
  Ray ray(const Eigen::Vector2d& pixel, const PictureSize& picture) const;
  /// Place of a point in the picture, from the top left; none where it is behind the camera.
  std::optional<Eigen::Vector2d> pixel(const Eigen::Vector3d& point, const PictureSize& picture) const;

  /// The point where the ray of a pixel meets the plane through `point` that faces the camera.
  Eigen::Vector3d on_plane_of(const Eigen::Vector3d& point, const Eigen::Vector2d& pixel,
                              const PictureSize& picture) const;

  Eigen::Vector3d right() const;
  Eigen::Vector3d backward() const;  ///< from the target to the camera, unit

 private:
  Eigen::Matrix3d base() const;  ///< columns: two horizontal axes and up

  Eigen::Vector3d up_ = Eigen::Vector3d::UnitZ(), target_ = Eigen::Vector3d::Zero();
  double turn_ = -0.95, rise_ = 0.24, distance_ = 3;
  double field_of_view_ = kFieldOfView;
};

}  // namespace exmat::viewer

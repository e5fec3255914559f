#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

namespace exmat::runtime {

/// Pose of a rigid frame at a time. The orientation is a unit quaternion.
struct Keyframe {
  double time = 0;                                                  ///< [s]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< frame's origin, world [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< frame to world
};

/// A moving frame at one time, world components.
struct MotionSample {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();              ///< [m]
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();          ///< frame to world
  Eigen::Vector3d linear_velocity = Eigen::Vector3d::Zero();       ///< frame's origin [m/s]
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();      ///< [rad/s]
  Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();   ///< frame's origin [m/s^2]
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  ///< [rad/s^2]

  /// World position of a point of the frame.
  Eigen::Vector3d to_world(const Eigen::Vector3d& point) const noexcept { return position + rotation * point; }
  /// The frame's coordinates of a world position.
  Eigen::Vector3d to_frame(const Eigen::Vector3d& point) const noexcept {
    return rotation.transpose() * (point - position);
  }
  /// Velocity of the frame's material point at a world position [m/s].
  Eigen::Vector3d velocity_at(const Eigen::Vector3d& point) const noexcept {
    return linear_velocity + angular_velocity.cross(point - position);
  }
  /// World acceleration of a point of the frame [m/s^2].
  Eigen::Vector3d acceleration_of(const Eigen::Vector3d& point) const noexcept {
    const Eigen::Vector3d arm = rotation * point;
    return linear_acceleration + angular_acceleration.cross(arm) + angular_velocity.cross(angular_velocity.cross(arm));
  }
};

inline constexpr double kBesideKey = 1e-6;  ///< share of a step

/// A prescribed rigid motion through keyframes: cubic Hermite positions (non-uniform Catmull-Rom) and cubic Bezier
/// orientations (Kim, Kim and Shin 1995), both C1; accelerations may jump at keys. Held at rest before the first key
/// and after the last, where the motion starts and ends with velocity 0. One key is a fixed pose, none the identity.
/// From key to key the frame turns the shorter way: keys lie less than half a turn apart.
class RigidMotion {
 public:
  RigidMotion() = default;
  /// Times ascend strictly.
  explicit RigidMotion(const std::vector<Keyframe>& keys);

  /// The pose of `sample` at `time`, going on with its velocities: the origin straight, the turn about a fixed axis.
  static RigidMotion going_on(double time, const MotionSample& sample);

  /// Velocities and accelerations are the exact derivatives of the pose.
  MotionSample sample(double time) const noexcept;
  /// The same with the accelerations `beside` [s] it: they may jump at keys, and a step has those within it.
  MotionSample sample(double time, double beside) const noexcept;

  /// True if a key, where accelerations may jump, lies in [from, to).
  bool has_key(double from, double to) const noexcept;

  /// Beginning of one that goes on, and its pose and velocities there.
  double start() const noexcept { return start_; }
  const MotionSample& first() const noexcept { return first_; }

  /// True if the pose changes at all.
  bool moves() const noexcept { return !segments_.empty() || goes_on_; }

 private:
  /// Between two keys: p(s) by Hermite's basis; R(s) = R_0 exp(w_0 b_0(s)) exp(w_1 b_1(s)) exp(w_2 b_2(s)).
  struct Segment {
    double start = 0, duration = 0;                        // [s]
    Eigen::Vector3d from, to, from_velocity, to_velocity;  // [m], [m/s]
    Eigen::Matrix3d rotation;                              // R_0
    Eigen::Vector3d turns[3];                              // w_i [rad]
  };
  static void sample_position(const Segment& segment, double s, MotionSample& sample) noexcept;
  static void sample_rotation(const Segment& segment, double s, MotionSample& sample) noexcept;

  bool goes_on_ = false;  // first_ at start_ and its velocities are all
  double start_ = 0;      // [s]
  MotionSample first_, last_;
  std::vector<Segment> segments_;
};

}  // namespace exmat::runtime

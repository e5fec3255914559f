#include "runtime/sim/frame/motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "runtime/sim/frame/spin.h"

namespace exmat::runtime {
namespace {

/// The rotation vector of a unit quaternion, at most half a turn [rad]; quaternion_of() is its inverse.
Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0 ? -1 : 1;
  const double sine = rotation.vec().norm();
  if (sine == 0) return Eigen::Vector3d::Zero();
  return rotation.vec() * (sign * 2 * std::atan2(sine, sign * rotation.w()) / sine);
}

/// Velocities at the keys: 0 at both ends, else the mean of the rates on both sides, each weighted by the other's
/// duration.
std::vector<Eigen::Vector3d> key_velocities(const std::vector<Eigen::Vector3d>& rates,
                                            const std::vector<double>& durations) {
  std::vector<Eigen::Vector3d> velocities(rates.size() + 1, Eigen::Vector3d::Zero());
  for (std::size_t i = 1; i < rates.size(); ++i)
    velocities[i] = (durations[i] * rates[i - 1] + durations[i - 1] * rates[i]) / (durations[i - 1] + durations[i]);
  return velocities;
}

MotionSample resting(const Keyframe& key) {
  MotionSample sample;
  sample.position = key.position;
  sample.rotation = key.orientation.normalized().toRotationMatrix();
  return sample;
}

}  // namespace

RigidMotion::RigidMotion(const std::vector<Keyframe>& keys) {
  if (keys.empty()) return;
  first_ = resting(keys.front());
  last_ = resting(keys.back());
  const std::size_t count = keys.size() - 1;
  std::vector<double> durations(count);
  std::vector<Eigen::Vector3d> rates(count), turn_rates(count);
  std::vector<Eigen::Quaterniond> turns(count);
  for (std::size_t i = 0; i < count; ++i) {
    durations[i] = keys[i + 1].time - keys[i].time;
    rates[i] = (keys[i + 1].position - keys[i].position) / durations[i];
    turns[i] = keys[i].orientation.normalized().conjugate() * keys[i + 1].orientation.normalized();
    turn_rates[i] = rotation_vector(turns[i]) / durations[i];
  }
  const std::vector<Eigen::Vector3d> velocities = key_velocities(rates, durations);
  const std::vector<Eigen::Vector3d> spins = key_velocities(turn_rates, durations);  // frame components
  segments_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    Segment& segment = segments_[i];
    segment.start = keys[i].time;
    segment.duration = durations[i];
    segment.from = keys[i].position;
    segment.to = keys[i + 1].position;
    segment.from_velocity = velocities[i];
    segment.to_velocity = velocities[i + 1];
    segment.rotation = resting(keys[i]).rotation;
    segment.turns[0] = spins[i] * (durations[i] / 3);
    segment.turns[2] = spins[i + 1] * (durations[i] / 3);
    segment.turns[1] = rotation_vector(quaternion_of(segment.turns[0]).conjugate() * turns[i] *
                                       quaternion_of(segment.turns[2]).conjugate());
  }
}

RigidMotion RigidMotion::going_on(double time, const MotionSample& sample) {
  RigidMotion motion;
  motion.start_ = time;
  motion.first_ = sample;
  motion.first_.linear_acceleration.setZero();
  motion.first_.angular_acceleration.setZero();
  motion.goes_on_ = !sample.linear_velocity.isZero(0) || !sample.angular_velocity.isZero(0);
  return motion;
}

MotionSample RigidMotion::sample(double time) const noexcept {
  if (goes_on_) {
    MotionSample sample = first_;
    sample.position += (time - start_) * first_.linear_velocity;
    sample.rotation = rotation_of((time - start_) * first_.angular_velocity) * first_.rotation;
    return sample;
  }
  if (segments_.empty() || time <= segments_.front().start) return first_;
  const auto after = std::upper_bound(segments_.begin(), segments_.end(), time,
                                      [](double t, const Segment& segment) { return t < segment.start; });
  const Segment& segment = *(after - 1);
  const double s = (time - segment.start) / segment.duration;
  if (s >= 1) return last_;
  MotionSample sample;
  sample_position(segment, s, sample);
  sample_rotation(segment, s, sample);
  return sample;
}

MotionSample RigidMotion::sample(double time, double beside) const noexcept {
  MotionSample here = sample(time);
  const MotionSample within = sample(time + beside);
  here.linear_acceleration = within.linear_acceleration;
  here.angular_acceleration = within.angular_acceleration;
  return here;
}

bool RigidMotion::has_key(double from, double to) const noexcept {
  const auto within = [=](double time) { return from <= time && time < to; };
  return std::any_of(segments_.begin(), segments_.end(), [&](const Segment& segment) {
    return within(segment.start) || within(segment.start + segment.duration);
  });
}

void RigidMotion::sample_position(const Segment& segment, double s, MotionSample& sample) noexcept {
  const double h = segment.duration;
  const Eigen::Vector3d step = segment.to - segment.from;
  const Eigen::Vector3d &a = segment.from_velocity, &b = segment.to_velocity;
  sample.position = segment.from + s * s * (3 - 2 * s) * step + h * s * (1 - s) * ((1 - s) * a - s * b);
  sample.linear_velocity = 6 * s * (1 - s) / h * step + (1 - s) * (1 - 3 * s) * a + s * (3 * s - 2) * b;
  sample.linear_acceleration = (6 * (1 - 2 * s) / h * step + (6 * s - 4) * a + (6 * s - 2) * b) / h;
}

void RigidMotion::sample_rotation(const Segment& segment, double s, MotionSample& sample) noexcept {
  const double h = segment.duration;
  const std::array<double, 3> share{1 - (1 - s) * (1 - s) * (1 - s), s * s * (3 - 2 * s), s * s * s};
  const std::array<double, 3> rate{3 * (1 - s) * (1 - s) / h, 6 * s * (1 - s) / h, 3 * s * s / h};
  const std::array<double, 3> change{-6 * (1 - s) / h / h, 6 * (1 - 2 * s) / h / h, 6 * s / h / h};
  sample.rotation = segment.rotation;
  Eigen::Vector3d spin = Eigen::Vector3d::Zero(), spin_rate = Eigen::Vector3d::Zero();  // frame components
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d& axis = segment.turns[i];
    const Eigen::Matrix3d factor = quaternion_of(share[i] * axis).toRotationMatrix();
    const Eigen::Vector3d own = rate[i] * axis, carried = factor.transpose() * spin;
    spin_rate = factor.transpose() * spin_rate - own.cross(carried) + change[i] * axis;
    spin = carried + own;
    sample.rotation *= factor;
  }
  sample.angular_velocity = sample.rotation * spin;
  sample.angular_acceleration = sample.rotation * spin_rate;
}

}  // namespace exmat::runtime

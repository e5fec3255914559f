#include "runtime/sim/frame/motion.h"

#include <gtest/gtest.h>
#include <numbers>

#include "tests/support/allocation_counter.h"
#include "tests/support/random.h"

namespace exmat::runtime {
namespace {

using test::random_vector;

Eigen::Quaterniond turned(double x, double y, double z) {
  const Eigen::Vector3d vector(x, y, z);
  return Eigen::Quaterniond(Eigen::AngleAxisd(vector.norm(), vector.normalized()));
}

/// Uneven times, large turns, one of them the other way round the sphere of quaternions.
std::vector<Keyframe> wild_keys() {
  std::vector<Keyframe> keys;
  const double times[] = {-0.5, 0.1, 0.4, 1.4, 1.7, 3.0};
  for (int i = 0; i < 6; ++i) {
    const auto seed = static_cast<std::uint32_t>(i);
    Keyframe key{times[i], random_vector(3, seed),
                 Eigen::Quaterniond(Eigen::Vector4d(random_vector(4, seed + 10)).normalized())};
    if (i == 3) key.orientation.coeffs() *= -1;
    keys.push_back(key);
  }
  return keys;
}

Eigen::Vector3d spin_between(const MotionSample& a, const MotionSample& b, double step) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(b.rotation * a.rotation.transpose()));
  return turn.angle() * turn.axis() / step;
}

TEST(RigidMotion, PassesThroughItsKeys) {
  const std::vector<Keyframe> keys = wild_keys();
  const RigidMotion motion(keys);
  for (const Keyframe& key : keys) {
    const MotionSample sample = motion.sample(key.time);
    EXPECT_LT((sample.position - key.position).norm(), 1e-14);
    EXPECT_LT((sample.rotation - key.orientation.toRotationMatrix()).norm(), 1e-14);
  }
}

TEST(RigidMotion, GoesOnAlongAHelix) {
  MotionSample start;
  start.position = Eigen::Vector3d(1, 2, 3);
  start.rotation = turned(0.3, -0.2, 0.5).toRotationMatrix();
  start.linear_velocity = Eigen::Vector3d(0.5, -1, 2);
  start.angular_velocity = Eigen::Vector3d(3, 1, -2);
  const RigidMotion motion = RigidMotion::going_on(4, start);
  EXPECT_TRUE(motion.moves());
  for (const double time : {3.0, 4.0, 4.5, 40.0}) {
    const MotionSample sample = motion.sample(time);
    const Eigen::AngleAxisd turn((time - 4) * start.angular_velocity.norm(), start.angular_velocity.normalized());
    EXPECT_LE((sample.position - start.position - (time - 4) * start.linear_velocity).norm(), 1e-13);
    EXPECT_LE((sample.rotation - turn * start.rotation).norm(), 1e-13);  // rounding of an angle of 135 rad
    EXPECT_EQ(sample.angular_velocity, start.angular_velocity);
  }
  EXPECT_FALSE(RigidMotion::going_on(4, motion.sample(4)).has_key(0, 10));
}

TEST(RigidMotion, HasTheDerivativesOfItsPose) {
  const RigidMotion motion(wild_keys());
  constexpr double kStep = 1e-5;
  for (double time = -0.45; time < 2.95; time += 0.07) {
    const MotionSample before = motion.sample(time - kStep), here = motion.sample(time),
                       after = motion.sample(time + kStep);
    EXPECT_LT((here.rotation * here.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-13);
    EXPECT_LT(((after.position - before.position) / (2 * kStep) - here.linear_velocity).norm(), 1e-7);
    EXPECT_LT((spin_between(before, after, 2 * kStep) - here.angular_velocity).norm(), 1e-6) << time;
    EXPECT_LT(((after.linear_velocity - before.linear_velocity) / (2 * kStep) - here.linear_acceleration).norm(), 1e-6);
    EXPECT_LT(((after.angular_velocity - before.angular_velocity) / (2 * kStep) - here.angular_acceleration).norm(),
              1e-5)
        << time;
  }
}

TEST(RigidMotion, HasContinuousVelocitiesAtItsKeys) {
  const RigidMotion motion(wild_keys());
  for (const Keyframe& key : wild_keys()) {
    const MotionSample before = motion.sample(key.time - 1e-9), after = motion.sample(key.time + 1e-9);
    EXPECT_LT((before.linear_velocity - after.linear_velocity).norm(), 1e-5);
    EXPECT_LT((before.angular_velocity - after.angular_velocity).norm(), 1e-5);
  }
}

TEST(RigidMotion, RestsBeforeItsFirstAndAfterItsLastKey) {
  const std::vector<Keyframe> keys = wild_keys();
  const RigidMotion motion(keys);
  for (const double time : {-100.0, -0.5, 3.0, 100.0}) {
    const MotionSample sample = motion.sample(time);
    EXPECT_EQ(sample.position, time < 0 ? keys.front().position : keys.back().position);
    EXPECT_TRUE(sample.linear_velocity.isZero(0) && sample.angular_velocity.isZero(0));
    EXPECT_TRUE(sample.linear_acceleration.isZero(0) && sample.angular_acceleration.isZero(0));
  }
}

TEST(RigidMotion, KeepsAConstantVelocityBetweenInnerKeys) {
  std::vector<Keyframe> keys;
  for (const double time : {0.0, 0.5, 1.25, 1.75, 2.5, 3.0})
    keys.push_back({time, Eigen::Vector3d(2 * time, 0, -time), turned(0, 3 * time, 0)});
  const RigidMotion motion(keys);
  for (const double time : {0.6, 1.3, 1.6, 2.2}) {
    const MotionSample sample = motion.sample(time);
    EXPECT_LT((sample.position - Eigen::Vector3d(2 * time, 0, -time)).norm(), 1e-13);
    EXPECT_LT((sample.linear_velocity - Eigen::Vector3d(2, 0, -1)).norm(), 1e-13);
    EXPECT_LT((sample.angular_velocity - Eigen::Vector3d(0, 3, 0)).norm(), 1e-13);
    EXPECT_LT(sample.angular_acceleration.norm(), 1e-12);
  }
}

TEST(RigidMotion, OfOneKeyIsAFixedPoseAndOfNoneTheIdentity) {
  const RigidMotion one({{0.3, {1, 2, 3}, turned(0, 0, std::numbers::pi / 2)}});
  EXPECT_FALSE(one.moves());
  for (const double time : {0.0, 0.3, 5.0})
    EXPECT_LT((one.sample(time).to_world({1, 0, 0}) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-15);
  EXPECT_EQ(RigidMotion().sample(1).to_world({1, 2, 3}), Eigen::Vector3d(1, 2, 3));
}

TEST(RigidMotion, MovesItsMaterialPoints) {
  const RigidMotion motion(wild_keys());
  const Eigen::Vector3d point(0.3, -0.2, 0.7);
  const MotionSample here = motion.sample(0.8);
  const Eigen::Vector3d difference =
      (motion.sample(0.8 + 1e-6).to_world(point) - motion.sample(0.8 - 1e-6).to_world(point)) / 2e-6;
  EXPECT_LT((difference - here.velocity_at(here.to_world(point))).norm(), 1e-7);
  EXPECT_LT((here.to_frame(here.to_world(point)) - point).norm(), 1e-15);
}

TEST(RigidMotion, IsSampledWithoutAllocations) {
  const RigidMotion motion(wild_keys());
  double sum = 0;
  const test::AllocationCounter counter;
  for (double time = -1; time < 4; time += 0.1) sum += motion.sample(time).angular_acceleration.sum();
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
}  // namespace exmat::runtime

#include <gtest/gtest.h>

#include "runtime/sim/frame/skeleton.h"

// Keys of single bones on top of what else moves them, against products of 4 x 4 matrices down the skeleton.
namespace exmat::runtime {
namespace bone_play_test {

/// Hip, thigh and shin in a chain, and a tail at the hip; bound with axes that differ, one of them stretched.
SkeletonData limbs() {
  SkeletonData data;
  data.bones = {"hip", "thigh", "shin", "tail"};
  data.parents = IndexVector(Eigen::Vector4i(-1, 0, 1, 0));
  data.bind.setZero(12, 4);
  data.first_frames = IndexVector::Zero(1);
  data.poses.resize(0, 7);
  const Eigen::Vector3d joints[] = {{0, 1, 0}, {0.1, 0.9, 0}, {0.1, 0.5, 0.05}, {-0.2, 1, 0}};
  for (int b = 0; b < 4; ++b) {
    const Eigen::AngleAxisd axes(0.4 * (b + 1), Eigen::Vector3d(1, b, 0.5).normalized());
    data.bind.block<3, 3>(3 * b, 0) = (b == 3 ? 0.01 : 1) * axes.toRotationMatrix();
    data.bind.block<3, 1>(3 * b, 3) = joints[b];
  }
  return data;
}

Eigen::Quaterniond about(double angle, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

BoneAnimation swing(const Skeleton& skeleton) {
  BonePoses start = skeleton.bound(), end = start;
  for (std::size_t b = 0; b < end.size(); ++b) {
    end[b].joint += Eigen::Vector3d(0.1, 0.02 * static_cast<double>(b), 0);
    end[b].turn = about(0.3 + 0.2 * static_cast<double>(b), {0.2, 1, 0.1});
  }
  return {"swing", {0, 1}, {start, end}};
}

Eigen::Isometry3d matrix_of(const Skeleton& skeleton, std::size_t bone, const BonePose& pose) {
  Eigen::Isometry3d world = Eigen::Isometry3d::Identity();
  world.linear() = (pose.turn * skeleton.axes(bone)).toRotationMatrix();
  world.translation() = pose.joint;
  return world;
}

TEST(BonePlay, TurnsBonesInTheirOwnAxesAndWhatHangsOnThem) {
  const Skeleton skeleton(limbs());
  const BoneAnimation animation = swing(skeleton);
  const RigidMotion thigh({{0, {0, 0, 0}}, {1, {0, 0.03, 0}, about(0.8, {0, 0, 1})}});
  const RigidMotion hip({{0, {0, 0, 0}}, {1, {0.05, 0, 0}, about(-0.5, {1, 0, 0})}});
  for (const bool is_animated : {false, true}) {
    BonePlay play{.animation = is_animated ? &animation : nullptr, .loop = false, .bound = skeleton.bound()};
    play.add_keys(skeleton, 0, hip);
    play.add_keys(skeleton, 1, thigh);
    for (const double time : {0.0, 0.4, 1.0, 3.0}) {
      BonePoses base = skeleton.bound(), poses = base;
      if (is_animated) animation.sample(time, base);
      play.sample(time, poses);
      std::vector<Eigen::Isometry3d> expected;
      for (std::size_t b = 0; b < 4; ++b) {
        const Eigen::Isometry3d own = matrix_of(skeleton, b, base[b]);
        const int parent = skeleton.parent(b);
        Eigen::Isometry3d world = own;
        if (parent >= 0) {
          const auto p = static_cast<std::size_t>(parent);
          world = expected[p] * matrix_of(skeleton, p, base[p]).inverse() * own;
        }
        if (b < 2) {
          const MotionSample key = (b == 0 ? hip : thigh).sample(time);
          Eigen::Isometry3d keyed = Eigen::Isometry3d::Identity();
          keyed.linear() = key.rotation;
          keyed.translation() = key.position;
          world = world * keyed;
        }
        expected.push_back(world);
        EXPECT_LE((matrix_of(skeleton, b, poses[b]).matrix() - world.matrix()).norm(), 1e-14) << time << " " << b;
      }
    }
  }
}

TEST(Skeleton, TellsHowABoneIsTurnedAgainstItsParent) {
  const Skeleton skeleton(limbs());
  EXPECT_EQ(skeleton.branch(0), (std::vector<std::size_t>{0, 1, 3, 2}));
  EXPECT_EQ(skeleton.branch(2), (std::vector<std::size_t>{2}));
  const Eigen::Quaterniond hip = about(0.7, {1, 2, 3}), shin = about(-1.1, {0, 1, 1});
  BonePlay play{.bound = skeleton.bound()};
  play.keys = {{skeleton.branch(2), skeleton.axes(2), RigidMotion({{0, {0, 0, 0}, shin}})},
               {skeleton.branch(0), skeleton.axes(0), RigidMotion({{0, {0, 0, 0}, hip}})}};
  BonePoses poses = skeleton.bound();
  play.sample(0, poses);
  EXPECT_LE(skeleton.own_turn(0, poses).angularDistance(hip), 1e-7);
  EXPECT_LE(skeleton.own_turn(1, poses).angularDistance(Eigen::Quaterniond::Identity()), 1e-7);
  EXPECT_LE(skeleton.own_turn(2, poses).angularDistance(shin), 1e-7);
}

}  // namespace bone_play_test
}  // namespace exmat::runtime

#include "runtime/sim/step/example_drivers.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

// Weights by joints against closed forms.
namespace exmat::runtime {
namespace example_drivers_test {

/// An arm and a hand that hangs on it, bound with other axes.
Skeleton arm() {
  SkeletonData data;
  data.bones = {"arm", "hand"};
  data.parents = IndexVector(Eigen::Vector2i(-1, 0));
  data.bind.setZero(6, 4);
  data.bind.block<3, 3>(0, 0).setIdentity();
  data.bind.block<3, 3>(3, 0) = Eigen::AngleAxisd(0.9, Eigen::Vector3d(1, 1, 0).normalized()).toRotationMatrix();
  data.bind(3, 3) = 1;
  data.first_frames = IndexVector::Zero(1);
  data.poses.resize(0, 7);
  return Skeleton(data);
}

/// Weights of three examples where the hand is turned so in its own axes, and the arm somehow.
Eigen::VectorXd weights(const std::vector<ExampleDriver>& drivers, const Eigen::Quaterniond& hand,
                        const Eigen::Quaterniond& of_arm = Eigen::Quaterniond(0.6, 0, 0.8, 0)) {
  const Skeleton skeleton = arm();
  BonePlay play{.bound = skeleton.bound()};
  play.keys = {{skeleton.branch(1), skeleton.axes(1), RigidMotion({{0, {0, 0, 0}, hand}})},
               {skeleton.branch(0), skeleton.axes(0), RigidMotion({{0, {0, 0, 0}, of_arm}})}};
  BonePoses poses = skeleton.bound();
  play.sample(0, poses);
  Eigen::VectorXd found(3);
  drive(drivers, skeleton, poses, found);
  EXPECT_NEAR(found.sum(), 1, 1e-15);
  return found;
}

Eigen::Quaterniond about(double angle, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

TEST(ExampleDrivers, FollowTheAngleAboutAnAxis) {
  const ExampleDriver bend{.example = 1, .bone = 1, .axis = Eigen::Vector3d::UnitZ(), .angles = {0.2, 1.2}};
  for (const auto& [angle, expected] :
       {std::pair(-2.0, 0.0), {0.1, 0.0}, {0.45, 0.25}, {0.7, 0.5}, {1.2, 1.0}, {3.0, 1.0}}) {
    EXPECT_NEAR(weights({bend}, about(angle, {0, 0, 1}))[1], expected, 1e-14) << angle;
    // q and -q are one rotation.
    EXPECT_NEAR(weights({bend}, Eigen::Quaterniond(-about(angle, {0, 0, 1}).coeffs()))[1], expected, 1e-14) << angle;
  }
  EXPECT_NEAR(weights({bend}, about(0.7, {1, 0, 0}))[1], 0, 1e-14) << "about another axis";
  const ExampleDriver back{.example = 2, .bone = 1, .axis = Eigen::Vector3d::UnitZ(), .angles = {0, -1}};
  EXPECT_NEAR(weights({back}, about(-0.25, {0, 0, 1}))[2], 0.25, 1e-14);
}

TEST(ExampleDrivers, FollowTheDistanceFromARotation) {
  const Eigen::Quaterniond pose = about(1, {0.3, -1, 0.2});
  const ExampleDriver near{.example = 1, .bone = 1, .rotation = pose, .radius = 0.5};
  for (const double distance : {0.0, 0.1, 0.25, 0.49, 0.6, 2.0}) {
    const double share = std::min(1.0, distance / 0.5), expected = std::pow(1 - share * share, 2);
    // The angle of a quaternion near 1 is known to the root of the rounding.
    EXPECT_NEAR(weights({near}, pose * about(distance, {1, 2, -1}))[1], expected, 1e-7) << distance;
  }
}

TEST(ExampleDrivers, OfOneExampleMultiplyAndOfSeveralShare) {
  const ExampleDriver hand{.example = 1, .bone = 1, .axis = Eigen::Vector3d::UnitX(), .angles = {0, 1}},
      own{.example = 1, .bone = 0, .axis = Eigen::Vector3d::UnitY(), .angles = {0, 2}},
      other{.example = 2, .bone = 1, .axis = Eigen::Vector3d::UnitX(), .angles = {0, 0.5}};
  const Eigen::Quaterniond turn = about(0.4, {1, 0, 0}), of_arm = about(0.5, {0, 1, 0});
  EXPECT_NEAR(weights({hand, own}, turn, of_arm)[1], 0.4 * 0.25, 1e-14);
  EXPECT_NEAR(weights({hand, own}, turn, of_arm)[0], 1 - 0.4 * 0.25, 1e-14);
  EXPECT_LE((weights({hand, other}, turn) - Eigen::Vector3d(0, 0.4 / 1.2, 0.8 / 1.2)).norm(), 1e-14);
}

}  // namespace example_drivers_test
}  // namespace exmat::runtime

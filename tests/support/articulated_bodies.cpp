#include "tests/support/articulated_bodies.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace exmat::test {
namespace {

using Eigen::Vector3d;

constexpr double kBlend = 1.2;  // of a bone's radius, over which its motion gives way to its neighbour's

double smooth_step(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Eigen::Matrix3d turn(char axis, double degrees) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vector3d::Unit(axis - 'x')).toRotationMatrix();
}

struct Bone {
  int parent = -1;
  Vector3d from, to;
  double radius_from = 0, radius_to = 0;

  double distance(const Vector3d& x) const {
    const Vector3d axis = to - from;
    const double t = std::clamp((x - from).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    return (x - from - t * axis).norm() - (1 - t) * radius_from - t * radius_to;
  }
};

struct Turn {
  int bone = 0;
  Eigen::Matrix3d rotation;  // about its beginning, in the rest frame
};

class Skeleton {
 public:
  explicit Skeleton(std::vector<Bone> bones) : bones_(std::move(bones)) {}

  double distance(const Vector3d& x) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Bone& bone : bones_) least = std::min(least, bone.distance(x));
    return least;
  }

  Eigen::AlignedBox3d bounds() const {
    Eigen::AlignedBox3d box;
    for (const Bone& bone : bones_)
      for (const Vector3d& end : {bone.from, bone.to})
        for (const double sign : {-1.0, 1.0})
          box.extend(end + sign * Vector3d::Constant(std::max(bone.radius_from, bone.radius_to)));
    return box;
  }

  // Linear blend skinning: each point goes with the bones that it is nearest to.
  Pose posed(const std::vector<Turn>& turns) const {
    std::vector<Eigen::Affine3d> motions;
    for (std::size_t b = 0; b < bones_.size(); ++b) {
      Eigen::Affine3d motion = Eigen::Affine3d::Identity();
      if (bones_[b].parent >= 0) motion = motions[static_cast<std::size_t>(bones_[b].parent)];
      for (const Turn& turned : turns)
        if (turned.bone == static_cast<int>(b))
          motion.translate(bones_[b].from).rotate(turned.rotation).translate(-bones_[b].from);
      motions.push_back(motion);
    }
    return [bones = bones_, motions](const Vector3d& x) {
      const Bone& own = *std::ranges::min_element(bones, {}, [&](const Bone& bone) { return bone.distance(x); });
      Vector3d sum = Vector3d::Zero();
      double total = 0;
      for (std::size_t b = 0; b < bones.size(); ++b) {
        const double reach = kBlend * std::min(own.radius_from, bones[b].radius_from);
        const double beyond = (bones[b].distance(x) - own.distance(x)) / reach, weight = std::exp(-beyond * beyond);
        sum += weight * (motions[b] * x);
        total += weight;
      }
      return Vector3d(sum / total);
    };
  }

 private:
  std::vector<Bone> bones_;
};

PosableBody skinned(const std::string& name, const Skeleton& skeleton, double cell,
                    const std::vector<std::pair<std::string, std::vector<Turn>>>& poses) {
  PosableBody body{name, [=](const Vector3d& x) { return skeleton.distance(x); }, skeleton.bounds(), cell, {}};
  for (const auto& [pose, turns] : poses) body.poses.push_back({pose, skeleton.posed(turns)});
  return body;
}

// A plane figure of this distance, as thick as 2 `half`.
double extruded(double in_plane, double z, double half) { return std::max(in_plane, std::abs(z) - half); }

double box_distance(const Vector3d& x, const Vector3d& low, const Vector3d& high) {
  return std::max((low - x).maxCoeff(), (x - high).maxCoeff());
}

// The plane of x and y rolled up about an axis through the origin of that plane, between -half and half along
// `across`.
Pose rolled(int across, double half, double degrees) {
  return [=](const Vector3d& x) {
    const double angle = degrees * std::numbers::pi / 180, radius = 2 * half / angle, at = x[across] / radius;
    Vector3d y = x;
    y[across] = (radius - x[2]) * std::sin(at);
    y[2] = radius - (radius - x[2]) * std::cos(at);
    return y;
  };
}

Pose twisted(int along, double half, double degrees) {
  return [=](const Vector3d& x) {
    const double angle = degrees * std::numbers::pi / 180 * x[along] / (2 * half);
    return Vector3d(Eigen::AngleAxisd(angle, Vector3d::Unit(along)) * x);
  };
}

}  // namespace

PosableBody figure_body(const Proportions& proportions, double strength) {
  const double l = proportions.length, g = proportions.girth, s = strength;
  std::vector<Bone> bones{{-1, {0, 0, 0}, {0, 0, 0.55}, 0.17 * g, 0.2 * g},
                          {0, {0, 0, 0.7}, {0, 0, 0.92}, 0.1 * g, 0.15 * g}};
  for (const double side : {1.0, -1.0}) {
    const int first = static_cast<int>(bones.size());
    const auto at = [&](double x, double y, double z) { return Vector3d(side * x, y, z); };
    bones.push_back({0, at(0.2, 0, 0.52), at(0.2 + 0.36 * l, 0, 0.52), 0.1 * g, 0.09 * g});
    bones.push_back({first, at(0.2 + 0.36 * l, 0, 0.52), at(0.2 + 0.75 * l, 0, 0.52), 0.09 * g, 0.085 * g});
    bones.push_back({0, at(0.17, 0, -0.06), at(0.21, 0, -0.06 - 0.45 * l), 0.105 * g, 0.1 * g});
    bones.push_back({first + 2, at(0.21, 0, -0.06 - 0.45 * l), at(0.23, 0, -0.06 - 0.9 * l), 0.1 * g, 0.09 * g});
    bones.push_back({first + 3, at(0.23, 0, -0.06 - 0.9 * l), at(0.23, -0.22, -0.06 - 0.9 * l), 0.09 * g, 0.08 * g});
  }
  // Bones: torso 0, head 1; arm 2, 3, leg 4, 5, foot 6 of one side, and so on of the other.
  return skinned(
      "figure", Skeleton(bones), 0.085,
      {{"arms up", {{2, turn('y', -65 * s)}, {7, turn('y', 65 * s)}, {1, turn('x', 15 * s)}}},
       {"arms down", {{2, turn('y', 60 * s)}, {7, turn('y', -60 * s)}, {3, turn('z', -25 * s)}}},
       {"stride",
        {{4, turn('x', 40 * s)},
         {9, turn('x', -40 * s)},
         {5, turn('x', -45 * s)},
         {2, turn('z', 30 * s)},
         {7, turn('z', 30 * s)}}},
       {"seated",
        {{4, turn('x', -75 * s)},
         {9, turn('x', -75 * s)},
         {5, turn('x', 75 * s)},
         {10, turn('x', 75 * s)},
         {2, turn('z', -40 * s)},
         {7, turn('z', 40 * s)}}},
       {"wave", {{2, turn('y', -50 * s)}, {3, turn('y', -55 * s)}, {7, turn('y', -30 * s)}, {9, turn('y', 30 * s)}}}});
}

PosableBody animal_body(const Proportions& proportions, double strength) {
  const double l = proportions.length, g = proportions.girth, s = strength;
  std::vector<Bone> bones{
      {-1, {0, 0, 0}, {-0.5, 0, 0}, 0.2 * g, 0.19 * g},  // hind half
      {-1, {0, 0, 0}, {0.5, 0, 0}, 0.2 * g, 0.19 * g},   // fore half
      {1, {0.55, 0, 0.1}, {0.55 + 0.28 * l, 0, 0.1 + 0.34 * l}, 0.12 * g, 0.1 * g},
      {2, {0.55 + 0.28 * l, 0, 0.1 + 0.34 * l}, {0.55 + 0.6 * l, 0, 0.1 + 0.3 * l}, 0.12 * g, 0.085 * g},
      {0, {-0.62, 0, 0.1}, {-0.62 - 0.3 * l, 0, 0.16}, 0.09 * g, 0.08 * g},
      {4, {-0.62 - 0.3 * l, 0, 0.16}, {-0.62 - 0.6 * l, 0, 0.16}, 0.08 * g, 0.075 * g}};
  for (const double x : {0.42, -0.42})
    for (const double side : {1.0, -1.0}) {
      const int first = static_cast<int>(bones.size());
      const double y = 0.2 * side;
      bones.push_back({x > 0 ? 1 : 0, {x, y, -0.06}, {x, y, -0.06 - 0.38 * l}, 0.105 * g, 0.09 * g});
      bones.push_back({first, {x, y, -0.06 - 0.38 * l}, {x, y, -0.06 - 0.74 * l}, 0.09 * g, 0.08 * g});
    }
  // Bones: neck 2, head 3, tail 4 and 5; legs 6 and 7, 8 and 9 before, 10 and 11, 12 and 13 behind.
  return skinned(
      "animal", Skeleton(bones), 0.085,
      {{"gallop",
        {{6, turn('y', -40 * s)},
         {8, turn('y', -25 * s)},
         {10, turn('y', 40 * s)},
         {12, turn('y', 25 * s)},
         {4, turn('y', 30 * s)}}},
       {"grazing", {{2, turn('y', 70 * s)}, {3, turn('y', 30 * s)}, {4, turn('z', 35 * s)}}},
       {"turning", {{1, turn('z', 30 * s)}, {2, turn('z', 35 * s)}, {0, turn('z', -25 * s)}, {4, turn('z', -30 * s)}}},
       {"begging",
        {{1, turn('y', -35 * s)},
         {6, turn('y', -50 * s)},
         {8, turn('y', -50 * s)},
         {10, turn('y', -30 * s)},
         {12, turn('y', -30 * s)}}},
       {"paw", {{6, turn('y', -70 * s)}, {7, turn('y', 50 * s)}, {2, turn('z', -30 * s)}, {5, turn('z', 50 * s)}}}});
}

PosableBody letter_c_body(const Proportions& proportions, double strength) {
  constexpr int kSide = 5;               // bones from the middle to an end
  constexpr double kOpen = 130 / kSide;  // degrees of a bone
  const double radius = 0.6 * proportions.length, thick = 0.12 * proportions.girth, half = 0.1 * proportions.girth;
  std::vector<Bone> bones;
  const auto at = [&](double degrees) {
    return Vector3d(-radius * std::cos(degrees * std::numbers::pi / 180),
                    radius * std::sin(degrees * std::numbers::pi / 180), 0);
  };
  for (const double side : {1.0, -1.0})
    for (int k = 0; k < kSide; ++k)
      bones.push_back({k == 0 ? -1 : static_cast<int>(bones.size()) - 1, at(side * kOpen * k),
                       at(side * kOpen * (k + 1)), thick, thick});
  const Skeleton skeleton(bones);
  PosableBody body = skinned("letter C", skeleton, 0.065, {});
  body.distance = [=](const Vector3d& x) { return extruded(skeleton.distance({x[0], x[1], 0}), x[2], half); };
  std::vector<Turn> open, closed, twisted_out;
  for (int k = 0; k < kSide; ++k) {
    open.push_back({k, turn('z', 14 * strength)});
    open.push_back({k + kSide, turn('z', -14 * strength)});
    closed.push_back({k, turn('z', -4 * strength)});
    closed.push_back({k + kSide, turn('z', 4 * strength)});
    twisted_out.push_back({k, turn('x', 12 * strength)});
    twisted_out.push_back({k + kSide, turn('x', 12 * strength)});
  }
  for (const auto& [name, turns] : {std::pair{"opened", open}, {"closed", closed}, {"ends apart", twisted_out}})
    body.poses.push_back({name, skeleton.posed(turns)});
  body.poses.push_back({"half folded", rolled(1, radius, 110 * strength)});
  return body;
}

PosableBody letter_d_body(const Proportions& proportions, double strength) {
  const double radius = 0.6 * proportions.length, thick = 0.12 * proportions.girth, half = 0.1 * proportions.girth;
  PosableBody body;
  body.name = "letter D";
  body.cell = 0.065;
  body.distance = [=](const Vector3d& x) {
    const double y = std::abs(x[1]), from_stem = std::hypot(x[0] + 0.2, std::max(0.0, y - radius));
    const double from_bow =
        x[0] > -0.2 ? std::abs(std::hypot(x[0] + 0.2, y) - radius) : std::hypot(x[0] + 0.2, y - radius);
    return extruded(std::min(from_stem, from_bow) - thick, x[2], half);
  };
  body.bounds = {Vector3d(-0.2 - thick, -radius - thick, -half), Vector3d(radius - 0.2 + thick, radius + thick, half)};
  body.poses = {{"folded", rolled(0, 0.5 * radius, 100 * strength)},
                {"half folded", rolled(1, radius, 110 * strength)},
                {"twisted", twisted(1, radius, 80 * strength)}};
  return body;
}

PosableBody armed_bar_body(const Proportions& proportions, double strength) {
  const double l = proportions.length, g = proportions.girth, s = strength;
  const Vector3d low(-2, -0.4 * g, -0.3 * g), high(2, 0.4 * g, 0.3 * g), arm_low(0.4, 0, -0.3 * g),
      arm_high(1.1, 0.4 + 1.2 * l, 0);
  PosableBody body;
  body.name = "bar with an arm";
  body.cell = 0.15;
  body.distance = [=](const Vector3d& x) {
    return std::min(box_distance(x, low, high), box_distance(x, arm_low, arm_high));
  };
  body.bounds = Eigen::AlignedBox3d(low, high).merged({arm_low, arm_high});
  const Pose aside = [=](const Vector3d& x) {
    const Vector3d pivot(0.75, 0.4 * g, 0);
    const double share = smooth_step((x[1] - 0.2 * g) / 0.8);
    return Vector3d(pivot + turn('z', 35 * s * share) * (x - pivot));
  };
  body.poses = {
      {"bent", bend(4, 1.3 * s)}, {"twisted", twist(4, 1.2 * s)}, {"S", s_bend(4, 0.8 * s)}, {"arm aside", aside}};
  return body;
}

}  // namespace exmat::test

#include "runtime/sim/contact/plane_contacts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <gtest/gtest.h>
#include <numeric>
#include <string>
#include <vector>

#include "runtime/sim/contact/obstacle.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/random.h"

// Against the law of one vertex at a time, with every instruction set.

namespace exmat::runtime {
namespace plane_contacts_test {

constexpr double kRounding = 1e-13;  // of numbers of size one: some sums of a few terms
constexpr Eigen::Index kModes = 5;
constexpr std::size_t kCount = 61;  // the last panel has lanes that are not in use

Eigen::Vector3d random_vector3(unsigned seed, double size) { return size * test::random_vector(3, seed); }

/// Candidates of a body beside three planes, about as many above as below: with and without damping and friction, some
/// of it so weak that they slide.
struct Scene {
  Scene() : basis(test::random_matrix(3 * static_cast<Eigen::Index>(kCount), kModes, 1)), q(kModes) {
    vertices.resize(kCount);
    std::iota(vertices.begin(), vertices.end(), 0);
    rows = VertexRows(basis, vertices);
    const Eigen::VectorXd coordinates = 0.3 * test::random_vector(kModes, 2);
    std::copy(coordinates.begin(), coordinates.end(), q.data());
    placement.position = random_vector3(3, 1);
    placement.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
    for (unsigned p = 0; p < 3; ++p) planes[p] = {placement.position, random_vector3(4 + p, 1).normalized()};
    for (std::size_t i = 0; i < kCount; ++i) {
      const auto seed = static_cast<unsigned>(100 + 5 * i);
      rest.push_back(random_vector3(seed, 1));
      ContactCandidate& own = candidates.emplace_back();
      own.vertex = static_cast<int>(i);
      own.obstacle = static_cast<int>(i % 3);
      own.normal = planes[i % 3].normal;
      own.carried = point(i) + random_vector3(seed + 1, 0.1);
      own.anchor = own.carried + random_vector3(seed + 2, 0.1);
      own.stiffness = 1 + static_cast<double>(i % 5);
      own.damping = i % 2 == 0 ? 0 : 0.4;
      own.spring_share = 1 / (1 + own.damping);
      own.friction_force = i % 4 == 0 ? 0 : i % 4 == 1 ? 0.02 : 3;
    }
    planes_in_lanes = PlaneContacts(kCount + 20);
    for (std::size_t i = 0; i < kCount; ++i)
      planes_in_lanes.set(i, rest[i], planes[i % 3].distance(candidates[i].carried), 0.3, candidates[i]);
    planes_in_lanes.end(kCount);
  }

  Eigen::Vector3d moved(std::size_t i) const {
    return rest[i] + rows[static_cast<int>(i)] * Eigen::Map<const Eigen::VectorXd>(q.data(), kModes);
  }
  Eigen::Vector3d arm(std::size_t i) const { return placement.rotation * moved(i); }
  Eigen::Vector3d point(std::size_t i) const { return placement.position + arm(i); }
  std::array<double, 12> pose() const {
    std::array<double, 12> numbers;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data()) = placement.rotation;
    Eigen::Map<Eigen::Vector3d>(numbers.data() + 9) = placement.position;
    return numbers;
  }
  PlaneContacts::Body body() const { return {rows, placement, q}; }

  RowMatrix basis;
  std::vector<int> vertices;
  VertexRows rows;
  AlignedArray q;
  Placement placement;
  std::array<Plane, 3> planes;
  std::vector<Eigen::Vector3d> rest;
  std::vector<ContactCandidate> candidates;
  PlaneContacts planes_in_lanes;
};

void expect_same(const ContactCandidate& found, const ContactCandidate& expected) {
  EXPECT_LE((found.force - expected.force).norm(), kRounding);
  EXPECT_LE(std::abs(found.normal_force - expected.normal_force), kRounding);
  EXPECT_LE(std::abs(found.gap - expected.gap), kRounding);
  EXPECT_EQ(found.is_loaded(), expected.is_loaded());
  if (expected.friction_force > 0) {
    EXPECT_LE((found.slip - expected.slip).norm(), kRounding);
  }
}

TEST(PlaneContacts, AreThoseOfOneVertexAtATime) {
  Scene scene;
  AlignedArray loads(kModes);
  const PlaneContacts::Sums sums = scene.planes_in_lanes.evaluate(scene.body(), 0, false, loads);
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = force;
  Eigen::VectorXd generalised = Eigen::VectorXd::Zero(kModes);
  double potential = 0, stiffness = 0;
  int touching = 0, sliding = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    SCOPED_TRACE(i);
    ContactCandidate expected = scene.candidates[i], found = expected;
    const Plane& plane = scene.planes[i % 3];
    const double own = evaluate_contact(plane.distance(scene.point(i)), plane.normal, scene.point(i), expected);
    scene.planes_in_lanes.take(i, found);
    expect_same(found, expected);
    EXPECT_LE((found.arm - scene.arm(i)).norm(), kRounding);
    if (expected.is_loaded()) potential += own;
    force += expected.force;
    torque += scene.arm(i).cross(expected.force);
    generalised +=
        scene.rows[static_cast<int>(i)].transpose() * (scene.placement.rotation.transpose() * expected.force);
    stiffness += expected.normal_stiffness();
    touching += expected.normal_force > 0;
    sliding += expected.friction_force > 0 && expected.slip.norm() * expected.stiffness > 2 * expected.friction_force;
  }
  EXPECT_EQ(sums.touching, touching);
  EXPECT_GT(touching, 10);
  EXPECT_LT(touching, 50);
  EXPECT_GT(sliding, 5);
  EXPECT_LE((sums.force - force).norm(), kRounding * kCount);
  EXPECT_LE((sums.torque - torque).norm(), kRounding * kCount);
  EXPECT_LE((Eigen::Map<Eigen::VectorXd>(loads.data(), kModes) - generalised).norm(), kRounding * kCount);
  EXPECT_NEAR(sums.potential, potential, kRounding * kCount);
  EXPECT_NEAR(sums.stiffness, stiffness, kRounding * kCount);
  EXPECT_NEAR(scene.planes_in_lanes.potential(scene.body(), 0), potential, kRounding * kCount);
}

TEST(PlaneContacts, OfEveryInstructionSetAreTheSame) {
  Scene scene;
  AlignedArray loads(kModes);
  scene.planes_in_lanes.evaluate(scene.body(), 0, false, loads);
  const std::array<double, 12> pose = scene.pose();
  for (const Kernels* kernels : available())
    for (std::size_t p = 0; p < scene.planes_in_lanes.panels().size(); ++p) {
      const PlaneContactPanel& expected = scene.planes_in_lanes.panels()[p];
      PlaneContactPanel own = expected;
      std::array<double, 3 * kLanes> products, turned;
      for (std::size_t l = 0; l < kLanes; ++l) {
        const std::size_t i = std::min(p * kLanes + l, kCount - 1);
        Eigen::Map<Eigen::Vector3d>(products.data() + 3 * l) = scene.moved(i) - scene.rest[i];
      }
      std::array<double, kPlaneSums * kLanes> sums{};
      std::array<double, kLanes> potential{};
      const unsigned lanes = kernels->plane_contacts(own, pose.data(), products.data(), turned.data(), sums.data());
      kernels->plane_potential(own, pose.data(), products.data(), potential.data());
      for (std::size_t l = 0; l < kLanes; ++l) {
        SCOPED_TRACE(std::string(kernels->name) + ", panel " + std::to_string(p) + ", lane " + std::to_string(l));
        EXPECT_EQ((lanes >> l & 1) != 0, expected.normal_force[l] > 0 || expected.friction[l] > 0);
        EXPECT_NEAR(potential[l], sums[6 * kLanes + l], kRounding);
        Eigen::Vector3d force;
        for (int i = 0; i < 3; ++i) {
          force[i] = own.force[i][l];
          EXPECT_NEAR(own.force[i][l], expected.force[i][l], kRounding);
          EXPECT_NEAR(own.arm[i][l], expected.arm[i][l], kRounding);
          EXPECT_NEAR(own.slip[i][l], expected.slip[i][l], kRounding);
          EXPECT_NEAR(sums[static_cast<std::size_t>(i) * kLanes + l], force[i], kRounding);
        }
        EXPECT_NEAR(own.normal_force[l], expected.normal_force[l], kRounding);
        EXPECT_NEAR(own.gap[l], expected.gap[l], kRounding);
        EXPECT_LE((scene.placement.rotation * Eigen::Map<Eigen::Vector3d>(turned.data() + 3 * l) - force).norm(),
                  kRounding);
      }
    }
}

// The squares of each vertex's factors sum up to its own stiffness, and none of them is zero.
TEST(PlaneContacts, StiffnessIsThatOfOneVertexAtATime) {
  Scene scene;
  scene.candidates[8].normal = Eigen::Vector3d::UnitY();  // nothing slips: any direction along the plane
  scene.candidates[8].carried = scene.candidates[8].anchor = scene.point(8);
  scene.candidates[8].friction_force = 2;
  scene.planes_in_lanes.set(8, scene.rest[8], -0.1, 0.3, scene.candidates[8]);
  AlignedArray loads(kModes);
  scene.planes_in_lanes.evaluate(scene.body(), 0, false, loads);
  for (const Kernels* kernels : available())
    for (std::size_t p = 0; p < scene.planes_in_lanes.panels().size(); ++p) {
      Eigen::Matrix<double, 3, kPlaneFactors> vectors;
      Eigen::Matrix<double, 6, kPlaneFactors> rigid;
      std::array<int, kPlaneFactors> lanes;
      const std::array<double, 12> pose = scene.pose();
      const std::ptrdiff_t count = kernels->plane_factors(scene.planes_in_lanes.panels()[p], pose.data(),
                                                          vectors.data(), rigid.data(), lanes.data());
      for (std::size_t l = 0; l < kLanes && p * kLanes + l < kCount; ++l) {
        const std::size_t i = p * kLanes + l;
        SCOPED_TRACE(std::string(kernels->name) + ", " + std::to_string(i));
        ContactCandidate one = scene.candidates[i];
        scene.planes_in_lanes.take(i, one);
        const StiffnessFactors expected(one);
        Eigen::Matrix3d turned = Eigen::Matrix3d::Zero(), world = turned;
        int own = 0;
        for (std::ptrdiff_t k = 0; k < count; ++k) {
          if (lanes[static_cast<std::size_t>(k)] != static_cast<int>(l)) continue;
          ++own;
          turned += vectors.col(k) * vectors.col(k).transpose();
          world += rigid.col(k).head<3>() * rigid.col(k).head<3>().transpose();
          EXPECT_LE((scene.placement.rotation * vectors.col(k) - rigid.col(k).head<3>()).norm(), kRounding);
          EXPECT_LE((scene.arm(i).cross(rigid.col(k).head<3>()) - rigid.col(k).tail<3>()).norm(), kRounding);
        }
        EXPECT_EQ(own, expected.count);
        EXPECT_LE((world - expected.used() * expected.used().transpose()).norm(), 10 * kRounding);
      }
    }
}

TEST(PlaneContacts, FrictionFollowsTheNormalForce) {
  Scene scene;
  AlignedArray loads(kModes);
  scene.planes_in_lanes.evaluate(scene.body(), 0, false, loads);
  FrictionChange change, expected_change;
  std::vector<ContactCandidate> expected = scene.candidates;
  for (std::size_t i = 0; i < kCount; ++i) {
    scene.planes_in_lanes.take(i, expected[i]);
    expected_change.refresh(0.3, expected[i]);
  }
  scene.planes_in_lanes.refresh_friction(change);
  EXPECT_EQ(change.change, expected_change.change);
  EXPECT_EQ(change.largest, expected_change.largest);
  for (std::size_t i = 0; i < kCount; ++i) {
    scene.planes_in_lanes.take(i, scene.candidates[i]);
    EXPECT_EQ(scene.candidates[i].friction_force, expected[i].friction_force);
  }
}

// A panel is left alone as long as none of its vertices can have come to its plane, and looked at from there on.
TEST(PlaneContacts, WhatIsTooFarAwayIsNotLookedAt) {
  Scene scene;
  for (std::size_t i = 0; i < kCount; ++i) {
    ContactCandidate& own = scene.candidates[i];
    own.friction_force = own.damping = 0;
    own.spring_share = 1;
    own.carried = scene.point(i);
    scene.planes_in_lanes.set(i, scene.rest[i], 0.5, 0, own);  // half a metre above
  }
  scene.planes_in_lanes.end(kCount);
  AlignedArray loads(kModes);
  EXPECT_EQ(scene.planes_in_lanes.evaluate(scene.body(), 0, true, loads).touching, 0);
  const Placement first = scene.placement;
  for (const double way : {0.4, 0.6}) {
    scene.placement.position = first.position - way * scene.planes[0].normal;
    loads = AlignedArray(kModes);
    const PlaneContacts::Sums sums = scene.planes_in_lanes.evaluate(scene.body(), way, false, loads);
    EXPECT_EQ(sums.touching > 0, way > 0.5);
    EXPECT_NEAR(scene.planes_in_lanes.potential(scene.body(), way), sums.potential, kRounding * kCount);
    EXPECT_EQ(scene.planes_in_lanes.panels()[0].gap[0] != 0, way > 0.5);
  }
}

}  // namespace plane_contacts_test
}  // namespace exmat::runtime

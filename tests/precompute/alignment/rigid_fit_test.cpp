#include "precompute/alignment/rigid_fit.h"

#include <Eigen/Geometry>
#include <array>
#include <gtest/gtest.h>
#include <numbers>
#include <utility>

#include "precompute/alignment/aligned_shape.h"
#include "tests/support/posed_bodies.h"

namespace exmat::precompute {
namespace {

BodySurface surface_of(const TetMesh& mesh) {
  const AlignedShape shape = aligned_shape(mesh, 0, "body");
  return body_surface(shape.basis, mesh.tets);
}

TetMesh turned(const TetMesh& mesh, const Eigen::Matrix3d& rotation) {
  return {mesh.vertices * rotation.transpose(), mesh.tets};
}

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

const TetMesh& object() {
  static const TetMesh mesh = test::armed_bar({20, 10, 2});
  return mesh;
}
const TetMesh& other_mesh() {
  static const TetMesh mesh = test::armed_bar({10, 5, 4});
  return mesh;
}

// Both meshes have the body's own planes: right angles are found to rounding.
TEST(RigidFitter, FindsTurnsByRightAnglesExactly) {
  const std::array<std::pair<int, double>, 3> turns{{{0, 90}, {1, -90}, {2, 180}}};
  for (const auto& [axis, degrees] : turns) {
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Eigen::Vector3d(Eigen::Vector3d::Unit(axis)))
            .toRotationMatrix();
    const RigidFitter fitter(surface_of(turned(other_mesh(), turn)), surface_of(object()));
    const auto fits = fitter.fits(false);
    EXPECT_LE((fits.front().rotation - turn.transpose()).norm(), 1e-12) << degrees;
    EXPECT_LE(fitter.at(turn.transpose()).gap, 1e-9);
    EXPECT_GE(fits[1].gap, 0.05);  // the body has no symmetry
  }
}

// Iterated over 100 points of a surface: a degree.
TEST(RigidFitter, FindsAnyTurn) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const RigidFitter fitter(surface_of(turned(other_mesh(), turn)), surface_of(object()));
  EXPECT_LE(angle_between(fitter.fits(false).front().rotation, turn.transpose()), 0.02);
}

TEST(RigidFitter, FindsMirrorImages) {
  TetMesh mirrored = other_mesh();
  mirrored.vertices.col(2) *= -1;
  mirrored.tets.col(0).swap(mirrored.tets.col(1));
  const RigidFitter fitter(surface_of(mirrored), surface_of(object()));
  EXPECT_GE(fitter.fits(false).front().gap, 0.03);  // the arm on the wrong half of the thickness
  const RigidFit fit = fitter.fits(true).front();
  EXPECT_LE((fit.rotation - Eigen::Matrix3d(Eigen::Vector3d(1, 1, -1).asDiagonal())).norm(), 1e-12);
  EXPECT_LE(fitter.at(fit.rotation).gap, 1e-9);
}

// A square bar lies upon itself in eight ways.
TEST(RigidFitter, OfASymmetricBodyFindsEveryTurn) {
  const TetMesh a = test::centred(test::box_mesh({12, 4, 4}, {4, 1, 1})),
                b = test::centred(test::box_mesh({10, 3, 3}, {4, 1, 1}));
  const auto fits = RigidFitter(surface_of(b), surface_of(a)).fits(false);
  EXPECT_EQ(std::ranges::count_if(fits, [](const RigidFit& fit) { return fit.gap < 1e-9; }), 8);
}

// The arm has 1.2 (0.8 + 0.3) 2 + 0.8 x 0.3 = 2.88 of 14.16: a fifth, of which the part by the bar is near it.
TEST(RigidFitter, SaysHowMuchOfASurfaceTheOtherLacks) {
  const TetMesh bare = test::without(object(), [](const Eigen::RowVector3d& x) { return x[1] > 0.8; });
  const RigidFitter fitter(surface_of(bare), surface_of(object()));
  const auto [of_bare, of_object] = fitter.uncovered(Eigen::Matrix3d::Identity(), 0.25);
  EXPECT_LE(of_bare, 0.05);
  EXPECT_GE(of_object, 0.1);
  EXPECT_LE(of_object, 0.21);
}

TEST(DescribeTurn, NamesAxisAndAngleOfTheBodyThatIsTurnedBack) {
  const auto of = [](double degrees, const Eigen::Vector3d& axis) {
    return describe_turn(
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).toRotationMatrix().transpose());
  };
  EXPECT_EQ(of(90, {1, 0, 0}), "turned by 90 degrees about x");
  EXPECT_EQ(of(-90, {0, 1, 0}), "turned by -90 degrees about y");
  EXPECT_EQ(of(30, {0, 0, -1}), "turned by -30 degrees about z");
  EXPECT_EQ(of(120, {1, 1, 1}), "turned by 120 degrees about the axis (0.58, 0.58, 0.58)");
}

}  // namespace
}  // namespace exmat::precompute

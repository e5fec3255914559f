#include "precompute/alignment/registration.h"

#include <Eigen/LU>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/mesh/geometry.h"
#include "precompute/alignment/aligned_shape.h"
#include "precompute/shape_space/transfer.h"
#include "tests/support/posed_bodies.h"

namespace exmat::precompute {
namespace registration_test {

constexpr double kLength = 4, kEdge = 0.2, kAngle = 0.8;

bool in_the_bar(const Eigen::Vector3d& x) {
  return std::abs(x[0]) < kLength / 2 && std::abs(x[1]) < 0.4 && std::abs(x[2]) < 0.3;
}

// True if the bar, bent by kAngle, holds a point: the bend undone.
bool in_the_bent_bar(const Eigen::Vector3d& x) {
  const double radius = kLength / kAngle;
  const Eigen::Vector2d from_axis(x[0], radius - x[2]);
  return in_the_bar({radius * std::atan2(from_axis[0], from_axis[1]), x[1], radius - from_axis.norm()});
}

/// The cubes whose middles are in a body, of a grid that begins at a place of its own.
TetMesh of_cubes(bool (*holds)(const Eigen::Vector3d&), const Eigen::RowVector3d& shift) {
  TetMesh mesh = test::centred(test::box_mesh({23, 7, 10}, {23 * kEdge, 7 * kEdge, 10 * kEdge}));
  mesh.vertices.rowwise() += shift;
  const Eigen::RowVector3d origin = mesh.vertices.colwise().minCoeff();
  return test::without(mesh, [&](const Eigen::RowVector3d& x) {
    const Eigen::RowVector3d cube = ((x - origin) / kEdge).array().floor() + 0.5;
    return !holds((origin + kEdge * cube).transpose());
  });
}

// A bar at rest laid over a mesh of a pose of it, beside where the pose has its vertices.
class LaidBar {
 public:
  LaidBar(const TetMesh& rest, const TetMesh& posed, const test::Pose& pose)
      : rest_(aligned_shape(rest, 0, "rest")),
        truth_(centred(test::posed(rest.vertices, pose) / length_of(rest))),
        registration_(rest_.mesh, {placed_positions(posed, {length_of(posed) / length_of(rest)}), posed.tets}),
        registered_(registration_.run(rest_.mesh.vertices)) {}

  double registered_error() const { return error(registered_.positions); }
  double relaxed_error() const { return error(registration_.relaxed(registered_)); }

 private:
  static double length_of(const TetMesh& mesh) { return std::cbrt(tet_volumes(mesh).sum()); }
  VertexArray centred(const VertexArray& x) const { return x.rowwise() - (rest_.basis.mass * x).colwise().sum(); }
  double size(const VertexArray& x) const { return std::sqrt((x.transpose() * (rest_.basis.mass * x)).trace()); }
  // Over the pose's displacement.
  double error(const VertexArray& positions) const {
    return size(centred(positions) - truth_) / size(truth_ - rest_.mesh.vertices);
  }

  AlignedShape rest_;
  VertexArray truth_;
  Registration registration_;
  Registered registered_;
};

const test::Pose kBend = test::bend(kLength, kAngle);

// Two tessellations of the bar whose surfaces are the same.
class RelaxedBoxes : public testing::Test {
 protected:
  const TetMesh rest_ = test::centred(test::box_mesh({20, 4, 3}, {kLength, 0.8, 0.6})),
                other_ = test::centred(test::box_mesh({23, 5, 4}, {kLength, 0.8, 0.6}));
};

// Each grid has the ends and sides of the bar up to half a cell elsewhere, which no pose has done.
TEST(RelaxedRegistration, OfStaircasesIsNearerToTheTruth) {
  const LaidBar bar(of_cubes(in_the_bar, {0.06, 0.03, 0.08}), of_cubes(in_the_bent_bar, {-0.03, 0.09, 0.02}), kBend);
  fmt::print("registered {:.3f}, relaxed {:.3f}\n", bar.registered_error(), bar.relaxed_error());
  EXPECT_LT(bar.relaxed_error(), 0.85 * bar.registered_error());
}

// Relaxing keeps what is known.
TEST_F(RelaxedBoxes, OfABendIsWhatWasRegistered) {
  const LaidBar bar(rest_, test::posed(other_, kBend), kBend);
  fmt::print("registered {:.3f}, relaxed {:.3f}\n", bar.registered_error(), bar.relaxed_error());
  EXPECT_LT(bar.relaxed_error(), 0.06);
}

// The energy's rest state is that of the rest example: it would take back a change of size, too.
TEST_F(RelaxedBoxes, OfALargerBodyIsAsLarge) {
  const test::Pose larger = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(1.3 * x); };
  const LaidBar bar(rest_, test::posed(other_, larger), larger);
  fmt::print("registered {:.3f}, relaxed {:.3f}\n", bar.registered_error(), bar.relaxed_error());
  EXPECT_LT(bar.relaxed_error(), 0.05);
}

}  // namespace registration_test
}  // namespace exmat::precompute

#include "precompute/alignment/pose_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"
#include "precompute/shape_space/transfer.h"
#include "tests/support/posed_bodies.h"

namespace exmat::precompute {
namespace {

constexpr double kLength = 4;

TetMesh bar(const std::array<int, 3>& cells, double height, std::uint32_t seed) {
  return test::centred(test::shaken_box(cells, {kLength, 1, height}, seed));
}

// A bar with a square hole through it, the grid's lines on its edges.
TetMesh holed_bar(const std::array<int, 3>& cells) {
  return test::without(test::centred(test::box_mesh(cells, {kLength, 1, 0.6})),
                       [](const Eigen::RowVector3d& x) { return std::abs(x[0] - 0.5) < 0.5 && std::abs(x[1]) < 0.25; });
}

// An L of unequal arms and unequal thickness: no symmetry but the mirror at its middle plane, which `crooked` removes.
TetMesh corner_piece(const std::array<int, 3>& cells, bool crooked) {
  TetMesh mesh = test::without(test::box_mesh(cells, {3, 2, 0.5}),
                               [](const Eigen::RowVector3d& x) { return x[0] > 0.75 && x[1] > 0.5; });
  if (crooked)
    for (auto x : mesh.vertices.rowwise()) x[2] += 0.3 * x[0] * x[0] / 3 - 0.25 * x[1] * x[1];
  return mesh;
}

struct Result {
  PoseAlignment alignment;
  double error = 0;  ///< relative error of the rest example's displacement, in the frame of the pose
};

// The pose is that of `posed`; where it is the same body, its truth on the rest example is known.
Result align(const TetMesh& rest, const TetMesh& posed, const test::Pose& pose, const AlignmentHints& hints = {}) {
  const AlignedShape a = aligned_shape(rest, 0, "rest"), b = aligned_shape(posed, 0, "posed");
  Result result{align_pose(a, rest_symmetry(a), b, hints)};
  const VertexArray truth = normalised_positions(test::posed(rest, pose));
  const auto norm = [&](const VertexArray& field) {
    return std::sqrt((field.transpose() * (a.basis.mass * field)).trace());
  };
  result.error = norm(result.alignment.positions - truth) / norm(truth - a.mesh.vertices);
  return result;
}

// Interpolation that takes the values at vertices.
SparseMatrix at_vertices(const std::vector<std::int32_t>& vertices, const std::array<int, 3>& cells) {
  SparseMatrix points(std::ssize(vertices), (cells[0] + 1) * (cells[1] + 1) * (cells[2] + 1));
  for (std::size_t k = 0; k < vertices.size(); ++k) points.insert(static_cast<Eigen::Index>(k), vertices[k]) = 1;
  return points;
}

Correspondences corners(const std::array<int, 3>& on_rest, const std::array<int, 3>& on_pose) {
  return {at_vertices(test::box_corners(on_rest), on_rest), at_vertices(test::box_corners(on_pose), on_pose)};
}

// The limits are 1.5 times what these cases measure; a wrong map has errors above 0.5.
TEST(AlignPose, FindsPosesOnAnotherTessellation) {
  const TetMesh rest = bar({12, 4, 3}, 0.6, 1), posed = bar({11, 3, 3}, 0.6, 2);
  for (const auto& [pose, limit] : {std::pair{test::bend(kLength, 1.57), 0.03},
                                    {test::twist(kLength, 1.2), 0.15},
                                    {test::s_bend(kLength, 0.8), 0.12}}) {
    const Result result = align(rest, test::posed(posed, pose), pose);
    EXPECT_LE(result.error, limit);
    EXPECT_LE(result.alignment.doubt, 0.4);
    EXPECT_FALSE(result.alignment.ambiguous);
    EXPECT_FALSE(result.alignment.mirrored);
    EXPECT_EQ(result.alignment.inverted_fraction, 0);
  }
}

TEST(AlignPose, OfMeshesMuchFinerAndMuchCoarser) {
  const TetMesh coarse = bar({8, 2, 2}, 0.6, 1), fine = bar({24, 8, 5}, 0.6, 2);
  const auto pose = test::bend(kLength, 1.2);
  EXPECT_LE(align(coarse, test::posed(fine, pose), pose).error, 0.06);
  EXPECT_LE(align(fine, test::posed(coarse, pose), pose).error, 0.06);
}

TEST(AlignPose, OfThinPartsAndBodiesWithHoles) {
  const auto pose = test::bend(kLength, 1.2);
  EXPECT_LE(align(bar({14, 5, 1}, 0.08, 1), test::posed(bar({12, 4, 1}, 0.08, 2), pose), pose).error, 0.06);
  const Result holed = align(holed_bar({12, 4, 3}), test::posed(holed_bar({16, 8, 2}), pose), pose);
  EXPECT_LE(holed.error, 0.06);
  EXPECT_FALSE(holed.alignment.ambiguous);
}

// Nothing in a bent bar's shape says which of its sides was up: told, not guessed.
TEST(AlignPose, UnknownFrameOfASymmetricBodyIsAmbiguousUnlessThereAreLandmarks) {
  const std::array<int, 3> ours{12, 4, 3}, theirs{11, 3, 3};
  const TetMesh rest = bar(ours, 0.6, 1);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const auto bend = test::bend(kLength, 1.57);
  const test::Pose pose = [&](const Eigen::Vector3d& x) { return Eigen::Vector3d(R * bend(x)); };
  const TetMesh posed = test::posed(bar(theirs, 0.6, 2), pose);
  AlignmentHints hints{true, {}, false};
  const Result guess = align(rest, posed, pose, hints);
  EXPECT_TRUE(guess.alignment.ambiguous);
  EXPECT_GE(guess.alignment.competing_maps, 1);
  hints.correspondences = corners(ours, theirs);
  const Result told = align(rest, posed, pose, hints);
  EXPECT_FALSE(told.alignment.ambiguous);
  EXPECT_LE(told.error, 0.03);  // of the whole motion, its rotation included
}

// Every map of so far a bend of so thin a bar turns more than a fifth of it inside out: the least of them still is a
// beginning. What it leads to is one of several poses of a symmetric body, and said to be.
TEST(AlignPose, AFarBendInAnUnknownFrameIsAnsweredAndSaidToBeAmbiguous) {
  for (const double degrees : {200.0, 250.0})
    for (const std::uint32_t seed : {1U, 2U}) {
      const auto pose = test::bend(kLength, degrees * std::numbers::pi / 180);
      const TetMesh rest = bar({12, 4, 3}, 0.2, seed), posed = bar({11, 3, 3}, 0.2, seed + 7);
      const Result result = align(rest, test::posed(posed, pose), pose, {true, {}, false});
      EXPECT_TRUE(result.alignment.positions.allFinite());
      EXPECT_TRUE(result.alignment.ambiguous) << degrees << " " << seed;
    }
}

TEST(AlignPose, UnknownFrameOfABodyWithoutSymmetryIsFound) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(1.9, Eigen::Vector3d(-1, 2, 1).normalized()).toRotationMatrix();
  const test::Pose pose = [&](const Eigen::Vector3d& x) {
    return Eigen::Vector3d(R * test::twist(3, 0.6)(x - Eigen::Vector3d(1, 0.5, 0.2)));
  };
  const Result result =
      align(corner_piece({12, 8, 2}, true), test::posed(corner_piece({16, 8, 3}, true), pose), pose, {true, {}, false});
  EXPECT_FALSE(result.alignment.ambiguous);
  EXPECT_LE(result.error, 0.05);
}

// A motion and a scale of the example's file change its rounding alone; 1e-6 is what a user may rely on.
TEST(AlignPose, MotionAndScaleOfTheFileDoNotMatter) {
  const std::array<int, 3> ours{12, 4, 3}, theirs{11, 3, 3};
  const TetMesh rest = bar(ours, 0.6, 1);
  const TetMesh posed = test::posed(bar(theirs, 0.6, 2), test::bend(kLength, 1.3));
  const AlignedShape a = aligned_shape(rest, 0, "rest");
  const AlignmentHints hints{true, corners(ours, theirs), true};
  const auto in_rest_frame = [&](const TetMesh& mesh) {
    const VertexArray x = align_pose(a, {}, aligned_shape(mesh, 0, "posed"), hints).positions;
    const Eigen::Matrix3d R = procrustes_rotation(a.mesh.vertices.transpose() * (a.basis.mass * x));
    return VertexArray((x.rowwise() - (a.basis.mass * x).colwise().sum()) * R.transpose());
  };
  const VertexArray expected = in_rest_frame(posed);
  const double size = (expected - a.mesh.vertices).norm();
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.2, Eigen::Vector3d(2, -1, 3).normalized()).toRotationMatrix();
  for (const double scale : {1e-3, 1.0, 1e3}) {
    TetMesh moved = posed;
    moved.vertices = scale * posed.vertices * R.transpose();
    moved.vertices.rowwise() += scale * Eigen::RowVector3d(3, -2, 1);
    EXPECT_LE((in_rest_frame(moved) - expected).norm(), 1e-6 * size) << scale;
  }
}

const test::Pose kMirror = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(x[0], x[1], -x[2]); };

TetMesh mirrored(TetMesh mesh) {
  mesh = test::posed(mesh, kMirror);
  mesh.tets.col(0).swap(mesh.tets.col(1));
  return mesh;
}

// A body that is no mirror image of itself: nothing but its mirror image fits, and that is told.
TEST(AlignPose, AMirrorImageIsTold) {
  const TetMesh rest = corner_piece({12, 8, 2}, true), other = corner_piece({16, 8, 3}, true);
  for (const bool free_frame : {false, true}) {
    const Result same = align(rest, other, [](const Eigen::Vector3d& x) { return x; }, {free_frame, {}, false});
    EXPECT_FALSE(same.alignment.mirrored) << free_frame;
    const Result reflected = align(rest, mirrored(other), kMirror, {free_frame, {}, false});
    EXPECT_TRUE(reflected.alignment.mirrored) << free_frame;
    EXPECT_LE(reflected.alignment.mirror_residual, 0.03);
  }
}

// A body that is its own mirror image fits by that no better, whatever the pose: another body, or one whose rotation is
// not found.
TEST(AlignPose, OfABodyWithMirrorSymmetryNoMirrorImageIsTold) {
  const TetMesh rest = corner_piece({12, 8, 2}, false);
  const TetMesh ball = test::centred(test::shaken_box({6, 6, 6}, {1, 1, 1}, 3)),
                other = corner_piece({16, 8, 3}, false);
  const auto pose = test::bend(3, 2.5);
  for (const bool free_frame : {false, true})
    for (const TetMesh& posed : {ball, test::posed(other, pose), mirrored(test::posed(other, pose))})
      EXPECT_FALSE(align(rest, posed, pose, {free_frame, {}, false}).alignment.mirrored) << free_frame;
}

// Crushed into the bar, or drawn over it.
TEST(AlignPose, APartThatIsMissingIsTold) {
  const TetMesh whole = test::armed_bar({20, 5, 4}), other = test::armed_bar({10, 10, 4});
  const auto no_arm = [](const TetMesh& mesh) {
    return test::without(mesh, [](const Eigen::RowVector3d& x) { return x[1] > 0.8; });
  };
  const auto pose = test::bend(kLength, 1.0);
  const auto told = [&](const TetMesh& rest, const TetMesh& posed) {
    const AlignedShape a = aligned_shape(rest, 0, "rest");
    const double size = std::cbrt(tet_volumes(posed).sum() / tet_volumes(rest).sum());
    const auto found = align_pose(a, rest_symmetry(a), aligned_shape(test::posed(posed, pose), 0, "posed", {size}), {});
    // Over the limits of a warning. An arm that a bar lacks is drawn out of its side, which doubt tells.
    return std::max({found.squeezed_fraction / 0.025, found.uncovered / 0.05, found.doubt / 0.5});
  };
  EXPECT_LE(told(whole, other), 0.5);
  EXPECT_GT(told(whole, no_arm(other)), 1);
  EXPECT_GT(told(no_arm(whole), other), 1);
}

// The mirror image of a bend is a bend the other way of a bar that is its own mirror image.
TEST(AlignPose, AMirrorImageOfABodyWithMirrorSymmetryIsAnotherPose) {
  const auto pose = test::bend(kLength, 1.2), other_way = test::bend(kLength, -1.2);
  const Result result = align(bar({12, 4, 3}, 0.6, 1), mirrored(test::posed(bar({11, 3, 3}, 0.6, 2), pose)), other_way);
  EXPECT_FALSE(result.alignment.mirrored);
  EXPECT_LE(result.error, 0.05);
}

TEST(AlignPose, AnotherBodyIsRefused) {
  const TetMesh cube = test::centred(test::shaken_box({6, 6, 6}, {1, 1, 1}, 3));
  EXPECT_GT(align(bar({12, 4, 3}, 0.6, 1), cube, kMirror).alignment.doubt, 1.2);
}

// Landmarks moved along the body's surface by a share of its RMS radius, each in a direction of its own.
TEST(AlignPose, InexactLandmarksCostLittleAndWrongOnesAreTold) {
  const std::array<int, 3> ours{12, 4, 3}, theirs{11, 3, 3};
  const TetMesh rest = bar(ours, 0.6, 1), at_rest = bar(theirs, 0.6, 2);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const auto bend = test::bend(kLength, 1.57);
  const test::Pose pose = [&](const Eigen::Vector3d& x) { return Eigen::Vector3d(R * bend(x)); };
  const TetMesh posed = test::posed(at_rest, pose);
  const double size = rms_radius(aligned_shape(at_rest, 0, "posed").basis) * std::cbrt(kLength * 0.6);
  const auto with_landmarks = [&](double offset) {
    AlignmentHints hints{true, corners(ours, theirs), true};
    VertexArray places = at_rest.vertices(test::box_corners(theirs), Eigen::all);
    std::mt19937 generator(5);
    for (auto place : places.rowwise())
      for (double& x : place) x += offset * size * (generator() % 2 == 0 ? 1 : -1) / std::sqrt(3.0);
    hints.correspondences.on_pose = nearest_points(at_rest, places).interpolation(at_rest);
    return align(rest, posed, pose, hints);
  };
  const Result exact = with_landmarks(0), nearly = with_landmarks(0.01), far = with_landmarks(0.2);
  EXPECT_LE(exact.alignment.missed_landmarks, 0.01);
  EXPECT_LE(exact.alignment.doubt, 0.35);
  EXPECT_LE(nearly.error, 1.1 * exact.error);
  EXPECT_LE(nearly.alignment.doubt, exact.alignment.doubt + 0.02);  // twice the 1 % that they are off
  // The surface puts right what the landmarks miss, so the doubt is what tells: 2 x 0.2, less what is projected
  // back onto the body.
  EXPECT_LE(far.error, 0.01);
  EXPECT_NEAR(far.alignment.missed_landmarks, 0.15, 0.03);
  EXPECT_GT(far.alignment.doubt, nearly.alignment.doubt + 0.2);
}

TEST(AlignPose, LandmarksThatAreInterchangedAreTold) {
  const std::array<int, 3> ours{12, 4, 3}, theirs{11, 3, 3};
  const auto pose = test::bend(kLength, 1.57);
  std::vector<std::int32_t> ids = test::box_corners(theirs);
  std::swap(ids[0], ids[1]);  // at opposite ends
  const Correspondences wrong{at_vertices(test::box_corners(ours), ours), at_vertices(ids, theirs)};
  const Result result = align(bar(ours, 0.6, 1), test::posed(bar(theirs, 0.6, 2), pose), pose, {true, wrong, true});
  // Found, named and left out; the six others and the surface say where the body is.
  std::vector<std::size_t> left_out;
  for (const LeftOutLandmark& landmark : result.alignment.left_out) {
    left_out.push_back(landmark.index);
    EXPECT_GT(landmark.missed, 1);
  }
  EXPECT_THAT(left_out, testing::UnorderedElementsAre(0, 1));
  EXPECT_LE(result.error, 0.03);
}

// Three of eight are more than may be left out: doubt refuses.
TEST(AlignPose, MoreLandmarksThanMayBeLeftOutAreDoubted) {
  const std::array<int, 3> ours{12, 4, 3}, theirs{11, 3, 3};
  const auto pose = test::bend(kLength, 1.57);
  std::vector<std::int32_t> ids = test::box_corners(theirs);
  std::rotate(ids.begin(), ids.begin() + 1, ids.begin() + 4);  // each at the opposite end, or across
  const Correspondences wrong{at_vertices(test::box_corners(ours), ours), at_vertices(ids, theirs)};
  const Result result = align(bar(ours, 0.6, 1), test::posed(bar(theirs, 0.6, 2), pose), pose, {true, wrong, true});
  EXPECT_GT(result.alignment.doubt, 1.2);
}

// Held at one end a bend turns the body as a whole. In its own frame what is found is that of the free frame.
TEST(AlignPose, APoseHeldAtOneEndIsFoundInASharedFrame) {
  for (const double angle : {0.8, 1.05, 1.57}) {
    const auto pose = [&](const Eigen::Vector3d& x) {
      const double radius = kLength / angle, turn = (x[0] + kLength / 2) / radius;
      return Eigen::Vector3d((radius - x[2]) * std::sin(turn), x[1], radius - (radius - x[2]) * std::cos(turn));
    };
    const Result result = align(bar({12, 4, 3}, 0.6, 1), test::posed(bar({11, 3, 3}, 0.6, 2), pose), pose);
    EXPECT_LE(result.error, 0.05) << angle;
    EXPECT_FALSE(result.alignment.ambiguous) << angle;
  }
}

TEST(RestSymmetry, OfBodiesWithKnownSymmetries) {
  const auto of = [](const TetMesh& mesh) { return rest_symmetry(aligned_shape(mesh, 0, "body")); };
  EXPECT_EQ(of(bar({12, 4, 3}, 0.6, 1)).rotations.size(), 3U);
  EXPECT_EQ(of(bar({12, 4, 4}, 1, 1)).rotations.size(), 7U);
  EXPECT_EQ(of(corner_piece({12, 8, 2}, false)).rotations.size(), 0U);
  const Symmetry cylinder = of(test::cylinder_mesh(10, 6, 4, 0.5, 1));
  EXPECT_TRUE(cylinder.of_revolution);
  EXPECT_GE(cylinder.rotations.size(), 15U);
  EXPECT_FALSE(of(bar({12, 4, 4}, 1, 1)).of_revolution);
  EXPECT_TRUE(of(bar({12, 4, 3}, 0.6, 1)).mirrored);
  EXPECT_TRUE(of(corner_piece({12, 8, 2}, false)).mirrored);
  EXPECT_TRUE(cylinder.mirrored);
  EXPECT_FALSE(of(corner_piece({12, 8, 2}, true)).mirrored);
}

}  // namespace
}  // namespace exmat::precompute

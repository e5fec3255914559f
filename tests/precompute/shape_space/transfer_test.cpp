#include "precompute/shape_space/transfer.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>

#include "common/mesh/geometry.h"
#include "precompute/shape_space/projection.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

constexpr double kLength = 2.0;
constexpr Eigen::Index kM = 20;

// Rotation about the x axis that grows along it.
VertexArray twist(const VertexArray& rest, double angle) {
  VertexArray posed = rest;
  const Eigen::RowVector3d middle = 0.5 * (rest.colwise().maxCoeff() + rest.colwise().minCoeff());
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    const Eigen::AngleAxisd rotation(angle * rest(v, 0) / kLength, Eigen::Vector3d::UnitX());
    posed.row(v) = middle + (rotation * (rest.row(v) - middle).transpose()).transpose();
  }
  return posed;
}

struct Setting {
  TetMesh object_mesh = test::box_mesh({12, 5, 3}, {kLength, 0.6, 0.4});
  TetMesh example_mesh = test::box_mesh({9, 4, 4}, {kLength, 0.6, 0.4});
  LaplaceBasis object = laplace_basis(object_mesh, kM, "object");
  LaplaceBasis example =
      laplace_basis(example_mesh, example_function_count(kM, example_mesh.vertex_count()), "example");
  Eigen::MatrixXd rest = coefficients(object, object.vertices);
  RestMap map = rest_map(object, example_mesh, example);

  PoseFrame frame(bool free) const { return {free, scalar_mass(object_mesh)}; }
  TransferredPose transfer(const TetMesh& posed, bool free) const {
    return transfer_pose(object, rest, map, example, normalised_positions(posed), frame(free));
  }
};

const Setting& setting() {
  static const Setting value;
  return value;
}

double mass_norm(const SparseMatrix& mass, const VertexArray& field) {
  return std::sqrt((field.transpose() * (mass * field)).trace());
}

TEST(RestMap, OfTheSameBodyOnAnotherMeshIsCertain) {
  const auto& s = setting();
  EXPECT_LE(s.map.residual, 1e-12);
  EXPECT_TRUE(s.map.same_frame);
  EXPECT_LE(s.map.doubt, 0.1);
  const Eigen::MatrixXd gram = s.map.functional_map * s.map.functional_map.transpose();
  EXPECT_LE((gram - Eigen::MatrixXd::Identity(kM, kM)).norm(), 1e-12);
}

// A rest example that does not lie where the object does, or is another body, is told by its doubt.
TEST(RestMap, OfABodyThatLiesElsewhereIsDoubtful) {
  const auto& s = setting();
  TetMesh turned = s.example_mesh;
  turned.vertices.col(0).swap(turned.vertices.col(1));
  turned.tets.col(0).swap(turned.tets.col(1));
  const auto basis = laplace_basis(turned, s.example.eigenvalues.size(), "turned");
  const auto map = rest_map(s.object, turned, basis);
  EXPECT_GT(map.doubt, 1.0);
  EXPECT_FALSE(map.same_frame);
}

// The true pose of the object is known: the same analytic twist of its own vertices. The error is compared with that of
// the best approximation in the object's functions.
TEST(TransferPose, IsCloseToTheIdealProjection) {
  const auto& s = setting();
  const TetMesh posed{twist(s.example_mesh.vertices, 0.8), s.example_mesh.tets};
  const auto pose = s.transfer(posed, false);
  // The body is free, so its pose is in its mean axes.
  const VertexArray twisted = normalised_positions({twist(s.object_mesh.vertices, 0.8), s.object_mesh.tets});
  const Eigen::Matrix3d axes = procrustes_rotation(s.object.vertices.transpose() * (s.object.mass * twisted));
  const VertexArray exact = twisted * axes.transpose() - s.object.vertices;
  const VertexArray ideal = s.object.eigenfunctions * coefficients(s.object, exact);
  const VertexArray ours = s.object.eigenfunctions * (pose.coefficients - s.rest);
  const double full = mass_norm(s.object.mass, exact);
  const double ideal_error = mass_norm(s.object.mass, ideal - exact) / full,
               our_error = mass_norm(s.object.mass, ours - exact) / full;
  EXPECT_LE(ideal_error, 0.2);
  EXPECT_LE(our_error, ideal_error + 0.02);  // the two meshes are coarse and their functions differ by as much
  EXPECT_NEAR(pose.shape_space_error, our_error, 0.03);
}

TEST(TransferPose, DoesNotDependOnScaleAndPlaceOfTheExample) {
  const auto& s = setting();
  const TetMesh posed{twist(s.example_mesh.vertices, 0.8), s.example_mesh.tets};
  const auto expected = s.transfer(posed, true);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  for (const double scale : {1e-3, 1.0, 1e3}) {
    TetMesh moved = posed;
    moved.vertices = scale * posed.vertices * R.transpose();
    moved.vertices.rowwise() += scale * Eigen::RowVector3d(3, -1, 2);
    const auto pose = s.transfer(moved, true);
    EXPECT_LE((pose.coefficients - expected.coefficients).norm(), 1e-10 * expected.coefficients.norm()) << scale;
    EXPECT_LE((pose.rotation * R - expected.rotation).norm(), 1e-9) << scale;
  }
}

TEST(TransferPose, TheRestPoseStaysAtRest) {
  const auto& s = setting();
  for (const bool free : {false, true}) {
    const auto pose = s.transfer(s.example_mesh, free);
    EXPECT_LE((pose.coefficients - s.rest).norm(), 1e-12 * s.rest.norm());
    EXPECT_EQ(pose.shape_space_error, 0.0);
  }
}

// A free body's pose is in the mean-axis frame, sum m X x u = 0, but for what the functions do not carry: with P the
// projection onto them, the moment of the low-pass pose is at most |X - P X|^2 |R - I|.
// A turn as a whole is found to rounding, though six functions lose much of the rest pose: its numbers are their own.
TEST(TransferPose, ATurnedRestPoseStaysAtRestWhateverTheFunctions) {
  const auto& s = setting();
  const LaplaceBasis few = first_functions(s.object, 6);
  const Eigen::MatrixXd rest = coefficients(few, few.vertices);
  const RestMap map = rest_map(few, s.example_mesh, s.example);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  for (const bool free : {false, true}) {
    const TransferredPose pose =
        transfer_pose(few, rest, map, s.example, s.example.vertices * R.transpose(), s.frame(free));
    EXPECT_LE(pose.displacement.norm(), 1e-9 * few.vertices.norm()) << free;
    EXPECT_LE((pose.coefficients - rest).norm(), 1e-9) << free;
    EXPECT_LE((pose.rotation * R - RowMatrix3::Identity()).norm(), 1e-9) << free;
  }
}

TEST(TransferPose, FreePosesAreInTheMeanAxisFrame) {
  const auto& s = setting();
  TetMesh posed{twist(s.example_mesh.vertices, 0.8), s.example_mesh.tets};
  posed.vertices = posed.vertices * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const auto pose = s.transfer(posed, false);
  const VertexArray& X = s.object.vertices;
  const VertexArray lost = X - s.object.eigenfunctions * s.rest;
  const VertexArray low_pass = s.object.eigenfunctions * (pose.coefficients - s.rest);
  const Eigen::Matrix3d moments = X.transpose() * (s.object.mass * low_pass);
  const double bound = std::pow(mass_norm(s.object.mass, lost), 2) * (pose.rotation - RowMatrix3::Identity()).norm();
  EXPECT_LE((moments - moments.transpose()).norm(), 2 * bound + 1e-12);
  EXPECT_LE(bound, 0.02 * mass_norm(s.object.mass, X) * mass_norm(s.object.mass, low_pass));
}

TEST(ProcrustesRotation, RecoversRotationsAndNeverReflects) {
  const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Random(3, 30);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(2.5, Eigen::Vector3d(0.2, 0.9, -0.4).normalized()).toRotationMatrix();
  const Eigen::Matrix3Xd rotated = R * points;
  EXPECT_LE((procrustes_rotation(rotated * points.transpose()) - R).norm(), 1e-12);
  const Eigen::Matrix3Xd mirrored = Eigen::Vector3d(1, 1, -1).asDiagonal() * points;
  EXPECT_NEAR(procrustes_rotation(mirrored * points.transpose()).determinant(), 1.0, 1e-12);
}

TEST(ProcrustesRotation, OfALineIsTheSmallestOne) {
  const Eigen::Vector3d a(1, 0, 0), b = Eigen::Vector3d(1, 1, 0).normalized();
  const Eigen::Matrix3d R = procrustes_rotation(b * a.transpose());
  EXPECT_LE((R * a - b).norm(), 1e-12);
  EXPECT_NEAR(Eigen::AngleAxisd(R).angle(), std::atan(1.0), 1e-9);
}

// T and T^+ against their definition: through the displacement of every vertex.
TEST(DirectProjection, AgreesWithTheWayThroughFullSpace) {
  const auto& s = setting();
  const Eigen::Index n = s.object_mesh.vertex_count(), r = 12;
  Eigen::VectorXd density = Eigen::VectorXd::LinSpaced(s.object_mesh.tet_count(), 500, 1500);
  const SparseMatrix mass = expand_to_vectors(scalar_mass(s.object_mesh, density));
  const RowMatrix U = RowMatrix::Random(3 * n, r);
  for (const Weighting weighting : {Weighting::kEigenvalue, Weighting::kNone}) {
    const auto weights = descriptor_weights(s.object, weighting);
    const auto projection = direct_projection(s.object, weights, mass, U);
    const Eigen::VectorXd q = Eigen::VectorXd::Random(r);
    const VertexArray displacement = VertexArray((U * q).reshaped<Eigen::RowMajor>(n, 3)) / std::cbrt(s.object.volume);
    const RowMatrix change = weights.asDiagonal() * coefficients(s.object, displacement);
    const Eigen::VectorXd flat = change.reshaped<Eigen::RowMajor>();
    EXPECT_LE((projection.shape_from_reduced * q - flat).norm(), 1e-12 * flat.norm());
    const Eigen::VectorXd back = U.transpose() * (mass * reconstruct_displacement(s.object, weights, change));
    EXPECT_LE((projection.reduced_from_shape * flat - back).norm(), 1e-12 * back.norm());
    const RowMatrix Z = range_basis(projection.reduced_from_shape);
    EXPECT_LE((Z.transpose() * Z - Eigen::MatrixXd::Identity(Z.cols(), Z.cols())).norm(), 1e-12);
    EXPECT_LE((projection.reduced_from_shape - Z * (Z.transpose() * projection.reduced_from_shape)).norm(),
              1e-7 * projection.reduced_from_shape.norm());
  }
}

TEST(DirectProjection, IsItsOwnTransposeAtUniformDensity) {
  const auto& s = setting();
  const double density = 1234;
  const Eigen::VectorXd densities = Eigen::VectorXd::Constant(s.object_mesh.tet_count(), density);
  const SparseMatrix mass = expand_to_vectors(scalar_mass(s.object_mesh, densities));
  const RowMatrix U = RowMatrix::Random(3 * s.object_mesh.vertex_count(), 10);
  const auto projection = direct_projection(s.object, s.object.eigenvalues, mass, U);
  Eigen::VectorXd inverse_squares(3 * kM);
  for (Eigen::Index i = 0; i < 3 * kM; ++i) inverse_squares[i] = std::pow(s.object.eigenvalues[i / 3], -2);
  const Eigen::MatrixXd expected = density * std::pow(s.object.volume, 5.0 / 3) *
                                   projection.shape_from_reduced.transpose() * inverse_squares.asDiagonal();
  EXPECT_LE((projection.reduced_from_shape - expected).norm(), 1e-12 * expected.norm());
}

}  // namespace
}  // namespace exmat::precompute

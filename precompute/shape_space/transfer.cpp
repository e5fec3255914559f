#include "precompute/shape_space/transfer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/core/decompositions.h"
#include "common/mesh/nearest_point.h"

namespace exmat::precompute {
namespace {

// A second singular value below this, relative to the first, leaves the angle about an axis open.
constexpr double kRankOne = 1e-8;
// Fits of a pose to the rest pose, and the turn that ends them [rad].
constexpr int kMostFits = 30;
constexpr double kNoTurn = 1e-12;
// Displacements below this, relative to the body's size, are rounding.
constexpr double kNoDisplacement = 1e-12;

// Fit of the posed to the rest object in the product of the weights, both about their weighted means.
Eigen::Matrix3d fit_rotation(const VertexArray& posed, const VertexArray& rest, const SparseMatrix& weights) {
  const Eigen::RowVectorXd sums = Eigen::RowVectorXd::Ones(weights.rows()) * weights;
  const Eigen::RowVector3d posed_mean = sums * posed / sums.sum(), rest_mean = sums * rest / sums.sum();
  const VertexArray centred = posed.rowwise() - posed_mean;
  return procrustes_rotation((rest.rowwise() - rest_mean).transpose() * (weights * centred));
}

// Without its mean in the mass, of sum 1.
VertexArray centred(const VertexArray& field, const SparseMatrix& mass) {
  return field.rowwise() - (mass * field).colwise().sum();
}

// The change of coefficients [m x 3] of a pose that `to_rest` has turned, fitted to the object as the frame says;
// `displacement` [n x 3] is what is fitted.
TransferredPose place_pose(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients,
                           const Eigen::MatrixXd& change, const VertexArray& displacement,
                           const Eigen::Matrix3d& to_rest, const PoseFrame& frame) {
  TransferredPose pose;
  pose.coefficients = rest_coefficients + change;
  pose.rotation = to_rest;
  Eigen::Matrix3d fit = fit_rotation(object.vertices + displacement, object.vertices, frame.fit_weights);
  for (int round = 0; round < kMostFits; ++round) {
    pose.coefficients = (pose.coefficients * fit.transpose()).eval();
    pose.rotation = fit * pose.rotation;
    // The rest pose's part that the functions lose is not turned with the rest of it, so a little of a turn is left.
    if (frame.fit_whole || Eigen::AngleAxisd(fit).angle() < kNoTurn) break;
    const VertexArray left = object.eigenfunctions * (pose.coefficients - rest_coefficients);
    fit = fit_rotation(object.vertices + left, object.vertices, frame.fit_weights);
  }
  return pose;
}

}  // namespace

double lost_share(const SparseMatrix& mass, const VertexArray& displacement, const VertexArray& carried) {
  const auto norm = [&mass](const VertexArray& field) {
    return std::sqrt((field.transpose() * (mass * field)).trace());
  };
  const double full = norm(displacement);
  return full <= kNoDisplacement ? 0 : norm(displacement - carried) / full;
}

Eigen::Matrix3d procrustes_rotation(const Eigen::Matrix3d& moments) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const auto& sigma = svd.singularValues();
  if (sigma[1] <= kRankOne * sigma[0])
    return Eigen::Quaterniond::FromTwoVectors(svd.matrixV().col(0), svd.matrixU().col(0)).toRotationMatrix();
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs[2] = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Eigen::Index example_function_count(Eigen::Index m, Eigen::Index vertices) {
  return std::min(m + m / 2 + 5, vertices - 2);
}

Eigen::MatrixXd RestMap::carried(const LaplaceBasis& object, const LaplaceBasis& rest_basis,
                                 const VertexArray& field) const {
  if (by_functions) return functional_map * coefficients(rest_basis, field);
  return coefficients(object, pull_back * field);
}

RestMap identity_map(Eigen::Index m, Eigen::Index vertices) {
  SparseMatrix identity(vertices, vertices);
  identity.setIdentity();
  return {Eigen::MatrixXd::Identity(m, m), identity, 0, 0, true};
}

RestMap rest_map(const LaplaceBasis& object, const TetMesh& rest_mesh, const LaplaceBasis& rest_basis) {
  const TetMesh normalised{rest_basis.vertices, rest_mesh.tets};
  const auto nearest = nearest_points(normalised, object.vertices);
  RestMap result;
  result.pull_back = nearest.interpolation(normalised);
  const Eigen::MatrixXd map =
      object.eigenfunctions.transpose() * (object.mass * (result.pull_back * rest_basis.eigenfunctions));
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(map, Eigen::ComputeThinU | Eigen::ComputeThinV);
  result.functional_map = svd.matrixU() * svd.matrixV().transpose();
  result.residual = nearest.distances.norm() / object.vertices.rowwise().norm().norm();
  result.doubt =
      result.residual + (svd.singularValues().array() - 1).matrix().norm() / std::sqrt(static_cast<double>(map.rows()));

  result.same_frame = result.residual <= kSameFrame;
  return result;
}

TransferredPose transfer_pose(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients, const RestMap& map,
                              const LaplaceBasis& rest_basis, const VertexArray& posed, const PoseFrame& frame) {
  Eigen::Matrix3d to_rest = Eigen::Matrix3d::Identity();
  if (frame.free_example)
    to_rest = procrustes_rotation(coefficients(rest_basis, rest_basis.vertices).transpose() *
                                  coefficients(rest_basis, posed));
  const auto carry = [&](const VertexArray& field) { return map.carried(object, rest_basis, field); };
  const VertexArray whole = posed * to_rest.transpose() - rest_basis.vertices;
  const Eigen::MatrixXd change = carry(whole);
  TransferredPose pose =
      place_pose(object, rest_coefficients, change,
                 frame.fit_whole ? VertexArray(map.pull_back * whole) : VertexArray(object.eigenfunctions * change),
                 to_rest, frame);
  const VertexArray displacement = posed * pose.rotation.transpose() - rest_basis.vertices;
  pose.displacement = centred(map.pull_back * displacement, object.mass);
  pose.shape_space_error = lost_share(object.mass, pose.displacement, object.eigenfunctions * carry(displacement));
  return pose;
}

TransferredPose posed_object(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients,
                             const VertexArray& displacement) {
  TransferredPose pose;
  const Eigen::MatrixXd change = coefficients(object, displacement);
  pose.coefficients = rest_coefficients + change;
  pose.displacement = centred(displacement, object.mass);
  pose.shape_space_error = lost_share(object.mass, pose.displacement, object.eigenfunctions * change);
  return pose;
}

TransferredPose transfer_carried(const LaplaceBasis& object, const Eigen::MatrixXd& rest_coefficients,
                                 const CarriedShape& rest, const CarriedShape& posed, const PoseFrame& frame) {
  Eigen::Matrix3d to_rest = Eigen::Matrix3d::Identity();
  if (frame.free_example) to_rest = procrustes_rotation(rest.coefficients.transpose() * posed.coefficients);
  const Eigen::MatrixXd change = posed.coefficients * to_rest.transpose() - rest.coefficients;
  const VertexArray whole = posed.points * to_rest.transpose() - rest.points;
  TransferredPose pose =
      place_pose(object, rest_coefficients, change,
                 frame.fit_whole ? whole : VertexArray(object.eigenfunctions * change), to_rest, frame);
  pose.displacement = centred(posed.points * pose.rotation.transpose() - rest.points, object.mass);
  pose.shape_space_error =
      lost_share(object.mass, pose.displacement, object.eigenfunctions * (pose.coefficients - rest_coefficients));
  return pose;
}

}  // namespace exmat::precompute

#include "precompute/fem/elastic_system.h"

#include <Eigen/Geometry>
#include <utility>

#include "common/core/decompositions.h"
#include "common/core/error.h"

namespace exmat::precompute {
namespace {

// Fixed vertices are on one line where they are as wide as this, relative to their length.
constexpr double kClampRank = 1e-6;

// [3n x 6] translations and rotations about `centre`.
Eigen::MatrixXd raw_rigid_motions(const VertexArray& nodes, const Eigen::Vector3d& centre) {
  Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(3 * nodes.rows(), 6);
  for (Eigen::Index v = 0; v < nodes.rows(); ++v) {
    const Eigen::Vector3d x = nodes.row(v).transpose() - centre;
    for (int axis = 0; axis < 3; ++axis) {
      motions(3 * v + axis, axis) = 1;
      motions.block<3, 1>(3 * v, 3 + axis) = Eigen::Vector3d::Unit(axis).cross(x);
    }
  }
  return motions;
}

void require_clamped(const VertexArray& nodes, const FlagVector& fixed) {
  if (are_clamp(nodes, fixed)) return;
  throw InputError({"", "/object/fixed", "at least three fixed vertices that are not on one line",
                    std::to_string(fixed.cast<int>().sum()) + " that leave the body free to move rigidly",
                    "fix more of them"});
}

}  // namespace

// Whatever the rest of the body is like: a clamp may be small beside it.
bool are_clamp(const VertexArray& nodes, const FlagVector& fixed) {
  Eigen::MatrixX3d points(fixed.cast<Eigen::Index>().sum(), 3);
  for (Eigen::Index v = 0, row = 0; v < nodes.rows(); ++v)
    if (fixed[v] != 0) points.row(row++) = nodes.row(v);
  if (points.rows() < 3) return false;
  points.rowwise() -= points.colwise().mean().eval();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(points.transpose() * points);
  const auto& squares = svd.singularValues();
  return squares[1] > kClampRank * kClampRank * squares[0];
}

Eigen::MatrixXd ElasticSystem::restrict(const Eigen::MatrixXd& fields) const { return fields(free_dofs, Eigen::all); }

Eigen::MatrixXd ElasticSystem::unit_weights() const {
  Eigen::MatrixXd axes = Eigen::MatrixXd::Zero(full_mass.rows(), 3);
  for (int axis = 0; axis < 3; ++axis) axes(Eigen::seqN(axis, axes.rows() / 3, 3), axis).setOnes();
  return full_mass * axes;
}

Eigen::MatrixXd ElasticSystem::extend(const Eigen::MatrixXd& free_rows) const {
  Eigen::MatrixXd fields = Eigen::MatrixXd::Zero(full_mass.rows(), free_rows.cols());
  fields(free_dofs, Eigen::all) = free_rows;
  return fields;
}

MassProperties mass_properties(const VertexArray& nodes, const SparseMatrix& mass) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mass.rows());
  const Eigen::VectorXd row_sums = mass * ones;
  MassProperties properties;
  for (Eigen::Index v = 0; v < nodes.rows(); ++v) {
    properties.mass += row_sums[3 * v];
    properties.centre += row_sums[3 * v] * nodes.row(v).transpose();
  }
  properties.centre /= properties.mass;
  return properties;
}

Eigen::MatrixXd rigid_motions(const VertexArray& nodes, const SparseMatrix& mass) {
  Eigen::MatrixXd motions = raw_rigid_motions(nodes, mass_properties(nodes, mass).centre);
  for (int pass = 0; pass < 2; ++pass) {
    const Eigen::MatrixXd gram = motions.transpose() * (mass * motions);
    gram.llt().matrixU().solveInPlace<Eigen::OnTheRight>(motions);
  }
  return motions;
}

ElasticSystem build_elastic_system(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed) {
  return eliminate_fixed(mesh.vertices, expand_to_vectors(scalar_mass(mesh, materials.density)),
                         elastic_stiffness(mesh, materials), fixed);
}

ElasticSystem eliminate_fixed(const VertexArray& nodes, SparseMatrix mass, SparseMatrix stiffness,
                              const FlagVector& fixed) {
  ElasticSystem system;
  system.full_mass = std::move(mass);
  system.full_stiffness = std::move(stiffness);
  for (Eigen::Index v = 0; v < nodes.rows(); ++v)
    for (int axis = 0; fixed[v] == 0 && axis < 3; ++axis)
      system.free_dofs.push_back(static_cast<std::int32_t>(3 * v + axis));
  const auto size = static_cast<Eigen::Index>(system.free_dofs.size());
  if (size == system.full_mass.rows()) {
    system.mass = system.full_mass;
    system.stiffness = system.full_stiffness;
    system.null_space = system.rigid = rigid_motions(nodes, system.full_mass);
    return system;
  }
  if (size == 0)
    throw InputError({"", "/object/fixed", "a vertex that is free to move", "all of them fixed", "fix fewer"});
  require_clamped(nodes, fixed);
  system.mass = submatrix(system.full_mass, system.free_dofs);
  system.stiffness = submatrix(system.full_stiffness, system.free_dofs);
  system.null_space.resize(size, 0);
  system.rigid = system.restrict(rigid_motions(nodes, system.full_mass));
  return system;
}

}  // namespace exmat::precompute

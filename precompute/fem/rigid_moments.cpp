#include "precompute/fem/rigid_moments.h"

#include <array>

namespace exmat::precompute {

RigidData rigid_moments(const TetMesh& mesh, const Eigen::VectorXd& density, const RowMatrix& basis) {
  const SparseMatrix mass = scalar_mass(mesh, density);
  const Eigen::VectorXd vertex_masses = mass * Eigen::VectorXd::Ones(mesh.vertex_count());
  const Eigen::Index n = mesh.vertex_count(), r = basis.cols();
  RigidData rigid;
  rigid.mass = vertex_masses.sum();
  rigid.centre_of_mass = mesh.vertices.transpose() * vertex_masses / rigid.mass;
  const VertexArray centred = mesh.vertices.rowwise() - rigid.centre_of_mass.transpose();
  const VertexArray mass_centred = mass * centred;
  rigid.second_moments = centred.transpose() * mass_centred;
  rigid.inertia = rigid.second_moments.trace() * RowMatrix3::Identity() - rigid.second_moments;

  std::array<Eigen::MatrixXd, 3> axis_basis, mass_axis_basis;  // n x r rows of one axis
  for (int axis = 0; axis < 3; ++axis) {
    axis_basis[axis] = basis(Eigen::seqN(axis, n, 3), Eigen::all);
    mass_axis_basis[axis] = mass * axis_basis[axis];
  }
  rigid.spin_load.resize(3, r);
  for (int c = 0; c < 3; ++c) {
    const int a = (c + 1) % 3, b = (c + 2) % 3;
    rigid.spin_load.row(c) =
        mass_centred.col(a).transpose() * axis_basis[b] - mass_centred.col(b).transpose() * axis_basis[a];
  }
  rigid.linear_moments.resize(9, r);
  rigid.basis_moments.resize(9 * r, r);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      rigid.linear_moments.row(3 * a + b) =
          mass_centred.col(b).transpose() * axis_basis[a] + mass_centred.col(a).transpose() * axis_basis[b];
      rigid.basis_moments.middleRows((3 * a + b) * r, r) = axis_basis[a].transpose() * mass_axis_basis[b];
    }
  return rigid;
}

}  // namespace exmat::precompute

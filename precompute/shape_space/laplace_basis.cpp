#include "precompute/shape_space/laplace_basis.h"

#include <cmath>

#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/solvers/eigenpairs.h"
#include "precompute/solvers/mesh_blame.h"

namespace exmat::precompute {

LaplaceBasis laplace_basis(const TetMesh& mesh, Eigen::Index count, const std::string& name) {
  if (count > mesh.vertex_count() - 2)
    throw WorkError(name + ": expected at least " + std::to_string(count + 2) + " vertices for " +
                    std::to_string(count) + " eigenfunctions, found " + std::to_string(mesh.vertex_count()));
  const SparseMatrix stiffness = laplacian_stiffness(mesh), mass = scalar_mass(mesh);
  LaplaceBasis basis;
  basis.volume = tet_volumes(mesh).sum();
  basis.centroid = centroid(mesh);
  basis.vertices = normalised_positions(mesh);
  const Eigen::MatrixXd constant = Eigen::MatrixXd::Constant(mesh.vertex_count(), 1, 1 / std::sqrt(basis.volume));
  const Eigenpairs pairs = with_mesh_blamed(mesh, name, [&] {
    const SemidefiniteSolver solver(stiffness, mass * constant, name + ": Laplacian", constant);
    return smallest_eigenpairs(stiffness, mass, solver, count);
  });
  basis.eigenvalues = pairs.values * std::pow(basis.volume, 2.0 / 3.0);
  basis.eigenfunctions = pairs.vectors * std::sqrt(basis.volume);
  basis.mass = mass / basis.volume;
  return basis;
}

LaplaceBasis laplace_basis_of(const ReducedModel& model) {
  const ShapeSpaceData& space = *model.shape_space;
  const TetMesh& mesh = model.object->mesh;
  return {space.eigenvalues,          space.eigenfunctions, scalar_mass(mesh) / space.volume,
          normalised_positions(mesh), space.volume,         space.centroid};
}

LaplaceBasis first_functions(LaplaceBasis basis, Eigen::Index count) {
  basis.eigenvalues.conservativeResize(count);
  basis.eigenfunctions.conservativeResize(Eigen::NoChange, count);
  return basis;
}

VertexArray normalised_positions(const TetMesh& mesh) {
  const double unit = std::cbrt(tet_volumes(mesh).sum());
  return (mesh.vertices.rowwise() - centroid(mesh).transpose()) / unit;
}

Eigen::MatrixXd coefficients(const LaplaceBasis& basis, const VertexArray& field) {
  return basis.eigenfunctions.transpose() * (basis.mass * field);
}

}  // namespace exmat::precompute

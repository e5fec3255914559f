#include "precompute/modes/linear_modes.h"

#include <utility>
#include <vector>

#include "common/core/progress.h"
#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

using ElementGradients = std::vector<Eigen::Matrix<double, 4, 3>>;

// Displacement gradient of one tet: sum of u_a (x) grad N_a.
Eigen::Matrix3d displacement_gradient(const TetMesh& mesh, Eigen::Index tet,
                                      const Eigen::Matrix<double, 4, 3>& gradients,
                                      const Eigen::Ref<const Eigen::VectorXd>& field) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  for (int corner = 0; corner < 4; ++corner) H += field.segment<3>(3 * mesh.tets(tet, corner)) * gradients.row(corner);
  return H;
}

// [3n] nodal forces of the second derivative of the internal force in directions a and b, at rest.
template <typename Material>
Eigen::VectorXd second_derivative(Material material, const TetMesh& mesh, const TetMaterials& materials,
                                  const ElementGradients& gradients, const Eigen::VectorXd& volumes,
                                  const Eigen::Ref<const Eigen::VectorXd>& a,
                                  const Eigen::Ref<const Eigen::VectorXd>& b) {
  Eigen::VectorXd force = Eigen::VectorXd::Zero(a.size());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto& shape = gradients[static_cast<std::size_t>(t)];
    const auto lame = lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]);
    const Eigen::Matrix3d stress =
        volumes[t] * material.rest_second_derivative(displacement_gradient(mesh, t, shape, a),
                                                     displacement_gradient(mesh, t, shape, b), lame);
    for (int corner = 0; corner < 4; ++corner)
      force.segment<3>(3 * mesh.tets(t, corner)) += stress * shape.row(corner).transpose();
  }
  return force;
}

}  // namespace

LinearModes linear_modes(const ElasticSystem& system, const SemidefiniteSolver& solver, int count) {
  auto pairs = smallest_eigenpairs(system.stiffness, system.mass, solver, count);
  return {std::move(pairs.values), std::move(pairs.vectors)};
}

Eigen::MatrixXd modal_derivatives(const TetMesh& mesh, const TetMaterials& materials, const ElasticSystem& system,
                                  const SemidefiniteSolver& solver, const Eigen::MatrixXd& modes) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  ElementGradients gradients(static_cast<std::size_t>(mesh.tet_count()));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    gradients[static_cast<std::size_t>(t)] = shape_gradients(tet_positions(mesh, t));
  const Eigen::MatrixXd fields = system.extend(modes);

  std::vector<std::pair<Eigen::Index, Eigen::Index>> pairs;
  for (Eigen::Index j = 0; j < modes.cols(); ++j)
    for (Eigen::Index i = 0; i <= j; ++i) pairs.emplace_back(i, j);
  Eigen::MatrixXd loads(modes.rows(), static_cast<Eigen::Index>(pairs.size()));
  Progress progress("modal derivatives", static_cast<std::int64_t>(pairs.size()));
#pragma omp parallel for schedule(dynamic)
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    loads.col(static_cast<Eigen::Index>(p)) = -system.restrict(with_material(materials.model, [&](auto material) {
      return second_derivative(material, mesh, materials, gradients, volumes, fields.col(pairs[p].first),
                               fields.col(pairs[p].second));
    }));
#pragma omp critical(modal_derivatives_progress)
    progress.advance();
  }
  return solver.solve(loads);
}

}  // namespace exmat::precompute

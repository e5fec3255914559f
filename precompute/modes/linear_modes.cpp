#include "precompute/modes/linear_modes.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "common/core/progress.h"
#include "common/elastic/materials.h"
#include "common/mesh/elements.h"

namespace exmat::precompute {
namespace {

constexpr std::size_t kPairsTogether = 16;  // of modes, whose loads are summed in one pass over the elements

using Pair = std::pair<Eigen::Index, Eigen::Index>;

// [3n x k] nodal forces of the second derivatives of the internal force in pairs of directions at rest, of the fields
// [3n x modes].
template <typename Material>
RowMatrix second_derivatives(Material material, const Elements& elements, const RowMatrix& fields,
                             std::span<const Pair> pairs) {
  RowMatrix forces = RowMatrix::Zero(fields.rows(), std::ssize(pairs));
  std::vector<Eigen::Matrix3d> H(static_cast<std::size_t>(fields.cols()));
  for (Eigen::Index e = 0; e < elements.count(); ++e) {
    const auto vertices = elements.vertices_of(e);
    const auto shape = elements.gradients_of(e);
    const LameParameters lame = elements.lame(e);
    for (Eigen::Index mode = 0; mode < fields.cols(); ++mode)
      H[static_cast<std::size_t>(mode)] = elements.displacement_gradient(e, fields.col(mode));
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const Eigen::Matrix3d stress =
          elements.volumes[e] * material.rest_second_derivative(H[static_cast<std::size_t>(pairs[p].first)],
                                                                H[static_cast<std::size_t>(pairs[p].second)], lame);
      for (std::size_t j = 0; j < vertices.size(); ++j)
        forces.col(static_cast<Eigen::Index>(p)).segment<3>(3 * vertices[j]) +=
            stress * shape.row(static_cast<Eigen::Index>(j)).transpose();
    }
  }
  return forces;
}

}  // namespace

LinearModes linear_modes(const ElasticSystem& system, const SemidefiniteSolver& solver, int count) {
  auto pairs = smallest_eigenpairs(system.stiffness, system.mass, solver, count);
  return {std::move(pairs.values), std::move(pairs.vectors)};
}

Eigen::MatrixXd modal_derivatives(const TetMesh& mesh, const TetMaterials& materials, const ElasticSystem& system,
                                  const SemidefiniteSolver& solver, const Eigen::MatrixXd& modes) {
  const Elements elements = elements_of(mesh, materials);
  const RowMatrix fields = system.extend(modes);
  std::vector<Pair> pairs;
  for (Eigen::Index j = 0; j < modes.cols(); ++j)
    for (Eigen::Index i = 0; i <= j; ++i) pairs.emplace_back(i, j);
  Eigen::MatrixXd loads(modes.rows(), std::ssize(pairs));
  Progress progress("modal derivatives", std::ssize(pairs));
#pragma omp parallel for schedule(dynamic)
  for (std::size_t begin = 0; begin < pairs.size(); begin += kPairsTogether) {
    const std::span<const Pair> some = std::span(pairs).subspan(begin, std::min(kPairsTogether, pairs.size() - begin));
    const RowMatrix forces = with_material(
        materials.model, [&](auto material) { return second_derivatives(material, elements, fields, some); });
    loads.middleCols(static_cast<Eigen::Index>(begin), std::ssize(some)) = -forces(system.free_dofs, Eigen::all);
#pragma omp critical(modal_derivatives_progress)
    progress.advance(std::ssize(some));
  }
  return solver.solve(loads);
}

}  // namespace exmat::precompute

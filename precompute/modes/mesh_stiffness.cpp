#include "precompute/modes/mesh_stiffness.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <vector>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/elements.h"
#include "common/mesh/geometry.h"
#include "precompute/fem/quadratic_tets.h"
#include "precompute/solvers/eigenpairs.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kModes = 6;
constexpr int kFits = 4;               // of beta
constexpr double kFitted = 1e-3;       // how near to 1 the mean is then
constexpr double kLeastFactor = 0.05;  // without a variance term rings have soft modes that are none of the body
constexpr double kMostFactor = 1;

// The lowest modes, and the work of the weight along each axis of a clamped body, 1/2 f^T K^-1 f; nothing of a free
// one.
struct Response {
  Eigen::VectorXd eigenvalues;
  Eigen::MatrixXd modes;  // free rows
  Eigen::VectorXd sags;
};

Response response_of(const ElasticSystem& system, Eigen::Index count, const std::string& name) {
  const SemidefiniteSolver solver(system.stiffness, system.mass * system.null_space, name, system.rigid);
  Eigenpairs pairs = smallest_eigenpairs(system.stiffness, system.mass, solver, count);
  Response response{std::move(pairs.values), std::move(pairs.vectors), {}};
  if (!system.constrained()) return response;
  const Eigen::MatrixXd weight = system.restrict(system.unit_weights());
  response.sags = weight.cwiseProduct(solver.solve(weight)).colwise().sum().transpose();
  return response;
}

Eigen::VectorXd ratios(const Response& response, const Response& reference) {
  return response.eigenvalues.cwiseQuotient(reference.eigenvalues);
}

double mean(const Eigen::VectorXd& ratios) { return std::exp(ratios.array().log().mean()); }

// Mean over the modes of the share of `matrix` in their stiffness: d log(mean) / d log(beta) if it is that of the
// variance term.
double mean_share(const SparseMatrix& matrix, const Response& response) {
  const Eigen::MatrixXd pull = matrix * response.modes;
  return (response.modes.cwiseProduct(pull).colwise().sum().transpose().array() / response.eigenvalues.array()).mean();
}

// Volume of the tets no vertex of which is inside the body or beside one that is, over that of all.
double thin_share(const TetMesh& mesh) {
  std::vector<bool> outside(static_cast<std::size_t>(mesh.vertex_count()), false);
  const TriangleArray surface = surface_triangles(mesh.tets);
  for (const auto vertex : surface.reshaped()) outside[static_cast<std::size_t>(vertex)] = true;
  std::vector<bool> near_inside(outside.size(), false);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto tet = mesh.tets.row(t);
    if (std::ranges::any_of(tet, [&](auto v) { return !outside[static_cast<std::size_t>(v)]; }))
      for (const auto v : tet) near_inside[static_cast<std::size_t>(v)] = true;
  }
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  double thin = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    if (std::ranges::none_of(mesh.tets.row(t), [&](auto v) { return near_inside[static_cast<std::size_t>(v)]; }))
      thin += volumes[t];
  return thin / volumes.sum();
}

MeshStiffness compare(const TetMesh& mesh, TetMaterials materials, const FlagVector& fixed, const std::string& name) {
  const ElasticSystem own = build_elastic_system(mesh, materials, fixed);
  const Eigen::Index count = std::min(kModes, own.mass.rows() - own.null_space.cols() - 1);
  const Response reference =
      response_of(quadratic_tets(mesh, materials, fixed).system, count, name + ": quadratic tets");
  Response response = response_of(own, count, name + ": elements");
  if (materials.formulation == Formulation::kSmoothed) {
    const SparseMatrix unit =
        submatrix(expand_to_vectors(variance_matrix(mesh, materials, elements_of(mesh, materials))), own.free_dofs) /
        materials.variance_factor;
    for (int fit = 0; fit < kFits && std::abs(mean(ratios(response, reference)) - 1) > kFitted; ++fit) {
      const double beta = materials.variance_factor;
      const double change = -std::log(mean(ratios(response, reference))) / (beta * mean_share(unit, response));
      materials.variance_factor = std::clamp(beta * std::exp(std::clamp(change, -1.0, 1.0)), kLeastFactor, kMostFactor);
      if (materials.variance_factor == beta) break;
      response = response_of(build_elastic_system(mesh, materials, fixed), count, name + ": elements");
    }
  }
  MeshStiffness found;
  const Eigen::VectorXd of_modes = ratios(response, reference);
  found.vibration = mean(of_modes);
  found.worst = of_modes.maxCoeff();
  if (reference.sags.size() > 0)
    found.worst = std::max(found.worst, reference.sags.cwiseQuotient(response.sags).maxCoeff());
  found.thin = thin_share(mesh);
  found.variance_factor = materials.variance_factor;
  return found;
}

}  // namespace

std::optional<MeshStiffness> mesh_stiffness(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed,
                                            const std::string& name) {
  const Eigen::Index unknowns = 3 * (mesh.vertex_count() - fixed.cast<Eigen::Index>().sum());
  if (mesh.tet_count() > kMostComparedTets || unknowns < 9) return std::nullopt;
  try {
    return compare(mesh, materials, fixed, name);
  } catch (const WorkError& error) {  // what is wrong with the mesh or its clamp, the stages that need them say
    log::debug(name + ": not compared with quadratic tets: " + error.what());
  } catch (const InputError& error) {
    log::debug(name + ": not compared with quadratic tets: " + error.what());
  }
  return std::nullopt;
}

std::string to_string(const MeshStiffness& stiffness) {
  std::string text = fmt::format("this mesh is {:.2f} times as stiff as its material, {:.2f} times at worst",
                                 stiffness.vibration, stiffness.worst);
  if (stiffness.thin > 0.005) text += fmt::format("; {:.0f} % of it is one tet thick", 100 * stiffness.thin);
  return text;
}

}  // namespace exmat::precompute

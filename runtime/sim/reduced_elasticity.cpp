#include "runtime/sim/reduced_elasticity.h"

#include <algorithm>
#include <utility>

#include "common/elastic/st_venant_kirchhoff.h"

namespace exmat::runtime {
namespace {

// Eigen packs both factors of a product; beyond this size it would do so on the heap.
constexpr Eigen::Index kPackedDoubles = EIGEN_STACK_ALLOCATION_LIMIT / sizeof(double) * 3 / 4;

/// function(law) with the law's static functions.
template <class Function>
auto with_material(Material material, const Function& function) {
  switch (material) {
    case Material::kStVenantKirchhoff:
      break;
  }
  return function(StVenantKirchhoff{});
}

Eigen::Matrix3d gradient_of(const Eigen::VectorXd& gradients, Eigen::Index element) {
  return Eigen::Map<const RowMatrix3>(gradients.data() + 9 * element);
}

}  // namespace

std::optional<Material> material_from_name(std::string_view name) {
  if (name == "stvk") return Material::kStVenantKirchhoff;
  return std::nullopt;
}

std::vector<LameParameters> cubature_lame(const CubatureData& cubature) {
  std::vector<LameParameters> lame;
  for (Eigen::Index j = 0; j < cubature.weights.size(); ++j)
    lame.push_back(lame_parameters(cubature.youngs_modulus[j], cubature.poisson_ratio[j]));
  return lame;
}

ReducedElasticity::ReducedElasticity(Material material, RowMatrix gradient, Eigen::VectorXd weighted_volumes,
                                     std::vector<LameParameters> lame)
    : material_(material),
      gradient_(std::move(gradient)),
      weighted_volumes_(std::move(weighted_volumes)),
      lame_(std::move(lame)) {
  const Eigen::Index fitting = kPackedDoubles / (9 * std::max<Eigen::Index>(modes(), 1));
  batch_ = std::clamp<Eigen::Index>(fitting, 1, std::max<Eigen::Index>(elements(), 1));
}

ReducedElasticity::Workspace ReducedElasticity::make_workspace() const {
  return {Eigen::VectorXd::Zero(9 * elements()), Eigen::VectorXd::Zero(9 * elements()),
          RowMatrix::Zero(9 * batch_, modes())};
}

void ReducedElasticity::displacement_gradients(const Eigen::VectorXd& q, Workspace& workspace) const noexcept {
  workspace.displacement_gradients.noalias() = gradient_ * q;
}

double ReducedElasticity::energy(const Eigen::VectorXd& q, Workspace& workspace) const noexcept {
  displacement_gradients(q, workspace);
  return with_material(material_, [&](auto law) {
    double sum = 0;
    for (Eigen::Index j = 0; j < elements(); ++j)
      sum += weighted_volumes_[j] * law.energy(gradient_of(workspace.displacement_gradients, j), lame_[j]);
    return sum;
  });
}

double ReducedElasticity::force(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force) const noexcept {
  displacement_gradients(q, workspace);
  return force_at_gradients(workspace, force);
}

void ReducedElasticity::stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                                  Eigen::MatrixXd& stiffness) const noexcept {
  displacement_gradients(q, workspace);
  stiffness_at_gradients(tangent, workspace, stiffness);
}

double ReducedElasticity::force_and_stiffness(const Eigen::VectorXd& q, Workspace& workspace, Eigen::VectorXd& force,
                                              Eigen::MatrixXd& stiffness) const noexcept {
  displacement_gradients(q, workspace);
  stiffness_at_gradients(Tangent::kExact, workspace, stiffness);
  return force_at_gradients(workspace, force);
}

double ReducedElasticity::force_at_gradients(Workspace& workspace, Eigen::VectorXd& force) const noexcept {
  const double energy = with_material(material_, [&](auto law) {
    double sum = 0;
    for (Eigen::Index j = 0; j < elements(); ++j) {
      const Eigen::Matrix3d H = gradient_of(workspace.displacement_gradients, j);
      Eigen::Map<RowMatrix3> stress(workspace.stresses.data() + 9 * j);
      stress = weighted_volumes_[j] * law.first_piola_kirchhoff(H, lame_[j]);
      sum += weighted_volumes_[j] * law.energy(H, lame_[j]);
    }
    return sum;
  });
  force.noalias() = gradient_.transpose() * workspace.stresses;
  return energy;
}

void ReducedElasticity::stiffness_at_gradients(Tangent tangent, Workspace& workspace,
                                               Eigen::MatrixXd& stiffness) const noexcept {
  stiffness.triangularView<Eigen::Lower>().setZero();
  for (Eigen::Index first = 0; first < elements(); first += batch_) {
    const Eigen::Index count = std::min(batch_, elements() - first);
    with_material(material_, [&](auto law) {
      for (Eigen::Index j = 0; j < count; ++j) {
        const Eigen::Index element = first + j;
        Matrix9 D = law.tangent(gradient_of(workspace.displacement_gradients, element), lame_[element]);
        if (tangent == Tangent::kPositiveSemidefinite) D = project_positive_semidefinite(D);
        D *= weighted_volumes_[element];
        workspace.tangent_gradients.middleRows<9>(9 * j) = D.lazyProduct(gradient_.middleRows<9>(9 * element));
      }
    });
    stiffness.triangularView<Eigen::Lower>() +=
        gradient_.middleRows(9 * first, 9 * count).transpose() * workspace.tangent_gradients.topRows(9 * count);
  }
}

}  // namespace exmat::runtime

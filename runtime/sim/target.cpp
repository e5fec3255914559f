#include "runtime/sim/target.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <string>
#include <utility>

namespace exmat::runtime {
namespace {

constexpr int kMaxIterations = 50;
constexpr double kTolerance = 1e-9;        // of the largest example, in the energy norm
constexpr double kRegularisation = 1e-12;  // of the stiffest direction

/// target_basis L^-T with the rest stiffness L L^T in it: coordinates of unit stiffness at rest.
RowMatrix unit_stiffness_basis(Material material, const CubatureData& cubature, const RowMatrix& target_basis) {
  const ReducedElasticity elasticity(material, cubature.gradient * target_basis,
                                     cubature.weights.cwiseProduct(cubature.volumes), cubature_lame(cubature));
  auto workspace = elasticity.make_workspace();
  const Eigen::Index dimension = target_basis.cols();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(dimension, dimension);
  elasticity.stiffness(Eigen::VectorXd::Zero(dimension), Tangent::kExact, workspace, stiffness);
  stiffness.diagonal().array() += kRegularisation * stiffness.diagonal().maxCoeff();
  const Eigen::LLT<Eigen::MatrixXd> cholesky(stiffness);
  return cholesky.matrixL().solve(target_basis.transpose()).transpose();
}

/// d/dy of (F(p) F_k^-1) of one element [9 x d] from dF/dy: each row of F is multiplied by F_k^-1.
RowMatrix relative_gradient(const Eigen::Ref<const RowMatrix>& gradient, const Eigen::Matrix3d& example_gradient) {
  const Eigen::Matrix3d inverse_transpose = example_gradient.inverse().transpose();
  RowMatrix relative(9, gradient.cols());
  for (int a = 0; a < 3; ++a) relative.middleRows<3>(3 * a) = inverse_transpose * gradient.middleRows<3>(3 * a);
  return relative;
}

Complaint inverted_element(const ExampleData& example, Eigen::Index element, double determinant) {
  return {"", "/examples/" + example.name, "no inverted cubature element",
          "determinant " + std::to_string(determinant) + " in cubature element " + std::to_string(element),
          "use a milder example, or energy_reference \"rest\" in the scene"};
}

}  // namespace

std::optional<Complaint> TargetSolver::build(Material material, const CubatureData& cubature,
                                             const std::vector<ExampleData>& examples, const RowMatrix& target_basis,
                                             EnergyReference reference) {
  if (target_basis.cols() == 0)
    return Complaint{"", "/projection/target_basis", "at least one column", "none", "precompute the bundle again"};
  basis_ = unit_stiffness_basis(material, cubature, target_basis);
  const Eigen::Index elements = cubature.weights.size();
  const RowMatrix reduced_gradient = cubature.gradient * basis_;
  for (const ExampleData& example : examples) {
    RowMatrix gradient = reduced_gradient;
    Eigen::VectorXd weighted_volumes = cubature.weights.cwiseProduct(cubature.volumes);
    const Eigen::VectorXd displacement_gradients = cubature.gradient * example.reduced;
    for (Eigen::Index j = 0; reference == EnergyReference::kExample && j < elements; ++j) {
      const Eigen::Map<const RowMatrix3> H(displacement_gradients.data() + 9 * j);
      const Eigen::Matrix3d F = Eigen::Matrix3d::Identity() + H;
      const double determinant = F.determinant();
      if (!(determinant > 0)) return inverted_element(example, j, determinant);
      gradient.middleRows<9>(9 * j) = relative_gradient(reduced_gradient.middleRows<9>(9 * j), F);
      weighted_volumes[j] *= determinant;
    }
    energies_.emplace_back(material, std::move(gradient), std::move(weighted_volumes), cubature_lame(cubature));
    centres_.emplace_back(basis_.householderQr().solve(example.reduced));
    force_tolerance_ = std::max(force_tolerance_, kTolerance * centres_.back().norm());
  }
  return std::nullopt;
}

TargetSolver::Workspace TargetSolver::make_workspace() const {
  return {NewtonWorkspace(dimension()), energies_.front().make_workspace(), Eigen::VectorXd::Zero(dimension()),
          Eigen::VectorXd::Zero(dimension()), Eigen::MatrixXd::Zero(dimension(), dimension())};
}

class TargetSolver::Problem {
 public:
  Problem(const TargetSolver& solver, const Eigen::VectorXd& weights, Workspace& workspace)
      : solver_(solver), weights_(weights), workspace_(workspace) {}

  PotentialValue value(const Eigen::VectorXd& y) const {
    const double energy = solver_.energy(weights_, y, workspace_);
    return {energy, energy};
  }

  PotentialEvaluation gradient(const Eigen::VectorXd& y, Eigen::VectorXd& gradient) const {
    const double energy = solver_.force(weights_, y, workspace_, gradient);
    return {{energy, energy}, 1};
  }

  void hessian(const Eigen::VectorXd& y, Tangent tangent, Eigen::MatrixXd& hessian) const {
    hessian.setZero();
    for (std::size_t k = 0; k < solver_.energies_.size(); ++k) {
      if (weights_[k] == 0) continue;
      workspace_.shifted = y - solver_.centres_[k];
      solver_.energies_[k].stiffness(workspace_.shifted, tangent, workspace_.elasticity, workspace_.stiffness);
      hessian += weights_[k] * workspace_.stiffness;
    }
  }

  PotentialEvaluation gradient_and_hessian(const Eigen::VectorXd& y, Eigen::VectorXd& gradient_at_y,
                                           Eigen::MatrixXd& hessian_at_y) const {
    hessian(y, Tangent::kExact, hessian_at_y);
    return gradient(y, gradient_at_y);
  }

 private:
  const TargetSolver& solver_;
  const Eigen::VectorXd& weights_;
  Workspace& workspace_;
};

void TargetSolver::start(const Eigen::VectorXd& weights, Eigen::VectorXd& y) const noexcept {
  y.setZero();
  for (std::size_t k = 0; k < centres_.size(); ++k) y += weights[k] * centres_[k];
}

NewtonReport TargetSolver::solve(const Eigen::VectorXd& weights, Workspace& workspace,
                                 Eigen::VectorXd& y) const noexcept {
  Problem problem(*this, weights, workspace);
  return newton_minimize(problem, {kMaxIterations, force_tolerance_}, y, workspace.newton);
}

double TargetSolver::energy(const Eigen::VectorXd& weights, const Eigen::VectorXd& y,
                            Workspace& workspace) const noexcept {
  double sum = 0;
  for (std::size_t k = 0; k < energies_.size(); ++k) {
    if (weights[k] == 0) continue;
    workspace.shifted = y - centres_[k];
    sum += weights[k] * energies_[k].energy(workspace.shifted, workspace.elasticity);
  }
  return sum;
}

double TargetSolver::force(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace,
                           Eigen::VectorXd& force) const noexcept {
  double sum = 0;
  force.setZero();
  for (std::size_t k = 0; k < energies_.size(); ++k) {
    if (weights[k] == 0) continue;
    workspace.shifted = y - centres_[k];
    sum += weights[k] * energies_[k].force(workspace.shifted, workspace.elasticity, workspace.force);
    force += weights[k] * workspace.force;
  }
  return sum;
}

}  // namespace exmat::runtime

#include "runtime/sim/examples/target.h"

#include <Eigen/LU>
#include <algorithm>
#include <string>
#include <utility>

#include "common/core/decompositions.h"

namespace exmat::runtime {
namespace {

constexpr double kTolerance = 1e-10;       // of the largest example, in the energy norm
constexpr double kRegularisation = 1e-12;  // of the stiffest direction

/// target_basis L^-T with the rest stiffness L L^T in it: coordinates of unit stiffness at rest.
RowMatrix unit_stiffness_basis(MaterialModel material, const CubatureData& cubature, const RowMatrix& target_basis) {
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

constexpr int kRows[6] = {0, 1, 2, 1, 0, 0};  // of a symmetric 3 x 3 in the order of ElementLaw
constexpr int kColumns[6] = {0, 1, 2, 2, 2, 1};

/// The numbers of ElementLaw for volume Psi(F F_k^-1), kLanes apart. C_abcd = lambda b_ab b_cd
/// + mu (b_ac b_bd + b_ad b_bc), b = F_k^-1 F_k^-T, S0 = C : E_k, constant = E_k : C : E_k / 2.
void set_quadratic(const Eigen::Matrix3d& F, double volume, const LameParameters& lame, double* numbers) {
  const Eigen::Matrix3d inverse = F.inverse();
  const Eigen::Matrix3d b = inverse * inverse.transpose();
  const Eigen::Matrix3d strain = 0.5 * (F.transpose() * F - Eigen::Matrix3d::Identity());
  int entry = 0;
  double constant = 0;
  for (int i = 0; i < 6; ++i) {
    double stress = 0;
    for (int j = 0; j < 6; ++j) {
      const int a = kRows[i], c = kColumns[i], d = kRows[j], e = kColumns[j];
      const double value =
          volume * (lame.lambda * b(a, c) * b(d, e) + lame.mu * (b(a, d) * b(c, e) + b(a, e) * b(c, d)));
      if (j >= i) numbers[entry++ * kLanes] = value;
      stress += value * strain(d, e) * (j < 3 ? 1 : 2);
    }
    numbers[(21 + i) * kLanes] = stress;
    constant += 0.5 * stress * strain(kRows[i], kColumns[i]) * (i < 3 ? 1 : 2);
  }
  numbers[27 * kLanes] = constant;
}

Eigen::Matrix3d deformation_gradient(const Eigen::VectorXd& displacement_gradients, Eigen::Index element) {
  return Eigen::Matrix3d::Identity() + Eigen::Map<const RowMatrix3>(displacement_gradients.data() + 9 * element);
}

std::optional<Complaint> inverted_element(const ExampleData& example, const Eigen::VectorXd& displacement_gradients) {
  for (Eigen::Index j = 0; j < displacement_gradients.size() / 9; ++j) {
    const double determinant = deformation_gradient(displacement_gradients, j).determinant();
    if (!(determinant > 0))
      return Complaint{"", "/examples/" + example.name, "no inverted cubature element",
                       "determinant " + std::to_string(determinant) + " in cubature element " + std::to_string(j),
                       "use a milder example, or energy_reference \"rest\" in the scene"};
  }
  return std::nullopt;
}

// Limits for whole meshes, where a Hessian costs many gradients.
constexpr Eigen::Index kManyElements = 500;
constexpr double kManyChordRate = 0.6, kManyChordSteps = 16;

}  // namespace

void TargetSolver::set_quadratic(const CubatureData& cubature, const Eigen::VectorXd& displacement_gradients) {
  const std::vector<LameParameters> lame = cubature_lame(cubature);
  AlignedArray& numbers = quadratics_.emplace_back(quadratic_size());
  for (Eigen::Index j = 0; j < cubature.weights.size(); ++j) {
    const Eigen::Matrix3d F = deformation_gradient(displacement_gradients, j);
    runtime::set_quadratic(F, cubature.weights[j] * cubature.volumes[j] * F.determinant(),
                           lame[static_cast<std::size_t>(j)],
                           numbers.data() + j / kLanes * kQuadraticNumbers * kLanes + j % kLanes);
  }
}

void TargetSolver::set_shift(Eigen::Index k, const Eigen::VectorXd& displacement_gradients) {
  const Eigen::Index count = shifts_.size() / (potential_.panels() * 9 * kLanes);
  for (Eigen::Index i = 0; i < displacement_gradients.size(); ++i) {
    const Eigen::Index element = i / 9;
    shifts_[((element / kLanes * count + k) * 9 + i % 9) * kLanes + element % kLanes] = displacement_gradients[i];
  }
}

void TargetSolver::set_inverse(Eigen::Index k, const Eigen::VectorXd& displacement_gradients) {
  const Eigen::Index count = inverses_.size() / (potential_.panels() * kInverseNumbers * kLanes);
  for (Eigen::Index j = 0; j < elements(); ++j) {
    const Eigen::Matrix3d F = deformation_gradient(displacement_gradients, j);
    const Eigen::Matrix3d inverse = F.inverse();
    double* numbers = inverses_.data() + (j / kLanes * count + k) * kInverseNumbers * kLanes + j % kLanes;
    for (int i = 0; i < 9; ++i) numbers[i * kLanes] = inverse(i / 3, i % 3);
    numbers[9 * kLanes] = F.determinant();
  }
}

std::optional<Complaint> TargetSolver::build(MaterialModel material, const CubatureData& cubature,
                                             const std::vector<ExampleData>& examples, const RowMatrix& target_basis,
                                             EnergyReference reference) {
  if (target_basis.cols() == 0)
    return Complaint{"", "/projection/target_basis", "at least one column", "none", "precompute the bundle again"};
  const bool from_example = reference == EnergyReference::kExample;
  quadratic_ = from_example && material == MaterialModel::kStVenantKirchhoff;
  material_ = law_kind(material);
  basis_ = unit_stiffness_basis(material, cubature, target_basis);
  potential_ = ElementPotential(cubature.gradient * basis_);
  const auto count = static_cast<Eigen::Index>(examples.size());
  if (!quadratic_) {
    lame_ = WeightedLame(cubature.weights.cwiseProduct(cubature.volumes), cubature_lame(cubature));
    shifts_ = AlignedArray(potential_.panels() * count * 9 * kLanes);
    if (from_example) inverses_ = AlignedArray(potential_.panels() * count * kInverseNumbers * kLanes);
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    const ExampleData& example = examples[static_cast<std::size_t>(k)];
    const Eigen::VectorXd displacement_gradients = cubature.gradient * example.pose;
    if (from_example)
      if (auto complaint = inverted_element(example, displacement_gradients)) return complaint;
    if (quadratic_) {
      set_quadratic(cubature, displacement_gradients);
    } else {
      set_shift(k, displacement_gradients);
      if (from_example) set_inverse(k, displacement_gradients);
    }
    centres_.emplace_back(basis_.householderQr().solve(example.pose));
    force_tolerance_ = std::max(force_tolerance_, kTolerance * centres_.back().norm());
  }
  return std::nullopt;
}

TargetSolver::Workspace TargetSolver::make_workspace() const {
  return {NewtonWorkspace(dimension()), potential_.make_workspace(), AlignedArray(quadratic_ ? quadratic_size() : 0),
          AlignedArray(examples())};
}

/// sum_k w_k E_k as a law of the workspace.
ElementLaw TargetSolver::law(const Eigen::VectorXd& weights, Workspace& workspace) const noexcept {
  ElementLaw law;
  if (!quadratic_) {
    std::copy(weights.data(), weights.data() + weights.size(), workspace.shift_weights.data());
    law.kind = material_;
    law.mu = lame_.mu.data();
    law.lambda = lame_.lambda.data();
    law.shift_count = examples();
    law.shifts = shifts_.data();
    law.shift_weights = workspace.shift_weights.data();
    if (inverses_.size() > 0) law.inverses = inverses_.data();
    return law;
  }
  Eigen::Map<Eigen::VectorXd> blended(workspace.quadratic.data(), workspace.quadratic.size());
  blended.setZero();
  for (std::size_t k = 0; k < quadratics_.size(); ++k)
    if (weights[k] != 0)
      blended += weights[k] * Eigen::Map<const Eigen::VectorXd>(quadratics_[k].data(), quadratics_[k].size());
  law.kind = ElementLaw::Kind::kQuadraticInGreenStrain;
  law.quadratic = workspace.quadratic.data();
  return law;
}

class TargetSolver::Problem {
 public:
  Problem(const ElementPotential& potential, const ElementLaw& law, double scale, Workspace& workspace)
      : potential_(potential), law_(law), scale_(scale), workspace_(workspace) {}

  PotentialValue value(const Eigen::VectorXd& y) const { return scaled(potential_.energy(law_, y)); }

  PotentialEvaluation evaluate(const Eigen::VectorXd& y, Eigen::VectorXd& gradient) const {
    return {scaled(potential_.force(law_, y, workspace_.elements, gradient)), 1};
  }

  PotentialEvaluation evaluate(const Eigen::VectorXd& y, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) const {
    return {scaled(potential_.force_and_stiffness(law_, y, workspace_.elements, gradient, hessian)), 1};
  }

  void hessian(const Eigen::VectorXd& y, Tangent tangent, Eigen::MatrixXd& hessian) const {
    potential_.stiffness(law_, y, tangent, workspace_.elements, hessian);
  }

  void accept(const PotentialEvaluation&) const {}

 private:
  PotentialValue scaled(double energy) const { return {energy, energy + scale_}; }

  const ElementPotential& potential_;
  const ElementLaw law_;
  double scale_;  // of the terms that the energy is a difference of
  Workspace& workspace_;
};

void TargetSolver::start(const Eigen::VectorXd& weights, Eigen::VectorXd& y) const noexcept {
  y.setZero();
  for (std::size_t k = 0; k < centres_.size(); ++k) y += weights[k] * centres_[k];
}

NewtonReport TargetSolver::solve(const Eigen::VectorXd& weights, Workspace& workspace, Eigen::VectorXd& y,
                                 int max_iterations) const noexcept {
  const ElementLaw blended = law(weights, workspace);
  double scale = 0;
  for (Eigen::Index k = 0; k < examples(); ++k) scale += weights[k] * centres_[k].squaredNorm();
  Problem problem(potential_, blended, scale, workspace);
  NewtonSettings settings{max_iterations, force_tolerance_};
  if (potential_.elements() > kManyElements) {
    settings.chord_rate = kManyChordRate;
    settings.chord_steps = kManyChordSteps;
  }
  return newton_minimise(problem, settings, y, workspace.newton);
}

double TargetSolver::energy(const Eigen::VectorXd& weights, const Eigen::VectorXd& y,
                            Workspace& workspace) const noexcept {
  return potential_.energy(law(weights, workspace), y);
}

double TargetSolver::force(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace,
                           Eigen::VectorXd& force) const noexcept {
  return potential_.force(law(weights, workspace), y, workspace.elements, force);
}

void TargetSolver::hessian(const Eigen::VectorXd& weights, const Eigen::VectorXd& y, Workspace& workspace,
                           Eigen::MatrixXd& hessian) const noexcept {
  potential_.stiffness(law(weights, workspace), y, Tangent::kExact, workspace.elements, hessian);
}

}  // namespace exmat::runtime

#include "runtime/sim/examples/target_elasticity.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

constexpr Eigen::Index kPanelGradient = 9 * kLanes;

std::vector<LameParameters> lame_of(const TargetElasticityData& data) {
  std::vector<LameParameters> lame;
  for (Eigen::Index j = 0; j < data.weights.size(); ++j)
    lame.push_back(lame_parameters(data.youngs_modulus[j], data.poisson_ratio[j]));
  return lame;
}

}  // namespace

void invert_target(const double* H, double* inverse) noexcept {
  double F[9], cofactors[9];
  for (int i = 0; i < 9; ++i) F[i] = H[i * kLanes] + (i % 4 == 0 ? 1 : 0);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const int a1 = (a + 1) % 3, a2 = (a + 2) % 3, b1 = (b + 1) % 3, b2 = (b + 2) % 3;
      cofactors[3 * a + b] = F[3 * a1 + b1] * F[3 * a2 + b2] - F[3 * a1 + b2] * F[3 * a2 + b1];
    }
  const double determinant = F[0] * cofactors[0] + F[1] * cofactors[1] + F[2] * cofactors[2];
  const bool sound = determinant > 0;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      inverse[(3 * a + b) * kLanes] = sound ? cofactors[3 * b + a] / determinant : (a == b ? 1 : 0);
  inverse[9 * kLanes] = sound ? determinant : 0;
}

TargetElasticity::TargetElasticity(MaterialModel material, const TargetElasticityData& data,
                                   const RowMatrix& coordinates)
    : material_(law_kind(material)),
      dimension_(coordinates.cols()),
      potential_(data.gradient),
      lame_(data.weights.cwiseProduct(data.volumes), lame_of(data)),
      target_gradient_(potential_.panels() * kPanelGradient * dimension_) {
  const RowMatrix gradient = data.target_gradient * coordinates;
  const Eigen::Index stride = potential_.panels() * kPanelGradient;
  for (Eigen::Index j = 0; j < elements(); ++j)
    for (Eigen::Index i = 0; i < 9; ++i)
      for (Eigen::Index c = 0; c < dimension_; ++c)
        target_gradient_[c * stride + (j / kLanes * 9 + i) * kLanes + j % kLanes] = gradient(9 * j + i, c);
}

TargetElasticity::Workspace TargetElasticity::make_workspace() const {
  Workspace workspace{potential_.make_workspace(),
                      AlignedArray(potential_.panels() * kPanelGradient),
                      AlignedArray(potential_.panels() * kInverseNumbers * kLanes),
                      AlignedArray(1),
                      Eigen::VectorXd::Zero(modes()),
                      Eigen::MatrixXd::Zero(modes(), modes())};
  set_target(Eigen::VectorXd::Zero(dimension_), 0, workspace);
  return workspace;
}

void TargetElasticity::set_target(const Eigen::VectorXd& y, double factor, Workspace& workspace) const noexcept {
  const Eigen::Index rows = potential_.panels() * kPanelGradient;
  kernels().matrix_vector(target_gradient_.data(), rows, dimension_, rows, y.data(), workspace.shifts.data());
  for (Eigen::Index panel = 0; panel < potential_.panels(); ++panel)
    for (Eigen::Index lane = 0; lane < kLanes; ++lane)
      invert_target(workspace.shifts.data() + panel * kPanelGradient + lane,
                    workspace.inverses.data() + panel * kInverseNumbers * kLanes + lane);
  workspace.factor[0] = factor;
}

ElementLaw TargetElasticity::law(const Workspace& workspace) const noexcept {
  ElementLaw law;
  law.kind = material_;
  law.mu = lame_.mu.data();
  law.lambda = lame_.lambda.data();
  law.shift_count = 1;
  law.shifts = workspace.shifts.data();
  law.inverses = workspace.inverses.data();
  law.shift_weights = workspace.factor.data();
  return law;
}

double TargetElasticity::energy(const Eigen::VectorXd& q, const Workspace& workspace) const noexcept {
  return potential_.energy(law(workspace), q);
}

double TargetElasticity::add_force(const Eigen::VectorXd& q, Workspace& workspace,
                                   Eigen::VectorXd& force) const noexcept {
  const double energy = potential_.force(law(workspace), q, workspace.elements, workspace.force);
  force += workspace.force;
  return energy;
}

void TargetElasticity::add_stiffness(const Eigen::VectorXd& q, Tangent tangent, Workspace& workspace,
                                     Eigen::MatrixXd& hessian) const noexcept {
  potential_.stiffness(law(workspace), q, tangent, workspace.elements, workspace.hessian);
  hessian.triangularView<Eigen::Lower>() += workspace.hessian;
}

}  // namespace exmat::runtime

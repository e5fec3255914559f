#include "runtime/sim/elasticity/element_potential.h"

#include <algorithm>
#include <optional>

#include "common/elastic/materials.h"

namespace exmat::runtime {
namespace {

ElementScratch scratch_of(ElementPotential::Workspace& workspace) {
  return {workspace.force.data(), workspace.stiffness.data()};
}

/// Numbers of one element among tangents, panels x 45 x kLanes.
double* numbers_of(Eigen::Index element, AlignedArray& tangents) {
  return tangents.data() + element / kLanes * kTangentNumbers * kLanes + element % kLanes;
}

void write_tangent(const Matrix9& D, double* numbers) {
  for (int i = 0, entry = 0; i < 9; ++i)
    for (int j = i; j < 9; ++j, ++entry) numbers[entry * kLanes] = D(i, j);
}

/// Projects the tangents of all elements.
void project(Eigen::Index panels, AlignedArray& tangents) {
  for (Eigen::Index at = 0; at < panels * kLanes; ++at) {
    double* numbers = numbers_of(at, tangents);
    Matrix9 D;
    for (int i = 0, entry = 0; i < 9; ++i)
      for (int j = i; j < 9; ++j, ++entry) D(i, j) = D(j, i) = numbers[entry * kLanes];
    write_tangent(project_positive_semidefinite(D), numbers);
  }
}

/// The material of a law that is one at F itself, whose eigensystem is known.
std::optional<MaterialModel> material_of(const ElementLaw& law) {
  if (law.shift_count > 0) return std::nullopt;
  switch (law.kind) {
    case ElementLaw::Kind::kStVenantKirchhoff:
      return MaterialModel::kStVenantKirchhoff;
    case ElementLaw::Kind::kStableNeoHookean:
      return MaterialModel::kStableNeoHookean;
    case ElementLaw::Kind::kCorotational:
      return MaterialModel::kCorotational;
    case ElementLaw::Kind::kQuadraticInGreenStrain:
      break;
  }
  return std::nullopt;
}

}  // namespace

ElementLaw::Kind law_kind(MaterialModel model) {
  switch (model) {
    case MaterialModel::kStableNeoHookean:
      return ElementLaw::Kind::kStableNeoHookean;
    case MaterialModel::kCorotational:
      return ElementLaw::Kind::kCorotational;
    case MaterialModel::kStVenantKirchhoff:
      break;
  }
  return ElementLaw::Kind::kStVenantKirchhoff;
}

ElementPotential::ElementPotential(const RowMatrix& gradient)
    : elements_(gradient.rows() / 9),
      modes_(gradient.cols()),
      by_mode_(panels() * modes_ * 9 * kLanes),
      by_element_(padded(elements_) * 9 * padded(modes_)),
      by_pair_(by_element_.size() / 2) {
  auto* const pairs = reinterpret_cast<float*>(by_pair_.data());
  for (Eigen::Index j = 0; j < elements_; ++j)
    for (Eigen::Index i = 0; i < 9; ++i)
      for (Eigen::Index c = 0; c < modes_; ++c) {
        const double value = gradient(9 * j + i, c);
        by_mode_[((j / kLanes * modes_ + c) * 9 + i) * kLanes + j % kLanes] = value;
        by_element_[(9 * j + i) * padded(modes_) + c] = value;
        pairs[2 * ((9 * (j / 2) + i) * padded(modes_) + c) + j % 2] = static_cast<float>(value);
      }
}

ElementPotential::Workspace ElementPotential::make_workspace() const {
  const Eigen::Index stride = padded(modes_);
  return {AlignedArray(stride * kLanes), AlignedArray(lane_triangle(modes_) / kLanes),
          AlignedArray(panels() * kTangentNumbers * kLanes), AlignedArray(stride), Eigen::VectorXd::Zero(modes_)};
}

ElementArrays ElementPotential::arrays() const noexcept {
  return {panels(),           modes_,
          padded(modes_),     by_mode_.data(),
          by_element_.data(), reinterpret_cast<const float*>(by_pair_.data()),
          elements_};
}

double ElementPotential::energy(const ElementLaw& law, const Eigen::VectorXd& x) const noexcept {
  return kernels().energy(arrays(), law, x.data());
}

double ElementPotential::force(const ElementLaw& law, const Eigen::VectorXd& x, Workspace& workspace,
                               Eigen::VectorXd& force) const noexcept {
  return kernels().force(arrays(), law, x.data(), scratch_of(workspace), force.data());
}

double ElementPotential::force_and_stiffness(const ElementLaw& law, const Eigen::VectorXd& x, Workspace& workspace,
                                             Eigen::VectorXd& force, Eigen::MatrixXd& stiffness) const noexcept {
  return kernels().force_and_stiffness(arrays(), law, x.data(), scratch_of(workspace), force.data(), stiffness.data(),
                                       stiffness.outerStride());
}

void ElementPotential::projected_tangents(const ElementLaw& law, const Eigen::VectorXd& x,
                                          AlignedArray& tangents) const noexcept {
  const auto material = material_of(law);
  if (!material) {
    kernels().tangents(arrays(), law, x.data(), tangents.data());
    project(panels(), tangents);
    return;
  }
  using Gradient = Eigen::Map<const RowMatrix, Eigen::Unaligned, Eigen::OuterStride<>>;
  with_material(*material, [&](auto own) {
    for (Eigen::Index j = 0; j < panels() * kLanes; ++j) {
      const Gradient B(by_element_.data() + 9 * j * padded(modes_), 9, modes_, Eigen::OuterStride<>(padded(modes_)));
      Eigen::Matrix<double, 9, 1> H;
      H.noalias() = B * x;
      const Eigen::Matrix3d gradient = H.reshaped<Eigen::RowMajor>(3, 3);
      write_tangent(projected_tangent<decltype(own)>(gradient, {law.mu[j], law.lambda[j]}), numbers_of(j, tangents));
    }
  });
}

void ElementPotential::stiffness(const ElementLaw& law, const Eigen::VectorXd& x, Tangent tangent, Workspace& workspace,
                                 Eigen::MatrixXd& stiffness) const noexcept {
  if (tangent == Tangent::kExact) {
    force_and_stiffness(law, x, workspace, workspace.unused_force, stiffness);
    return;
  }
  projected_tangents(law, x, workspace.tangents);
  kernels().stiffness_of_tangents(arrays(), workspace.tangents.data(), scratch_of(workspace), stiffness.data(),
                                  stiffness.outerStride());
}

}  // namespace exmat::runtime

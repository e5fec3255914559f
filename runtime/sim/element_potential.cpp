#include "runtime/sim/element_potential.h"

#include <algorithm>

#include "common/elastic/material.h"

namespace exmat::runtime {
namespace {

ElementScratch scratch_of(ElementPotential::Workspace& workspace) {
  return {workspace.force.data(), workspace.product.data(), workspace.stiffness.data()};
}

/// Projects the tangents of all elements, panels x 45 x kLanes.
void project(Eigen::Index panels, AlignedArray& tangents) {
  for (Eigen::Index at = 0; at < panels * kLanes; ++at) {
    double* numbers = tangents.data() + at / kLanes * kTangentNumbers * kLanes + at % kLanes;
    Matrix9 D;
    for (int i = 0, entry = 0; i < 9; ++i)
      for (int j = i; j < 9; ++j, ++entry) D(i, j) = D(j, i) = numbers[entry * kLanes];
    D = project_positive_semidefinite(D);
    for (int i = 0, entry = 0; i < 9; ++i)
      for (int j = i; j < 9; ++j, ++entry) numbers[entry * kLanes] = D(i, j);
  }
}

}  // namespace

ElementPotential::ElementPotential(const RowMatrix& gradient)
    : elements_(gradient.rows() / 9),
      modes_(gradient.cols()),
      by_mode_(panels() * modes_ * 9 * kLanes),
      by_element_(padded(elements_) * 9 * padded(modes_)) {
  for (Eigen::Index j = 0; j < elements_; ++j)
    for (Eigen::Index i = 0; i < 9; ++i)
      for (Eigen::Index c = 0; c < modes_; ++c) {
        const double value = gradient(9 * j + i, c);
        by_mode_[((j / kLanes * modes_ + c) * 9 + i) * kLanes + j % kLanes] = value;
        by_element_[(9 * j + i) * padded(modes_) + c] = value;
      }
}

ElementPotential::Workspace ElementPotential::make_workspace() const {
  const Eigen::Index stride = padded(modes_);
  return {AlignedArray(stride * kLanes), AlignedArray(9 * kLanes * stride), AlignedArray(stride * stride),
          AlignedArray(panels() * kTangentNumbers * kLanes), Eigen::VectorXd::Zero(modes_)};
}

ElementArrays ElementPotential::arrays() const noexcept {
  return {panels(), modes_, padded(modes_), by_mode_.data(), by_element_.data()};
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

void ElementPotential::stiffness(const ElementLaw& law, const Eigen::VectorXd& x, Tangent tangent, Workspace& workspace,
                                 Eigen::MatrixXd& stiffness) const noexcept {
  if (tangent == Tangent::kExact) {
    force_and_stiffness(law, x, workspace, workspace.unused_force, stiffness);
    return;
  }
  kernels().tangents(arrays(), law, x.data(), workspace.tangents.data());
  project(panels(), workspace.tangents);
  kernels().stiffness_of_tangents(arrays(), workspace.tangents.data(), scratch_of(workspace), stiffness.data(),
                                  stiffness.outerStride());
}

}  // namespace exmat::runtime

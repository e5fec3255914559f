#include "runtime/sim/elasticity/constant_stiffness.h"

namespace exmat::runtime {

ConstantStiffness::ConstantStiffness(const RowMatrix& matrix) {
  if (matrix.isZero(0)) return;
  modes_ = matrix.rows();
  columns_ = AlignedArray(padded(modes_) * modes_);
  triangle_ = AlignedArray(lane_triangle(modes_) / kLanes);
  for (Eigen::Index i = 0; i < modes_; ++i)
    for (Eigen::Index j = 0; j < modes_; ++j) {
      columns_[j * padded(modes_) + i] = matrix(i, j);
      if (j <= i) triangle_[lane_entry(i, j) / kLanes] = matrix(i, j);
    }
}

double ConstantStiffness::energy(const Eigen::VectorXd& x, double* scratch) const noexcept {
  if (empty()) return 0;
  kernels().matrix_vector(columns_.data(), padded(modes_), modes_, padded(modes_), x.data(), scratch);
  return 0.5 * x.dot(Eigen::Map<const Eigen::VectorXd>(scratch, modes_));
}

double ConstantStiffness::add_force(const Eigen::VectorXd& x, double* scratch, Eigen::VectorXd& force) const noexcept {
  if (empty()) return 0;
  const double value = energy(x, scratch);
  force += Eigen::Map<const Eigen::VectorXd>(scratch, modes_);
  return value;
}

void ConstantStiffness::add_stiffness(Eigen::MatrixXd& stiffness) const noexcept {
  for (Eigen::Index j = 0; j < modes_; ++j)
    stiffness.col(j).tail(modes_ - j) +=
        Eigen::Map<const Eigen::VectorXd>(columns_.data() + j * padded(modes_) + j, modes_ - j);
}

void ConstantStiffness::add_lanes_energy(const double* x, double* scratch, double* energy) const noexcept {
  if (empty()) return;
  alignas(kAlignment) double sums[kLanes];
  kernels().lanes_matrix_product(columns_.data(), modes_, modes_, padded(modes_), x, scratch);
  kernels().lanes_dot(modes_, x, scratch, sums);
  for (std::ptrdiff_t lane = 0; lane < kLanes; ++lane) energy[lane] += 0.5 * sums[lane];
}

void ConstantStiffness::add_lanes_force(const double* x, double* scratch, double* energy,
                                        double* force) const noexcept {
  if (empty()) return;
  add_lanes_energy(x, scratch, energy);
  kernels().lanes_sum(modes_, force, scratch, force);
}

void ConstantStiffness::add_lanes_stiffness(double* stiffness) const noexcept {
  if (empty()) return;
  alignas(kAlignment) static constexpr double kOnes[kLanes] = {1, 1, 1, 1, 1, 1, 1, 1};
  kernels().lanes_add_constants(lane_triangle(modes_) / kLanes, triangle_.data(), kOnes, stiffness);
}

}  // namespace exmat::runtime

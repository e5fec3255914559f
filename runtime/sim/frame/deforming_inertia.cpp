#include "runtime/sim/frame/deforming_inertia.h"

namespace exmat::runtime {
namespace {

constexpr int kFirst[6] = {0, 1, 2, 1, 0, 0};                    // of the pairs xx, yy, zz, yz, xz, xy
constexpr double kMostSoftening = 0.25, kLeastSoftening = 1e-5;  // shares of inertia
constexpr int kSecond[6] = {0, 1, 2, 2, 2, 1};

/// d(1/2 w^T J w)/dP_ab of the six pairs, off-diagonal ones counted twice.
Eigen::Matrix<double, 6, 1> energy_slopes(const Eigen::Vector3d& spin) {
  Eigen::Matrix<double, 6, 1> slopes;
  for (int pair = 0; pair < 6; ++pair) {
    const int a = kFirst[pair], b = kSecond[pair];
    slopes[pair] = a == b ? 0.5 * (spin.squaredNorm() - spin[a] * spin[a]) : -spin[a] * spin[b];
  }
  return slopes;
}

}  // namespace

DeformingInertia::DeformingInertia(const RigidData& data)
    : mass_(data.mass),
      centre_of_mass_(data.centre_of_mass),
      second_moments_(data.second_moments),
      linear_(data.linear_moments.cols(), kSymmetric),
      stacked_(kProducts * padded(data.linear_moments.cols()) * data.linear_moments.cols()) {
  const Eigen::Index r = modes(), stride = padded(r);
  const auto S = [&](int a, int b) { return data.basis_moments.middleRows((3 * a + b) * r, r); };
  Eigen::Map<Eigen::MatrixXd> stacked(stacked_.data(), kProducts * stride, r);
  for (int pair = 0; pair < kSymmetric; ++pair) {
    const int a = kFirst[pair], b = kSecond[pair];
    pairs_[pair] = data.second_moments(a, b);
    linear_.col(pair) = data.linear_moments.row(3 * a + b);
    stacked.middleRows(pair * stride, r) = 0.5 * (S(a, b) + S(b, a));
  }
  for (int c = 0; c < 3; ++c) {
    const int a = (c + 1) % 3, b = (c + 2) % 3;
    stacked.middleRows((kSymmetric + c) * stride, r) = S(a, b) - S(b, a);
  }
}

DeformingInertia::Moments DeformingInertia::make_moments() const {
  return {AlignedArray(kProducts * padded(modes())), Eigen::Matrix3d::Zero(), Eigen::MatrixX3d::Zero(modes(), 3),
          Eigen::MatrixXd::Zero(modes(), kSymmetric)};
}

void DeformingInertia::moments(const Eigen::VectorXd& q, Moments& moments) const noexcept {
  const Eigen::Index stride = padded(modes()), rows = kProducts * stride;
  kernels().matrix_vector(stacked_.data(), rows, modes(), rows, q.data(), moments.products.data());
  const auto product = [&](int i) {
    return Eigen::Map<const Eigen::VectorXd>(moments.products.data() + i * stride, modes());
  };
  Eigen::Matrix3d P = second_moments_;
  for (int pair = 0; pair < kSymmetric; ++pair) {
    const double change = q.dot(linear_.col(pair) + product(pair));
    P(kFirst[pair], kSecond[pair]) += change;
    if (kFirst[pair] != kSecond[pair]) P(kSecond[pair], kFirst[pair]) += change;
    moments.gradients.col(pair) = linear_.col(pair) + 2 * product(pair);
  }
  moments.inertia = P.trace() * Eigen::Matrix3d::Identity() - P;
  for (int c = 0; c < 3; ++c) moments.deformation.col(c) = -product(kSymmetric + c);
}

void DeformingInertia::centrifugal_force(const Moments& moments, const Eigen::Vector3d& spin,
                                         Eigen::VectorXd& force) const noexcept {
  force.noalias() = moments.gradients.lazyProduct(energy_slopes(spin));
}

void DeformingInertia::gyroscopic_product(const Eigen::Vector3d& spin, const Eigen::VectorXd& v, AlignedArray& scratch,
                                          Eigen::VectorXd& product) const noexcept {
  const Eigen::Index stride = padded(modes()), all = kProducts * stride;
  kernels().matrix_vector(stacked_.data() + kSymmetric * stride, 3 * stride, modes(), all, v.data(), scratch.data());
  const auto part = [&](int c) { return Eigen::Map<const Eigen::VectorXd>(scratch.data() + c * stride, modes()); };
  product = spin[0] * part(0) + spin[1] * part(1) + spin[2] * part(2);
}

void DeformingInertia::add_gyroscopic(const Eigen::Vector3d& spin, double factor,
                                      Eigen::MatrixXd& matrix) const noexcept {
  const Eigen::Index stride = padded(modes());
  const Eigen::Map<const Eigen::MatrixXd> stacked(stacked_.data(), kProducts * stride, modes());
  for (int c = 0; c < 3; ++c) matrix += factor * spin[c] * stacked.middleRows((kSymmetric + c) * stride, modes());
}

void DeformingInertia::add_centrifugal(const Eigen::Vector3d& spin, double factor,
                                       Eigen::MatrixXd& matrix) const noexcept {
  const Eigen::Index stride = padded(modes());
  const Eigen::Matrix<double, 6, 1> slopes = 2 * factor * energy_slopes(spin);
  for (Eigen::Index j = 0; j < modes(); ++j) {
    const Eigen::Index below = modes() - j;
    const auto S = [&](int pair) {
      return Eigen::Map<const Eigen::VectorXd>(stacked_.data() + (j * kProducts + pair) * stride + j, below);
    };
    matrix.col(j).tail(below) +=
        slopes[0] * S(0) + slopes[1] * S(1) + slopes[2] * S(2) + slopes[3] * S(3) + slopes[4] * S(4) + slopes[5] * S(5);
  }
}

bool DeformingInertia::softens(const Eigen::Vector3d& spin, double velocity_factor) noexcept {
  const double share = spin.squaredNorm() / (velocity_factor * velocity_factor);
  return share >= kLeastSoftening && share <= kMostSoftening;
}

void DeformingInertia::add_softening(const Eigen::Vector3d& spin, double velocity_factor,
                                     Eigen::MatrixXd& hessian) const noexcept {
  if (softens(spin, velocity_factor)) add_centrifugal(spin, -1, hessian);
}

LaneRotationArrays DeformingInertia::lane_arrays() const noexcept {
  LaneRotationArrays arrays;
  arrays.modes = modes();
  arrays.stride = padded(modes());
  arrays.stacked = stacked_.data();
  arrays.linear = linear_.data();
  arrays.second_moments = pairs_.data();
  return arrays;
}

void DeformingInertia::inertia_slope(const Moments& moments, const Eigen::Vector3d& spin,
                                     Eigen::MatrixX3d& slope) const noexcept {
  // J w = tr(P) w - P w.
  for (int axis = 0; axis < 3; ++axis)
    slope.col(axis) = spin[axis] * (moments.gradients.col(0) + moments.gradients.col(1) + moments.gradients.col(2));
  for (int pair = 0; pair < kSymmetric; ++pair) {
    const int a = kFirst[pair], b = kSecond[pair];
    slope.col(a) -= spin[b] * moments.gradients.col(pair);
    if (a != b) slope.col(b) -= spin[a] * moments.gradients.col(pair);
  }
}

}  // namespace exmat::runtime
